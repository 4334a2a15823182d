"""Joints at which two sensors do not meet, whatever the cause: what no named fault explains is said, too.

In      pairs of sensors (sensor_pairs.py)
Out     joints that leave more of the acceleration of their centre unexplained than joints of intact sensors do: than those of other recordings, or than the
        recording's other joints, which tell how large its errors are: noise and scales of its glove, skin of its wearer
Source  what intact joints leave, in multiples of the noise of common_joint.py, is about lognormal: `MEDIAN`, `SPREAD` (reproduce crosschecks); an empirical
        null of the recording itself: Efron 2004, JASA 99:96
Limits  tells that something is wrong, not what; a joint that lies elsewhere than declared is no fault of its sensors
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.neighbours.joint_windows import LENGTH
from handscope.estimators.fault_detection.neighbours.paired_test import FEWEST
from handscope.estimators.fault_detection.neighbours.sensor_pairs import POOR, Pairs
from handscope.estimators.numerics.tail_probabilities import normal_sf
from handscope.estimators.numerics.typing import Array
from handscope.estimators.numerics.variance_components import (
    Components,
    Prior,
    fit_components,
)

MEDIAN, SPREAD = 0.15, 0.88  # of intact joints, skin that moves twice as much among them
FEW = 3  # windows in which a joint may leave much although it leaves little in the rest: a finger that moves a few times
MEDIAN_OF_FEW, SPREAD_OF_FEW = 0.17, 1.05  # of what intact joints leave in the FEW-th worst window
USUAL = 0.2  # probability of what a joint leaves among the recording's others from which on it is usual there, whatever other recordings' joints leave
CLEARLY_LESS = 0.25  # half the amplitude
MUCH = 0.25  # times the noise of common_joint.py, half of each size, from which on a joint is compared with the recording's others
# of a mean square: a hundredth to four times what common_joint.py assumes; windows of a joint err together; ours
SIZES = Prior(log=float(np.log(0.2)), sd=1.5, scatter=0.5, dependent=10.0)
# of the logarithm of what an intact joint leaves to what the others let expect, over all windows and in the FEW-th worst: of 5,107 joints in 370 simulated recordings of 37 kinds
# 0.0 and 0.3 in the middle, 2.8 and 3.3 at most; the spread is the largest of these in normal deviates
EXPECTED, EXPECTED_OF_FEW, SPREAD_AMONG = 0.0, 0.25, 0.75
KNOCKED = 0.01  # share of intact joints that something knocks against in one window, which says nothing of the others; ours


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


@dataclass
class Others:
    """What the joints of a recording that a sensor is not at tell of the sizes of its errors, learnt once."""

    pairs: Pairs
    _sizes: dict[str, Components] = field(default_factory=dict)

    def without(self, sensor: str) -> Components:
        if sensor not in self._sizes:
            joints = [j for j in self.pairs.joints if sensor not in j]
            fits = [self.pairs.joint(*j, j) for j in joints]
            use = [self.pairs.use(*j) & self.pairs.turns(*j) for j in joints]
            parts = [f.couple.parts[u] for f, u in zip(fits, use)]
            rest = [f.rest[u] for f, u in zip(fits, use)]
            self._sizes[sensor] = fit_components(
                np.concatenate([np.empty((0, 3)), *parts]),
                np.concatenate([np.empty(0), *rest]),
                SIZES,
            )
        return self._sizes[sensor]


def find(pairs: Pairs, others: Others) -> Iterator[Unexplained]:
    """Joints that leave more than intact ones, over all windows or in a few, with the probability that any joint of an intact recording leaves as much.

    `others` tell what is expected: those of the pairs themselves, or of the same recording as it was before one of its sensors was changed.
    """
    for joint in pairs.joints:
        among = _beyond_others(pairs, others, joint)
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


def _beyond_others(pairs: Pairs, others: Others, joint: tuple[str, str]) -> tuple[float, float]:
    """How many times what the recording's other joints let expect a joint leaves, and how probable that is; the joints of either of its sensors left out in turn."""
    near, use = pairs.joint(*joint, joint), pairs.use(*joint) & pairs.turns(*joint)
    if np.count_nonzero(use) < FEWEST or not _is_much(near.rest[use], near.noise[use]):
        return 0.0, 1.0
    rest = np.minimum(near.rest, pairs.joint_along(*joint).rest)[use]
    if not _is_much(rest, near.noise[use]):
        return 0.0, 1.0
    found, parts = [], near.couple.parts[use]
    for sensor in joint:
        sizes = others.without(sensor)
        order = np.argsort(rest / sizes.expected(parts))
        few = order[len(order) - FEW]
        _, by_all = _judge(rest, parts, sizes, EXPECTED)
        times, by_most = _judge(rest[order[:-1]], parts[order[:-1]], sizes, EXPECTED)
        found.append((times, by_all + KNOCKED * by_most))
        found.append(_judge(rest[few, None], parts[few, None], sizes, EXPECTED_OF_FEW))
    times, p = min(found, key=lambda each: each[1])
    return times, len(found) * p


def _judge(rest: Array, parts: Array, sizes: Components, middle: float) -> tuple[float, float]:
    """How many times what is expected some windows leave, and how probable that is of an intact joint."""
    times = float(rest.sum() / sizes.expected(parts).sum())
    spread = np.hypot(SPREAD_AMONG, sizes.spread(parts.sum(axis=0)))
    return times, float(normal_sf((np.log(max(times, 1e-12)) - middle) / spread))


def _is_much(rest: Array, noise: Array) -> bool:
    return bool(rest.sum() > MUCH * noise.sum() or np.sort(rest / noise)[-FEW] > MUCH)


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
    begin, end = (float(pairs.series.t[k]) for k in (0, -1))
    since = first if np.count_nonzero(agree & (t < first)) >= FEWEST else begin
    until = last if np.count_nonzero(agree & (t >= last)) >= FEWEST else end
    return (first, min(last, end)), (since, min(until, end))


def _relative(pairs: Pairs, joint: tuple[str, str]) -> tuple[Array, NDArray[np.bool_]]:
    """What a joint leaves in each window (K,), in noise, and where that is more than noise, or half of the most."""
    fitted, use = pairs.joint(*joint, joint), pairs.use(*joint) & pairs.turns(*joint)
    rest = fitted.rest / fitted.noise
    return rest, np.asarray(use & (rest >= min(1.0, 0.5 * float(rest[use].max()))))
