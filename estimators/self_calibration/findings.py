"""What one finger was found to be, and what of it movement told well enough to be used.

In      a Solution of one finger, its Segments and how sure they are
Out     Finger; how far joints bent, which lengths are known
"""

from dataclasses import dataclass

import numpy as np

from estimators.options import option
from estimators.quaternions import Array
from estimators.self_calibration.certainty import Certainty
from estimators.self_calibration.segments import Segments
from estimators.self_calibration.solver import Solution


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What is asked of a recording and of what is found in it."""

    shortest: float = option(
        10.0, "s", "shortest stretch of free movement that may calibrate", "ours: below, lengths are not known within 2 %", least=3.0
    )
    moving: float = option(20.0, "deg/s", "least average turning of a finger's last sensor that counts as free movement", "ours")
    bent: float = option(15.0, "deg", "a joint that was bent by less tells neither its axis nor lengths", "ours")
    length_known: float = option(
        0.05, "1", "largest standard deviation of a phalanx's length, share of it, with which it is used", "ours: what ratios are good for"
    )


@dataclass(frozen=True)
class Finger:
    """What one finger was found to be."""

    name: str
    t: Array  # (n,) s
    solution: Solution
    segments: Segments
    sure: Certainty


def known(asked: Asked, finger: Finger, segment: str) -> bool:
    length, sd = finger.segments.lengths[segment], finger.segments.lengths_sd[segment]
    joints = finger.solution.problem.chain.joints
    beside = [k for k, j in enumerate(joints) if segment in (_parent(finger, k), _child(finger, k))]
    bent = all(np.ptp(np.percentile(finger.solution.problem.bent[:, k], [1, 99])) >= np.radians(asked.bent) for k in beside)
    return sd < asked.length_known * length and bent


def _parent(finger: Finger, k: int) -> str:
    """The segment before joint k."""
    links = finger.solution.problem.chain
    return str(links.sensors[links.parents[k]])


def _child(finger: Finger, k: int) -> str:
    """The segment behind joint k."""
    links = finger.solution.problem.chain
    return str(links.sensors[links.children[k]])
