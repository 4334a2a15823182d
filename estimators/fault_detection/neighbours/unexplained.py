"""Joints at which two sensors do not meet, whatever the cause: what no named fault explains is said, too.

In      pairs of sensors (sensor_pairs.py)
Out     joints that leave more of the acceleration of their centre unexplained than joints of intact sensors do
Source  what intact joints leave, in multiples of the noise of common_joint.py, is about lognormal: `MEDIAN`, `SPREAD` (reproduce crosschecks)
Limits  tells that something is wrong, not what; a joint that lies elsewhere than declared is no fault of its sensors
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from handscope.estimators.fault_detection.neighbours.sensor_pairs import POOR, Pairs
from handscope.estimators.numerics.tail_probabilities import normal_sf

MEDIAN, SPREAD = 0.15, 0.88  # of intact joints; spread of the logarithm, by the upper tail


@dataclass(frozen=True)
class Unexplained:
    """A joint that leaves too much over."""

    joint: tuple[str, str]
    ratio: float  # multiples of the noise
    p_value: float
    span: tuple[float, float]  # s, in which it does


def find(pairs: Pairs) -> Iterator[Unexplained]:
    """Joints that leave more than intact ones, with the probability that any joint of an intact recording leaves as much."""
    for joint in pairs.joints:
        if not pairs.is_poor(*joint) or pairs.left(*joint, anywhere=True) < POOR:
            continue
        ratio = pairs.left(*joint)
        p = float(normal_sf(np.log(ratio / MEDIAN) / SPREAD)) * len(pairs.joints)
        yield Unexplained(joint, ratio, min(1.0, p), _span(pairs, joint))


def _span(pairs: Pairs, joint: tuple[str, str]) -> tuple[float, float]:
    """From the first to the last window that leaves more than noise."""
    fitted, use = pairs.joint(*joint, joint), pairs.use(*joint) & pairs.turns(*joint)
    t = pairs.windows(joint[0]).t[use & (fitted.rest > fitted.noise)]
    return float(t[0]), float(t[-1])
