"""The result for one finger, or the forearm, and which parts of it are certain enough to be used.

In      a Solution of one finger, its Segments and their standard deviations
Out     Finger; excursions of its joints, which lengths are known
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration.problem import Chain
from handscope.estimators.self_calibration.segments import Segments
from handscope.estimators.self_calibration.solver import Solution
from handscope.estimators.self_calibration.uncertainty.monte_carlo import Uncertainty


@dataclass(frozen=True, kw_only=True)
class Requirements:
    """Least movement of a recording, and largest standard deviations of the estimates that are used."""

    shortest: float = option(
        10.0,
        "s",
        "shortest stretch of free movement that may calibrate",
        "ours: below, lengths are not known within 2 %",
        least=3.0,
    )
    moving: float = option(
        20.0,
        "deg/s",
        "least average turning of a finger's last sensor that counts as free movement",
        "ours",
    )
    hand_moving: float = option(
        8.0,
        "deg/s",
        "least average turning of the hand's sensor that counts as free movement",
        "ours: skin under it turns it by 6 while the hand rests",
    )
    bent: float = option(
        15.0, "deg", "a joint that was bent by less tells neither its axis nor lengths", "ours"
    )
    length_known: float = option(
        0.05,
        "1",
        "largest standard deviation of a phalanx's length, share of it, with which it is used",
        "ours: what ratios are good for",
    )
    place_known: float = option(
        10.0,
        "mm",
        "largest standard deviation of a sensor's place on its segment with which it is told",
        "ours: half a phalanx",
    )


@dataclass(frozen=True)
class Finger:
    """The estimates of one finger, or of the forearm."""

    name: str  # of problem.LIMBS
    t: Array  # (n,) s
    solution: Solution
    segments: Segments
    sure: Uncertainty


def joint_excursions(solution: Solution) -> dict[str, float]:
    """Excursion of each joint, deg."""
    least, most = np.percentile(solution.problem.bent, [1, 99], axis=0)
    return dict(zip(solution.problem.chain.joints, np.degrees(most - least).tolist()))


def stiff_joints(asked: Requirements, solution: Solution) -> dict[str, float]:
    """Joints that hardly moved, deg."""
    return {
        joint: extent for joint, extent in joint_excursions(solution).items() if extent < asked.bent
    }


def adjacent_segments(chain: Chain, joint: str) -> tuple[str, str]:
    """The segments before and behind a joint."""
    k = chain.joints.index(joint)
    return chain.sensors[chain.parents[k]], chain.sensors[chain.children[k]]


def is_length_known(asked: Requirements, finger: Finger, segment: str) -> bool:
    """Whether a segment's length is known: both joints bent, and its standard deviation is small."""
    length, sd = finger.segments.lengths[segment], finger.segments.lengths_sd[segment]
    return sd < asked.length_known * length and not _is_beside_stiff(asked, finger, segment)


def is_placed(asked: Requirements, finger: Finger, segment: str) -> bool:
    """Whether the sensor's place on its segment is known: both joints bent, and its standard deviation is small."""
    return float(
        np.linalg.norm(finger.sure.p_BS[segment])
    ) < 1e-3 * asked.place_known and not _is_beside_stiff(asked, finger, segment)


def _is_beside_stiff(asked: Requirements, finger: Finger, segment: str) -> bool:
    return any(
        segment in adjacent_segments(finger.solution.problem.chain, joint)
        for joint in stiff_joints(asked, finger.solution)
    )
