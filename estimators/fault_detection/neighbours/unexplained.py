"""Joints at which two sensors do not meet, whatever the cause: what no named fault explains is said, too.

In      pairs of sensors (sensor_pairs.py)
Out     joints that leave more of the acceleration of their centre unexplained than joints of intact sensors do: than those of other recordings, or than the
        recording's other joints (other_joints.py)
Source  what intact joints leave, in multiples of the noise of common_joint.py, is about lognormal: `MEDIAN`, `SPREAD` (reproduce crosschecks)
Limits  tells that something is wrong, not what; a joint that lies elsewhere than declared is no fault of its sensors
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.neighbours.joint_windows import LENGTH
from handscope.estimators.fault_detection.neighbours.other_joints import (
    FEW,
    USUAL,
    Others,
    beyond_others,
)
from handscope.estimators.fault_detection.neighbours.paired_test import FEWEST
from handscope.estimators.fault_detection.neighbours.sensor_pairs import POOR, Pairs
from handscope.estimators.numerics.tail_probabilities import normal_sf
from handscope.estimators.numerics.typing import Array

MEDIAN, SPREAD = 0.15, 0.88  # of intact joints, skin that moves twice as much among them
MEDIAN_OF_FEW, SPREAD_OF_FEW = 0.17, 1.05  # of what intact joints leave in the FEW-th worst window
CLEARLY_LESS = 0.25  # half the amplitude


@dataclass(frozen=True)
class Unexplained:
    """A joint that leaves too much over."""

    joint: tuple[str, str]
    ratio: float  # multiples of what is expected
    p_value: float
    span: tuple[float, float]  # s, in which it is seen to
    doubtful: tuple[
        float, float
    ]  # s, in which it may: until enough windows that would show it do not


def find(pairs: Pairs, others: Others) -> Iterator[Unexplained]:
    """Joints that leave more than intact ones, over all windows or in a few, with the probability that any joint of an intact recording leaves as much.

    `others` tell what is expected: those of the pairs themselves, or of the same recording as it was before one of its sensors was changed.
    """
    for joint in pairs.joints:
        among = beyond_others(pairs, others, joint)
        if among[1] > USUAL:
            continue
        ratio, p = min(_beyond_other_recordings(pairs, joint), among, key=lambda each: each[1])
        if ratio > POOR:
            spans = spans_of(pairs, joint, *_relative(pairs, joint))
            yield Unexplained(joint, ratio, min(1.0, p * len(pairs.joints)), *spans)


def _beyond_other_recordings(pairs: Pairs, joint: tuple[str, str]) -> tuple[float, float]:
    """How many times the noise a joint leaves, and how probable that is of an intact one."""
    over_all, in_few = _over_all(pairs, joint), _in_few(pairs, joint)
    p = min(
        float(normal_sf(np.log(max(over_all, 1e-12) / MEDIAN) / SPREAD)),
        float(normal_sf(np.log(max(in_few, 1e-12) / MEDIAN_OF_FEW) / SPREAD_OF_FEW)),
    )
    return max(over_all, in_few), 2 * p


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


def spans_of(
    pairs: Pairs, joint: tuple[str, str], rest: Array, odd: NDArray[np.bool_]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """From the first to the last odd window (K,), and as far beyond as fewer than FEWEST windows leave (`rest`) clearly less than their movement would let the same fault leave."""
    t = pairs.windows(joint[0]).t
    square = np.maximum(pairs.turning(joint[0]), pairs.turning(joint[1])) ** 2
    would = np.median(rest[odd]) * square / np.median(square[odd])
    agree = pairs.use(*joint) & ~odd & (rest < CLEARLY_LESS * would)
    first, last = float(t[odd][0]), float(t[odd][-1]) + LENGTH
    begin, end = pairs.series.span
    since = first if np.count_nonzero(agree & (t < first)) >= FEWEST else begin
    until = last if np.count_nonzero(agree & (t >= last)) >= FEWEST else end
    return (first, min(last, end)), (since, min(until, end))


def _relative(pairs: Pairs, joint: tuple[str, str]) -> tuple[Array, NDArray[np.bool_]]:
    """What a joint leaves in each window (K,), in noise, and where that is more than noise, or half of the most."""
    fitted, use = pairs.joint(*joint, joint), pairs.use(*joint) & pairs.turns(*joint)
    rest = fitted.rest / fitted.noise
    return rest, np.asarray(use & (rest >= min(1.0, 0.5 * float(rest[use].max()))))
