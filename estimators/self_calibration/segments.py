"""From arms and axes in the sensors' frames to sensor-to-segment alignment, positions of the sensors and lengths of the segments.

In      a Solution of one finger (the root is the hand), the nominal mounting
Out     Segments: q_BS, p_BS, lengths with standard deviations, orientations of the segments
Source  frames: docs/conventions.md; z along the hinge's axis, y along the bone (near joint to far one); Kortier, thesis (4.2), (4.3)
Limits  of the hand's sensor and that of the distal phalanx the alignment is unobservable where no joint determines it (4.14): it is the nominal mounting's there
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.hand.anatomy import Hand, side_sign
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration.problem import (
    Chain,
    Unknowns,
    parameter_columns,
    remove_soft_tissue,
)
from handscope.estimators.self_calibration.solver import Solution

Y, Z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Segments:
    """By segment name."""

    q_BS: Mapping[str, Array]  # (4,) straight hand
    # (3,) m from the segment's distal joint; the last phalanx: from its only one
    p_BS: Mapping[str, Array]
    lengths: Mapping[str, float]  # m, of segments between two joints
    lengths_sd: Mapping[str, float]
    q_GB: Mapping[str, Array]  # (n, 4)


def of_solution(solution: Solution, hand: Hand, mounting: Mapping[str, Array]) -> Segments:
    """The segments of the chain."""
    at, chain, q_BS, p_BS, lengths, sds = solution.at, solution.problem.chain, {}, {}, {}, {}
    nominals = [
        quat.normalize(np.asarray(mounting.get(name, quat.IDENTITY), float))
        for name in chain.sensors
    ]
    axes = _flexion_axes(at, chain, nominals)
    for s, name in enumerate(chain.sensors):
        near, far = _arms(chain, at, s)
        q_BS[name] = _sensor_to_segment(axes[s], near, far, side_sign(hand), nominals[s])
        end = far if far is not None else near
        p_BS[name] = quat.rotate(q_BS[name], -end) if end is not None else np.zeros(3)
        if near is not None and far is not None:
            lengths[name] = float(np.linalg.norm(far - near))
            sds[name] = _length_sd(solution, s)
    return Segments(
        q_BS,
        p_BS,
        lengths,
        sds,
        {
            name: _segment_orientation(solution, s, q_BS[name])
            for s, name in enumerate(chain.sensors)
        },
    )


def _arms(chain: Chain, at: Unknowns, s: int) -> tuple[Array | None, Array | None]:
    """From a sensor to the joint before its segment and to the one behind it, where there is just one."""
    before, after = np.flatnonzero(chain.children == s), np.flatnonzero(chain.parents == s)
    return at.near[before[0]] if len(before) else None, at.far[after[0]] if len(
        after
    ) == 1 else None


def _flexion_axes(at: Unknowns, chain: Chain, nominals: Sequence[Array]) -> list[Array | None]:
    """Flexion axis (3,) of each segment in its sensor's frame, where a hinge determines it; its sign is that of most nominal mountings."""
    signs: list[float] = []
    own: list[list[tuple[int, Array]]] = [[] for _ in chain.sensors]
    for h, joint in enumerate(chain.hinges):
        parent = own[chain.parents[joint]]
        signs.append(
            signs[parent[0][0]] * float(np.sign(parent[0][1] @ at.axis_far[h])) if parent else 1.0
        )
        parent.append((h, at.axis_far[h]))
        own[chain.children[joint]].append((h, at.axis_near[h]))
    sums = [np.sum([signs[h] * axis for h, axis in axes], axis=0) if axes else None for axes in own]
    along = [
        0.0 if z is None else float(z @ quat.rotate(quat.conjugate(q), Z))
        for z, q in zip(sums, nominals)
    ]
    majority = float(np.sign(np.sum(np.sign(along))))
    return [
        None if z is None else (majority or np.sign(one)) * z / np.linalg.norm(z)
        for z, one in zip(sums, along)
    ]


def _sensor_to_segment(
    z: Array | None, near: Array | None, far: Array | None, sign: float, nominal: Array
) -> Array:
    """q_BS (4,): z from the hinges on either side, y from the bone, x square to both; nominal where that is not observable."""
    if z is None or near is None:
        return nominal
    y = sign * (far - near) if far is not None else quat.rotate(quat.conjugate(nominal), Y)
    y = y - (y @ z) * z
    y /= np.linalg.norm(y)
    return quat.conjugate(quat.from_matrix(np.column_stack([np.cross(y, z), y, z])))


def _length_sd(solution: Solution, s: int) -> float:
    chain, at, c = solution.problem.chain, solution.at, parameter_columns(solution.problem.chain)
    b, a = int(np.flatnonzero(chain.children == s)[0]), int(np.flatnonzero(chain.parents == s)[0])
    along = at.far[a] - at.near[b]
    along = along / np.linalg.norm(along)
    slope = np.zeros(c.count)
    slope[c.far][3 * a : 3 * a + 3], slope[c.near][3 * b : 3 * b + 3] = along, -along
    return float(np.sqrt(slope @ solution.factor.covariance @ slope))


def _segment_orientation(solution: Solution, s: int, q_BS: Array) -> Array:
    """Orientation of a sensor's segment (n, 4), what its skin does taken off."""
    return quat.multiply(
        remove_soft_tissue(solution.problem, solution.at)[:, s], quat.conjugate(q_BS)
    )
