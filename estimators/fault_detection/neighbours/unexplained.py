"""Joints at which two sensors do not meet, whatever the cause: what no named fault explains is said, too.

In      pairs of sensors (sensor_pairs.py)
Out     joints that leave more of the acceleration of their centre unexplained than joints of intact sensors do
Source  what intact joints leave, in multiples of the noise of common_joint.py, is about lognormal: `MEDIAN`, `SPREAD` (reproduce crosschecks)
Limits  tells that something is wrong, not what; a joint that lies elsewhere than declared is no fault of its sensors
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from handscope.estimators.fault_detection.neighbours.paired_test import FEWEST
from handscope.estimators.fault_detection.neighbours.sensor_pairs import POOR, Pairs
from handscope.estimators.numerics.tail_probabilities import normal_sf

MEDIAN, SPREAD = 0.15, 0.88  # of intact joints, skin that moves twice as much among them
FEW = 3  # windows in which a joint may leave much although it leaves little in the rest: a finger that moves a few times
MEDIAN_OF_FEW, SPREAD_OF_FEW = 0.17, 1.05  # of what intact joints leave in the FEW-th worst window


@dataclass(frozen=True)
class Unexplained:
    """A joint that leaves too much over."""

    joint: tuple[str, str]
    ratio: float  # multiples of the noise
    p_value: float
    span: tuple[float, float]  # s, in which it does


def find(pairs: Pairs) -> Iterator[Unexplained]:
    """Joints that leave more than intact ones, over all windows or in a few, with the probability that any joint of an intact recording leaves as much."""
    for joint in pairs.joints:
        over_all, in_few = _over_all(pairs, joint), _in_few(pairs, joint)
        p = min(
            float(normal_sf(np.log(max(over_all, 1e-12) / MEDIAN) / SPREAD)),
            float(normal_sf(np.log(max(in_few, 1e-12) / MEDIAN_OF_FEW) / SPREAD_OF_FEW)),
        )
        if max(over_all, in_few) > POOR:
            tests = 2 * len(pairs.joints)
            ratio = max(over_all, in_few)
            yield Unexplained(joint, ratio, min(1.0, p * tests), _span(pairs, joint))


def _over_all(pairs: Pairs, joint: tuple[str, str]) -> float:
    """What a joint leaves in all windows; 0 where another description may explain it, as of a joint that lies elsewhere."""
    if not pairs.is_poor(*joint) or pairs.left(*joint, anywhere=True) < POOR:
        return 0.0
    return pairs.left(*joint)


def _in_few(pairs: Pairs, joint: tuple[str, str]) -> float:
    """What it leaves in the FEW-th worst window, wherever it lies."""
    use = pairs.use(*joint) & pairs.turns(*joint)
    if np.count_nonzero(use) < FEWEST:
        return 0.0
    fits = (pairs.joint(*joint, joint), pairs.joint(*joint))
    return min(float(np.sort((f.rest / f.noise)[use])[-FEW]) for f in fits)


def _span(pairs: Pairs, joint: tuple[str, str]) -> tuple[float, float]:
    """From the first to the last window that leaves more than noise."""
    fitted, use = pairs.joint(*joint, joint), pairs.use(*joint) & pairs.turns(*joint)
    t = pairs.windows(joint[0]).t[use & (fitted.rest > fitted.noise)]
    return float(t[0]), float(t[-1])
