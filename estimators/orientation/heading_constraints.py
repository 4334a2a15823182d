"""Relative headings of neighbouring segments, kept by what their joint cannot do.

In      orientations of the segments from a fusion without magnetometer, and how much heading each
        sensor may have lost so far
Out     the orientations with corrected headings, and which headings are not known
Source  ours: one scalar Kalman filter a joint; that joints tell relative headings: Laidig, Lehmann,
        Begin & Seel 2019 (EMBC), Lehmann, Laidig & Seel 2020 (IFAC-PapersOnLine 53:2); their batch
        versions are in the package qmt
Limits  a joint whose free axis stands upright tells nothing; the thumb's CMC joint is held by its
        range alone; the hand's own heading stays what it is
"""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.options import option
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import (
    CHILDREN,
    DEVIATION,
    FLEXION,
    IS_DOF,
    JOINTS,
    LIMITS,
    PARENTS,
    PRONATION,
    SEGMENT,
    SEGMENTS,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import rowwise, rowwise_bool
from handscope.estimators.numerics.typing import Array, Bools

DEG = np.pi / 180
UPDATE = 0.2  # s of recording between two looks at the joints
VERTICAL = np.array([0.0, 0.0, 1.0])
# as kernels take them
_PARENTS, _CHILDREN, _SEGMENTS = (
    PARENTS.astype(float),
    CHILDREN.astype(float),
    np.zeros(len(SEGMENTS)),
)
_HAND = SEGMENT["hand"]


@dataclass(frozen=True, kw_only=True)
class HeadingParams:
    """Options of the heading correction; angles in deg."""

    heading_correction: bool = option(
        True,
        "",
        "correct relative headings by what the joints cannot do",
        "ours; the paper has none",
    )
    heading_walk: float = option(
        0.35,
        "deg/sqrt(s)",
        "random walk of a relative heading without magnetometer",
        "ours: 8.5 deg in ten minutes, as biases make that walk by 0.001 deg/s/sqrt(s) (consumer MEMS, see the simulator's sensors)",
    )
    joint_play: float = option(
        5.0,
        "deg",
        "turn about an axis that is no freedom of its joint, from misalignment and soft tissue",
        "sensors misaligned by 5-10 deg: Salchow-Hoemmen 2019, 5; size ours",
        least=0.1,
    )
    joint_play_known: float = option(
        2.0,
        "deg",
        "the same where a functional calibration tells how both sensors of the joint sit",
        "ours: soft tissue of 1.5 deg and the 1 deg that the calibration leaves",
        least=0.1,
    )
    joint_play_time: float = option(
        1.0, "s", "time over which that turn stays alike", "ours: half a movement", least=0.01
    )
    heading_known: float = option(
        10.0, "deg", "a relative heading of larger standard deviation counts as lost", "ours"
    )


@dataclass(frozen=True)
class State:
    """Everything by joint."""

    delta: Array  # (joints,) rad, heading by which the child is turned further on its parent
    variance: Array  # (joints,) rad^2
    gap_variance: Array  # (segments,) rad^2, heading lost by each sensor so far
    known: Bools  # (joints,) a functional calibration tells how both sensors sit
    t: float = -np.inf  # s, newest look


def start(known: Collection[str] = ()) -> State:
    """At the initial pose: relative headings are what the pose says. `known`: segments of which a
    functional calibration tells how the sensor sits."""
    both = np.array([joint.parent in known and joint.child in known for joint in JOINTS])
    return State(np.zeros(len(JOINTS)), np.zeros(len(JOINTS)), np.zeros(len(SEGMENTS)), both)


def step(
    params: HeadingParams,
    state: State,
    t: Array,
    q_GB: Array,
    gap_variance: Array,
    usable: Bools,
) -> tuple[State, Array, Bools]:
    """Corrected orientations (n, segments, 4) of orientations q_GB (n, segments, 4) and cumulative
    heading variances (n, segments) in rad^2, and which of their headings are lost (n, segments),
    none where there is no orientation; joints are looked at where both segments are `usable` (n,
    segments)."""
    looks = _update_rows(state.t, t)
    states = [state]
    for row in looks:
        states.append(
            _update(params, states[-1], float(t[row]), q_GB[row], gap_variance[row], usable[row])
        )
    # the look that counts in each row
    newest = np.searchsorted(looks, np.arange(len(t)), side="right")
    deltas = np.array([s.delta for s in states])
    corrected = quat.turn_heading(q_GB, _by_segment(deltas)[newest]) if deltas.any() else q_GB
    return (
        states[-1],
        corrected,
        _lost(params, states, newest, gap_variance) & np.isfinite(q_GB).all(axis=-1),
    )


def _lost(
    params: HeadingParams, states: list[State], newest: NDArray[np.int_], gap_variance: Array
) -> Bools:
    """Which headings (n, segments) are not known: by the look before, or because of a gap since."""
    variance, before = (
        np.array([getattr(s, name) for s in states])[newest]
        for name in ("variance", "gap_variance")
    )
    return _is_lost(
        _PARENTS, _CHILDREN, (params.heading_known * DEG) ** 2, variance, before, gap_variance
    )


@rowwise_bool("(j),(j),(),(j),(s),(s)->(s)")
def _is_lost(
    parents: Array,
    children: Array,
    most: float,
    variance: Array,
    gap_variance_before: Array,
    gap_variance: Array,
    lost: Bools,
) -> None:
    for j in range(parents.shape[0]):
        parent, child = int(parents[j]), int(children[j])
        at_parent, at_child = (
            gap_variance[parent] - gap_variance_before[parent],
            gap_variance[child] - gap_variance_before[child],
        )
        unsure = variance[j] + max(at_parent, 0.0) + max(at_child, 0.0) > most
        if child == _HAND:
            lost[parent], lost[child] = unsure, False
        else:
            lost[child] = lost[parent] or unsure


def _update_rows(t_last: float, t: Array) -> NDArray[np.int_]:
    """Rows at which the joints are looked at: the first in each stretch of UPDATE, wherever the
    blocks are cut."""
    slot = np.floor(t / UPDATE + 1e-9)
    before = np.concatenate([[np.floor(t_last / UPDATE + 1e-9)], slot[:-1]])
    return np.flatnonzero(slot > before)


def _update(
    params: HeadingParams,
    state: State,
    t: float,
    q_GB: Array,
    gap_variance: Array,
    usable: Bools,
) -> State:
    """One Kalman step of every joint at orientations q_GB (segments, 4)."""
    seconds = t - state.t if np.isfinite(state.t) else 0.0
    more = np.maximum(gap_variance - state.gap_variance, 0.0)
    walked = state.variance + (params.heading_walk * DEG) ** 2 * seconds
    # only a gap loses a heading
    slow = np.minimum(walked, np.maximum(state.variance, 0.99 * (params.heading_known * DEG) ** 2))
    predicted = slow + more[PARENTS] + more[CHILDREN]
    gap_variance = np.maximum(gap_variance, state.gap_variance)
    play = (np.where(state.known, params.joint_play_known, params.joint_play) * DEG) ** 2
    if (predicted <= play).all():  # the joints know no better
        return State(state.delta, predicted, gap_variance, state.known, t)
    miss, slope = _constraint_residuals(state.delta, np.where(usable[:, None], q_GB, np.nan))
    sharpness = (slope * slope).sum(axis=-1)
    learnt = predicted / (1.0 + predicted * sharpness * UPDATE / (play * params.joint_play_time))
    # the play stays the same for long: no look tells more than it leaves
    variance = np.maximum(learnt, np.minimum(predicted, play))
    gain = (1.0 - variance / np.where(predicted > 0, predicted, 1.0)) / np.where(
        sharpness > 0, sharpness, 1.0
    )
    delta = state.delta + np.where(predicted > variance, gain * (slope * miss).sum(axis=-1), 0.0)
    return State(delta, variance, gap_variance, state.known, t)


def _constraint_residuals(delta: Array, q_GB: Array) -> tuple[Array, Array]:
    """What the joints say: how far each angle (joints, 3) is from what is possible, and how it
    changes with the child's heading; zero where nothing."""
    parent, child = q_GB[PARENTS], quat.turn_heading(q_GB[CHILDREN], delta)
    angles = joint_angles.decompose(quat.relative(parent, child))
    miss = np.minimum(np.maximum(angles, LIMITS[..., 0]), LIMITS[..., 1]) - angles
    residual = np.isfinite(miss) & (~IS_DOF | (miss != 0))
    slopes = _slopes(angles, quat.rotate(quat.conjugate(parent), VERTICAL))
    return np.where(residual, miss, 0.0), np.where(residual, slopes, 0.0)


def _slopes(angles: Array, up: Array) -> Array:
    """How fast each angle (joints, 3) changes while the child turns about the vertical `up`
    (joints, 3) of its parent."""
    c, s = np.cos(angles[:, FLEXION]), np.sin(angles[:, FLEXION])
    x, y = c * up[:, 0] + s * up[:, 1], c * up[:, 1] - s * up[:, 0]
    # at 90 deg flexion and pronation are one
    deviation = np.minimum(np.maximum(angles[:, DEVIATION], -80 * DEG), 80 * DEG)
    slopes = np.empty_like(angles)
    slopes[:, FLEXION], slopes[:, DEVIATION], slopes[:, PRONATION] = (
        up[:, 2] - y * np.tan(deviation),
        x,
        y / np.cos(deviation),
    )
    return slopes


def _by_segment(by_joint: Array) -> Array:
    """Sums (n, segments) of a joint's values (n, joints) over the joints between a segment and the
    hand; the forearm's is the wrist's, turned round."""
    return _sum_over_segments(_PARENTS, _CHILDREN, by_joint, _SEGMENTS)


@rowwise("(j),(j),(j),(s)->(s)")
def _sum_over_segments(
    parents: Array, children: Array, by_joint: Array, row: Array, sums: Array
) -> None:
    for j in range(parents.shape[0]):
        parent, child = int(parents[j]), int(children[j])
        if child == _HAND:
            sums[parent], sums[child] = -by_joint[j], 0.0
        else:
            sums[child] = sums[parent] + by_joint[j]
