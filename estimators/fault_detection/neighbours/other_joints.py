"""What the other joints of a recording tell of a joint: how large errors are in it, noise and scales of its glove and skin of its wearer.

In      pairs of sensors (sensor_pairs.py)
Out     how much more than these let expect a joint leaves of the acceleration of its centre; whether they refute a fault that something else seems to show
Source  an empirical null of the recording itself: Efron 2004, JASA 99:96; sizes by variance_components.py; one description against another: paired_test.py
Limits  where all joints err alike nothing is beyond the others
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.neighbours import paired_test
from handscope.estimators.fault_detection.neighbours.paired_test import FEWEST
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.numerics.tail_probabilities import normal_sf
from handscope.estimators.numerics.typing import Array
from handscope.estimators.numerics.variance_components import (
    Components,
    Prior,
    fit_components,
)

USUAL = 0.2  # probability of what a joint leaves among the recording's others from which on it is usual there, whatever other recordings' joints leave
MUCH = 0.25  # times the noise of common_joint.py, half of each size, from which on a joint is compared with the recording's others
# of a mean square: a hundredth to four times what common_joint.py assumes; windows of a joint err together; ours
SIZES = Prior(log=float(np.log(0.2)), sd=1.5, scatter=0.5, dependent=10.0)
# of the logarithm of what an intact joint leaves to what the others let expect, over all windows and in the FEW-th worst: of 5,107 joints in 370 simulated recordings of 37 kinds
# 0.0 and 0.3 in the middle, 2.8 and 3.3 at most; the spread is the largest of these in normal deviates
EXPECTED, EXPECTED_OF_FEW, SPREAD_AMONG = 0.0, 0.25, 0.75
FEW = 3  # windows in which a joint may leave much although it leaves little in the rest: a finger that moves a few times
KNOCKED = 0.01  # share of intact joints that something knocks against in one window, which says nothing of the others; ours
MARGIN = 0.4  # of the mean log ratio of a joint, as for delays (delays.py)
REFUTED = 0.01  # probability of what speaks for the readings as they are if a fault explained the joints at least as well


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

    def refute_delay(self, sensors: Sequence[str], late: float, span: tuple[float, float]) -> bool:
        """Whether joints refute that sensors of one finger are late by `late` s within a span (s), as `_refute` has it."""
        pairs, without = self.pairs, {}
        for joint in pairs.joints:
            if (joint[0] in sensors) != (joint[1] in sensors):  # the parent late is the child early
                by = float(np.round(late if joint[1] in sensors else -late, 6))
                without[joint] = (pairs.joint(*joint, joint, by).rest, pairs.use(*joint, by))
        return self._refute(sensors[0], without, span)

    def refute_rates(self, sensor: str, M: Array, span: tuple[float, float]) -> bool:
        """Whether joints refute that a sensor turns at the rates that a matrix (3, 3) makes of its gyroscope's readings within a span (s), as `_refute` has it."""
        pairs, changed = self.pairs, self.pairs.with_rates(sensor, M)
        without = {
            joint: (changed.joint(*joint, joint).rest, pairs.use(*joint))
            for joint in pairs.joints
            if sensor in joint
        }
        return self._refute(sensor, without, span)

    def _refute(
        self,
        sensor: str,
        without_fault: Mapping[tuple[str, str], tuple[Array, NDArray[np.bool_]]],
        span: tuple[float, float],
    ) -> bool:
        """Whether joints leave what the recording's others let expect, and surely more where what they leave (K,), (m/s^2)^2, is that of readings without a fault."""
        pairs, sizes = self.pairs, self.without(sensor)
        t, gains, weights = pairs.windows(sensor).t, [], []
        for joint, (rest, known) in without_fault.items():
            use = known & pairs.use(*joint) & pairs.turns(*joint) & (t >= span[0]) & (t < span[1])
            if not use.any():
                continue
            fitted = pairs.joint(*joint, joint)
            parts = fitted.couple.parts
            if _judge(fitted.rest[use], parts[use], sizes, EXPECTED)[1] < USUAL:
                return False
            noise = sizes.expected(parts)
            gain = paired_test.log_rest(rest, noise) - paired_test.log_rest(fitted.rest, noise)
            gains.append(np.where(use, gain, 0.0))
            weights.append(np.where(use, paired_test.weight(rest, fitted.rest, noise), 0.0))
        if not gains:
            return False
        p = paired_test.p_value(np.mean(gains, axis=0), MARGIN, np.max(weights, axis=0))
        return p < REFUTED


def beyond_others(pairs: Pairs, others: Others, joint: tuple[str, str]) -> tuple[float, float]:
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
