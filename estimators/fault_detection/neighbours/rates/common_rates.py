"""Angular rates that two neighbours have in common, whatever the hand accelerates: those about the axes that their joint does not turn.

In      pairs of sensors (sensor_pairs.py)
Out     what the joint's axes leave over of both rates in every window, for any gain of a sensor and any delay between the two
Source  kernels.py; noise: of gyroscopes as the recording shows it, of skin (common_joint.SKIN) and of scales; sizes ours
Limits  joints of one axis, or of flexion and abduction: not the wrist and the thumb's CMC. A joint whose parent does not turn across the axis of flexion tells nothing
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.neighbours import joint_windows
from handscope.estimators.fault_detection.neighbours.common_joint import SKIN
from handscope.estimators.fault_detection.neighbours.rates.kernels import (
    PASSES,
    SIZE,
    fit_rates,
    leave_rates,
)
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.hand.anatomy import JOINTS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

AVERAGED = 2  # samples of the common time base: 50 Hz
NOISE = 0.002  # rad/s, of what two averaged rates differ, where the readings show no more
# order of the differences that show noise, and what white noise makes of their variance: the binomial coefficient of 8 over 4
DIFFERENCES, OF_NOISE = 4, 70.0
ENOUGH = 0.2  # of a window's differences
QUIET_SHARE = 10.0  # per cent of the windows, those with least noise, in which nothing moves
SCALE = 0.01  # of a rate: scale and cross-axis errors
BESIDE = 0.5  # of what a joint pulls the skin on its segments: on the next ones; ours
LAGGED = 5  # averaged samples, 0.1 s, within which skin that a joint pulls comes to rest; ours
PULLED = 0.015  # of the rates of all knuckles: what they turn the hand's sensor by skin
MISALIGNED, BIASED = 0.1, 0.01  # rad, rad/s, standard deviations of what is fitted
EXPLAINED = 1.5  # variances that most hinges leave at most in the middle of their windows
REFITTED = 4  # passes from a fit that is near
DOFS = {(j.parent, j.child): j.dofs for j in JOINTS}
Joint = tuple[str, str]


@dataclass
class CommonRates:
    """Rates of all sensors about their segments' axes, and what joints leave over of them, computed once."""

    pairs: Pairs
    _fits: dict[tuple[Joint, float, float, float], tuple[Array, Array]] = field(
        default_factory=dict
    )
    _near: dict[tuple[Joint, float, float, float], Array] = field(default_factory=dict)

    @cached_property
    def joints(self) -> list[Joint]:
        """Joints of one axis, and those of flexion and abduction."""
        return [j for j in self.pairs.joints if DOFS[j] in ((0,), (0, 1)) and j[1] != "hand"]

    @property
    def hinges(self) -> list[Joint]:
        """Joints of one axis."""
        return [j for j in self.joints if j[0] != "hand"]

    @cached_property
    def explains(self) -> bool:
        """Whether most hinges explain the rates on either side; otherwise it is not known how sensors sit on their segments, and rates tell nothing."""
        left = [self.left(j) for j in self.hinges]
        known = [float(np.nanmedian(each)) for each in left if np.isfinite(each).any()]
        return bool(known) and float(np.median(known)) < EXPLAINED

    @cached_property
    def rates(self) -> Mapping[str, tuple[Array, NDArray[np.bool_]]]:
        """By sensor: rates (n, 3) rad/s at 50 Hz, and where there are samples (n,)."""
        s = self.pairs.series
        n = len(s.t) // AVERAGED * AVERAGED
        mean = s.gyr[:n].reshape(-1, AVERAGED, *s.gyr.shape[1:]).mean(axis=1)
        there = np.asarray(s.whole[:n].reshape(-1, AVERAGED, len(s.sensors)).all(axis=1))
        columns = [there[:, k] for k in range(len(s.sensors))]
        return {
            name: (quat.rotate(self.pairs.q_BS[name], mean[:, k]), columns[k])
            for k, name in enumerate(s.sensors)
        }

    @cached_property
    def noise(self) -> Mapping[str, float]:
        """Variance of an averaged rate by sensor, (rad/s)^2: of the recording's quietest windows."""
        m = round(joint_windows.LENGTH * joint_windows.RATE) // AVERAGED
        return {name: noise_variance(*each, m) for name, each in self.rates.items()}

    @cached_property
    def t(self) -> Array:
        """Beginnings (K,) s of the windows."""
        s = self.pairs.series
        return np.asarray(s.t[s.chosen * round(joint_windows.LENGTH * joint_windows.RATE)])

    @cached_property
    def _rows(self) -> NDArray[np.int_]:
        m = round(joint_windows.LENGTH * joint_windows.RATE) // AVERAGED
        return np.asarray((self.pairs.series.chosen[:, None] * m + np.arange(m)).ravel())

    @cached_property
    def _of_knuckles(self) -> Array:
        """Sum of the squared rates (n,) of the fingers against the hand, (rad/s)^2."""
        roots = [j for j in self.joints if j[0] == "hand"]
        of_hand = self.rates["hand"][0][:, 2] if roots else np.zeros(len(self._rows))
        squares = [(self.rates[child][0][:, 2] - of_hand) ** 2 for _, child in roots]
        return _around(np.asarray(np.sum(squares, axis=0)))

    def left(
        self, joint: Joint, late: float = 0.0, of_parent: float = 1.0, of_child: float = 1.0
    ) -> Array:
        """What is left over (K,), in variances; rates divided by gains, the child's taken `late` s later; NaN where samples are missing."""
        key = (joint, late, of_parent, of_child)
        if key not in self._fits:
            near = (joint, 0.0, 1.0, 1.0)
            self._fits[key] = self._fit(key, None if key == near else self._known(near))
        return self._fits[key][1]

    def _known(self, key: tuple[Joint, float, float, float]) -> Array:
        self.left(*key)
        return self._fits[key][0]

    def left_near(self, joint: Joint, late: float) -> Array:
        """The same (K,) with the tilts and biases that fit best without a delay: as much as `left` or more, at a fraction of the cost."""
        key = (joint, late, 1.0, 1.0)
        if key not in self._near:
            x = self._known((joint, 0.0, 1.0, 1.0))
            self._near[key] = leave_rates(*self._problem(key), x)
        return self._near[key]

    def _pulled(
        self,
        joint: Joint,
        parent: Array,
        child: Array,
        rows: NDArray[np.int_],
        later: NDArray[np.int_],
    ) -> Array:
        """Squared rates (n,) of what pulls the skin under sensors that flex at these rates, (rad/s)^2: their joint, and BESIDE as much the one before and the one behind it."""
        before = [self.rates[a][0][rows, 2] - parent for a, b in self.pairs.joints if b == joint[0]]
        behind = [self.rates[b][0][later, 2] - child for a, b in self.pairs.joints if a == joint[1]]
        others = (np.square(rate) for rate in (*before, *behind))
        return np.asarray((child - parent) ** 2 + BESIDE**2 * sum(others))

    def _fit(
        self, key: tuple[Joint, float, float, float], near: Array | None
    ) -> tuple[Array, Array]:
        start = np.zeros(SIZE) if near is None else near
        prior = np.tile(np.repeat([MISALIGNED, BIASED], 2) ** -2.0, 2)
        passes = PASSES if near is None else REFITTED
        found: tuple[Array, Array] = fit_rates(*self._problem(key), start, prior, passes)
        return found

    def _problem(
        self, key: tuple[Joint, float, float, float]
    ) -> tuple[Array, Array, Array, int, float, bool]:
        """Rates of both, weights, windows' length and whether the joint abducts, as the kernels take them."""
        joint, late, of_parent, of_child = key
        parent, is_parent = self.rates[joint[0]]
        child, is_child = self.rates[joint[1]]
        later = self._rows + round(late * joint_windows.RATE / AVERAGED)
        inside = (later >= 0) & (later < len(child)) & (self._rows < len(parent))
        rows, later = np.minimum(self._rows, len(parent) - 1), np.clip(later, 0, len(child) - 1)
        a, b = parent[rows] / of_parent, child[later] / of_child
        there = is_parent[rows] & is_child[later] & inside
        pulled = self._pulled(joint, a[:, 2], b[:, 2], rows, later)
        of_both = max(NOISE**2, self.noise[joint[0]] + self.noise[joint[1]])
        variance = of_both + SKIN**2 * _around(pulled)
        variance += SCALE**2 * ((a**2).sum(axis=1) + (b**2).sum(axis=1))
        if joint[0] == "hand":
            variance += PULLED**2 * self._of_knuckles[rows]
        m = round(joint_windows.LENGTH * joint_windows.RATE) // AVERAGED
        return a, b, there / variance, m, AVERAGED / joint_windows.RATE, len(DOFS[joint]) > 1


def noise_variance(rate: Array, there: NDArray[np.bool_], m: int) -> float:
    """Variance of an axis of white noise in rates (n, 3) where samples are there (n,), by the windows of m in which differences of high order vary least; 0 where no window has enough of them."""
    known = np.convolve(there, np.ones(DIFFERENCES + 1), "valid") > DIFFERENCES + 0.5
    squares = np.where(known, (np.diff(rate, DIFFERENCES, axis=0) ** 2).mean(axis=1), 0.0)
    whole = len(squares) // m * m
    count, total = (v[:whole].reshape(-1, m).sum(axis=1) for v in (known, squares))
    enough = count >= ENOUGH * m
    if not enough.any():
        return 0.0
    return float(np.percentile(total[enough] / count[enough], QUIET_SHARE) / OF_NOISE)


def _around(square: Array) -> Array:
    """Means (n,) of a squared rate over LAGGED samples on either side: skin moves on after a joint has come to rest."""
    count = 2 * LAGGED + 1
    return np.convolve(square, np.full(count, 1.0 / count), "same")
