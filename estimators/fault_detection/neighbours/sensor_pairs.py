"""All pairs of sensors, each asked how well one joint between them explains what both read.

In      one time base of all sensors; about how sensors sit on their segments and how long those are
Out     what is left over in every window, for any two sensors at any joint and any delay between them; computed once, when it is asked for
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.neighbours import common_joint, joint_windows, paired_test
from handscope.estimators.fault_detection.neighbours.common_joint import Couple, Joint, Region
from handscope.estimators.fault_detection.neighbours.joint_windows import Series, Windows
from handscope.estimators.hand.anatomy import JOINTS, side_sign
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

DORSAL = {
    "hand": 0.014,
    "forearm": 0.02,
}  # m, of a sensor above the joints' line; elsewhere PHALANX
PHALANX = 0.009
REACH = {"hand": 0.03, "forearm": 0.05}  # m, how far a joint may be from where it is expected; ours
NEAR = 0.012
FROM_WRIST = 0.06  # m, of the forearm's sensor
BESIDE = 0.008  # m, beyond the end of its segment, that a sensor may sit from a joint, its height and lengths that are not declared right among them; ours
GAINED = (
    0.3  # log ratio by which a joint anywhere explains more than gravity does: movements 0.9 to 4
)
WHOLE = 0.99  # share of an instant's samples
AROUND = 10  # averaged instants beside a window, of which delayed ones are cut: 0.4 s
POOR = 2.0  # times its noise that a joint leaves over the recording; only then other descriptions are tried
UNEXPLAINED = 3.0  # times its noise that a joint leaves in the middle of its windows; intact ones leave about one


@dataclass
class Pairs:
    """Joints between sensors, by the sensors' names."""

    series: Series
    geometry: HandGeometry
    q_BS: Mapping[str, Array]
    among: frozenset[str] | None = None  # sensors that are looked at; None: all
    _couples: dict[tuple[str, str, float], Couple] = field(default_factory=dict)
    _weights: dict[tuple[str, str, float], Array] = field(default_factory=dict)
    _speed: dict[str, Array] = field(default_factory=dict)
    _windows: dict[tuple[str, float], Windows] = field(default_factory=dict)
    _regions: dict[tuple[str, str, tuple[str, str]], Region] = field(default_factory=dict)
    _around: dict[tuple[str, int], Windows] = field(default_factory=dict)
    _joints: dict[tuple[str, str, tuple[str, str] | None, float], Joint] = field(
        default_factory=dict
    )

    @cached_property
    def joints(self) -> list[tuple[str, str]]:
        """Parent and child of the hand's joints that have a sensor on either side."""
        present = self.series.sensors if self.among is None else self.among
        return [(j.parent, j.child) for j in JOINTS if j.parent in present and j.child in present]

    def joints_of(self, sensor: str) -> list[tuple[str, str]]:
        """Those that a sensor is at."""
        return [joint for joint in self.joints if sensor in joint]

    @cached_property
    def later(self) -> "Pairs":
        """The same in windows that begin half a window later."""
        first, s = round(0.5 * joint_windows.LENGTH * joint_windows.RATE), self.series
        return Pairs(
            replace(
                s,
                t=s.t[first:],
                gyr=s.gyr[first:],
                change=s.change[first:],
                acc=s.acc[first:],
                whole=s.whole[first:],
                doubt=s.doubt[first:],
            ),
            self.geometry,
            self.q_BS,
        )

    def with_gain(self, sensor: str, gain: float) -> "Pairs":
        """A sensor and its neighbours, its rates divided by a gain."""
        return self.with_rates(sensor, np.eye(3) / gain)

    def with_common_gain(self, gain: float) -> "Pairs":
        """All sensors, their rates divided by a gain."""
        series = self.series
        divided = replace(series, gyr=series.gyr / gain, change=series.change / gain)
        return Pairs(divided, self.geometry, self.q_BS)

    def with_rates(self, sensor: str, M: Array) -> "Pairs":
        """A sensor and its neighbours, its rates those that a matrix (3, 3) makes of its readings."""
        around = {sensor, *(n for joint in self.joints_of(sensor) for n in joint)}
        own = _by_matrix(self.series, sensor, M)
        windows = {(n, 0.0): self.windows(n) for n in around}
        (windows[sensor, 0.0],) = joint_windows.cut(own, (sensor,))
        return Pairs(self.series, self.geometry, self.q_BS, frozenset(around), _windows=windows)

    def windows(self, sensor: str, late: float = 0.0) -> Windows:
        if (sensor, late) not in self._windows:
            if late == 0.0:
                cut = joint_windows.cut(self.series, self.series.sensors)
                self._windows.update({(s, late): w for s, w in zip(self.series.sensors, cut)})
            else:
                step, part = divmod(round(late * joint_windows.RATE), joint_windows.AVERAGED)
                count, longer = self.windows(sensor).force.shape[1], self._longer(sensor, part)
                self._windows[sensor, late] = longer.within(AROUND + step, count)
        return self._windows[sensor, late]

    def _longer(self, sensor: str, later: int) -> Windows:
        """A sensor's windows with AROUND more instants on either side, by some samples later."""
        if (sensor, later) not in self._around:
            (cut,) = joint_windows.cut(self.series, (sensor,), AROUND, later)
            self._around[sensor, later] = cut
        return self._around[sensor, later]

    def use(self, a: str, b: str, late: float = 0.0) -> NDArray[np.bool_]:
        """Windows (K,) in which both have samples."""
        return np.asarray(self._weight(a, b, late).any(axis=1))

    def whole(self, a: str, b: str) -> NDArray[np.bool_]:
        """Windows (K,) in which both have all samples."""
        return np.asarray(self._weight(a, b, 0.0).all(axis=1))

    def _weight(self, a: str, b: str, late: float) -> Array:
        """Of the instants (K, m) of two sensors' windows: the longest piece that is whole in both."""
        if (a, b, late) not in self._weights:
            share = np.minimum(self.windows(a).share, self.windows(b, late).share)
            self._weights[a, b, late] = joint_windows.longest_pieces(share > WHOLE)
        return self._weights[a, b, late]

    def joint(self, a: str, b: str, at: tuple[str, str] | None = None, late: float = 0.0) -> Joint:
        """The joint between two sensors that sit on the segments `at`, its place free without them; the readings of `b` taken `late` s later."""
        key = (a, b, at, late)
        if key not in self._joints:
            region = None if at is None else self.expected(a, b, at)
            use = self.use(a, b, late).astype(float)
            self._joints[key] = common_joint.fit(self.couple(a, b, late), use, region)
        return self._joints[key]

    def joint_within(self, a: str, b: str, span: tuple[float, float]) -> Joint:
        """The same of two neighbours in windows that lie within a span (s), where the movement does not tell it near where it is expected."""
        t, region = self.windows(a).t, self.expected(a, b, (a, b))
        use = self.use(a, b) & (t >= span[0]) & (t + joint_windows.LENGTH <= span[1])
        near = replace(region, reach=np.full(2, np.inf), sd=NEAR)
        return common_joint.refit(self.joint(a, b, (a, b)), use.astype(float), near)

    def joint_along(self, a: str, b: str) -> Joint:
        """The joint of two neighbours that sit anywhere on their segments."""
        region = self.expected(a, b, (a, b))
        ends = np.array([0.5 * self._length(s) + BESIDE for s in (a, b)])
        anywhere = replace(region, reach=np.maximum(region.reach, ends))
        return common_joint.fit(self.couple(a, b), self.use(a, b).astype(float), anywhere)

    def couple(self, a: str, b: str, late: float = 0.0) -> Couple:
        """Two sensors, the readings of `b` taken `late` s later."""
        key = (a, b, late)
        if key not in self._couples:
            expected = self.expected(a, b, (a, b)).centre if (a, b) in self.joints else np.zeros(6)
            weight, both = self._weight(a, b, late), (self.windows(a), self.windows(b, late))
            if not (weight == 1.0).all():
                both = replace(both[0], weight=weight), replace(both[1], weight=weight)
            self._couples[key] = Couple(*both, self._pulled(a, b), expected)
        return self._couples[key]

    def turning(self, sensor: str) -> Array:
        """How much a sensor turns in each window (K,), 1/s^2 (Windows.turning)."""
        return self.windows(sensor).turning

    def speed(self, sensor: str) -> Array:
        """How fast a sensor turns, (K, m) rad/s."""
        if sensor not in self._speed:
            self._speed[sensor] = np.asarray(np.linalg.norm(self.windows(sensor).rate, axis=2))
        return self._speed[sensor]

    @cached_property
    def by_skin(self) -> Array:
        """Root mean square rate (K,) rad/s that skin may give to a segment that does not move itself."""
        most = np.max([(self.speed(s) ** 2).mean(axis=1) for s in self.series.sensors], axis=0)
        return np.asarray(common_joint.CLEAR * common_joint.SKIN * np.sqrt(most))

    def moves(self, sensor: str) -> NDArray[np.bool_]:
        """In which windows (K,) a segment clearly moves itself."""
        return np.asarray(np.sqrt((self.speed(sensor) ** 2).mean(axis=1)) > self.by_skin)

    def _pulled(self, a: str, b: str) -> Array:
        """The largest of that among the sensors around two sensors, as they are declared."""
        around = {s for joint in self.joints for s in joint if a in joint or b in joint}
        return np.asarray(np.max([self.turning(s) for s in (a, b, *around)], axis=0))

    def expected(self, a: str, b: str, at: tuple[str, str]) -> Region:
        """Where the joint between the segments `at` lies for sensors that sit in the middle of their backs, each mounted as it says."""
        if (a, b, at) not in self._regions:
            self._regions[a, b, at] = self._expected(a, b, at)
        return self._regions[a, b, at]

    def _expected(self, a: str, b: str, at: tuple[str, str]) -> Region:
        parent, child = at
        joint = next(j.name for j in JOINTS if (j.parent, j.child) == at)
        sign = side_sign(self.geometry.hand)
        if parent == "hand":
            far = np.array(self.geometry.joint_positions[joint]) - sign * np.array(
                [0.0, 0.5 * self.geometry.palm_length, 0.0]
            )
        else:
            far = sign * np.array([0.0, 0.5 * self._length(parent), 0.0])
        near = sign * np.array([0.0, -0.5 * self._length(child), 0.0])
        places = []
        for sensor, segment, place in ((a, parent, far), (b, child, near)):
            above = sign * np.array([DORSAL.get(segment, PHALANX), 0.0, 0.0])
            places.append(quat.rotate(quat.conjugate(self.q_BS[sensor]), place - above))
        return Region(np.concatenate(places), np.array([REACH.get(s, NEAR) for s in at]))

    def _length(self, segment: str) -> float:
        """Length of a segment, m; of the forearm twice what its sensor sits from the wrist."""
        known = {"hand": self.geometry.palm_length, "forearm": 2 * FROM_WRIST}
        return known[segment] if segment in known else self.geometry.lengths[segment]

    def is_doubtful(self, a: str, b: str) -> bool:
        """Whether several windows leave more than noise of the joint between two segments, where they turn."""
        joint, use = self.joint(a, b, (a, b)), self.use(a, b) & self.turns(a, b)
        return bool(np.count_nonzero((joint.rest > joint.noise)[use]) >= paired_test.FEWEST)

    def is_poor(self, a: str, b: str) -> bool:
        """Whether the joint leaves anything over the whole recording that another description could explain."""
        joint, use = self.joint(a, b, (a, b)), self.use(a, b) & self.turns(a, b)
        many = np.count_nonzero((joint.rest > 1.5 * joint.noise)[use]) >= paired_test.FEWEST
        return bool(many and self.left(a, b) > POOR)

    def left(self, a: str, b: str, anywhere: bool = False) -> float:
        """What the joint between two segments leaves over where they turn, in multiples of its noise; wherever it lies, if asked so."""
        joint = self.joint(a, b, None if anywhere else (a, b))
        use = self.use(a, b) & self.turns(a, b)
        return float(joint.rest[use].sum() / max(joint.noise[use].sum(), 1e-12))

    @cached_property
    def explains(self) -> bool:
        """Whether most joints explain what their sensors read, and better than gravity without any movement's acceleration does.

        Otherwise what was measured is no hand of rigid segments (as in simulations that leave accelerations out), and joints tell nothing.
        """
        left, gained = [], []
        for a, b in self.joints:
            use = self.use(a, b) & self.turns(a, b)
            if np.count_nonzero(use) >= paired_test.FEWEST:
                joint = self.joint(a, b)
                by_gravity = self.couple(a, b).left_by_gravity
                left.append(float(np.median((joint.rest / joint.noise)[use])))
                gain = paired_test.log_rest(by_gravity, joint.noise) - paired_test.log_rest(
                    joint.rest, joint.noise
                )
                gained.append(float(gain[use].mean()))
        return not left or bool(np.median(left) < UNEXPLAINED and np.median(gained) > GAINED)

    def turns(self, a: str, b: str) -> NDArray[np.bool_]:
        """Windows (K,) in which either of two sensors turns, not only its noise."""
        return np.asarray(np.maximum(self.turning(a), self.turning(b)) > common_joint.TURNS)


def _by_matrix(series: Series, sensor: str, M: Array) -> Series:
    """One sensor's series, its rates by a matrix (3, 3)."""
    k = series.sensors.index(sensor)
    only = slice(k, k + 1)
    return replace(
        series,
        sensors=(sensor,),
        gyr=series.gyr[:, only] @ M.T,
        change=series.change[:, only] @ M.T,
        acc=series.acc[:, only],
        whole=series.whole[:, only],
        doubt=series.doubt[:, only],
    )
