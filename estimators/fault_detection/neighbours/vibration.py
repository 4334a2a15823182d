"""Sensors and strips that are late, by the vibration that they have in common: accelerations of a joint's centre at 6 to 13 Hz.

In      pairs of sensors (sensor_pairs.py)
Out     delays as delays.py has them
Source  physiological tremor of 8 to 12 Hz moves a hand that is not laid down (Deuschl et al. 1998, Mov Disord 13 Suppl 3), and all its segments with it, whatever its fingers do
        besides; ours: either side of a joint sees its centre's acceleration in a frame that does not turn. Gravity is the vertical of both, the heading between them the one that fits best
Limits  a hand that lies on a table hardly vibrates; vibration of one frequency fits nearly as well a period later, and then tells nothing
"""

from collections.abc import Collection
from dataclasses import dataclass, field
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.neighbours import delays, joint_windows, paired_test
from handscope.estimators.fault_detection.neighbours.common_joint import ARM, SKIN
from handscope.estimators.fault_detection.neighbours.delays import Delay
from handscope.estimators.fault_detection.neighbours.joint_windows import Windows
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.numerics.typing import Array

AVERAGED = 2  # samples of the common time base: 50 Hz
STEP = AVERAGED / joint_windows.RATE  # s, of the lags
PARTS = 4  # of a step, between which a phase shifts the spectrum
FREQUENCIES = np.arange(6.0, 14.0)  # Hz
AROUND = round(delays.FURTHEST / STEP)  # instants beside a window
NOISE = 0.03  # m/s^2, of an axis of the difference: white noise of two accelerometers, and their gyroscopes' by the arms; twice that of 150 ug a root of a Hz
SCALE = 0.03  # of the vibration: scales, cross-axis errors, a vertical 1 deg off by a bias, filters that differ; ours
COMPLETE = 0.95  # least share of a window's samples, what is beside it included
ODD = 2.0  # times its noise that a window leaves where a delay may be
MARGIN = 0.4  # of the mean log ratio of a joint, as for delays (delays.py)
NEAR_ZERO = 0.03  # s: lags that are none
Joint = tuple[str, str]


@dataclass
class Vibration:
    """Vibration of all joints, computed once: at no lag by the windows of the accelerations at joints, else by longer ones."""

    pairs: Pairs
    _longer: dict[str, Windows] = field(default_factory=dict)
    _signals: dict[tuple[Joint, str], "_Signal"] = field(default_factory=dict)
    _curves: dict[Joint, Array] = field(default_factory=dict)
    _arms: dict[str, Array] = field(default_factory=dict)

    @cached_property
    def lags(self) -> Array:
        """Lags (L,) s."""
        steps = (AROUND - 1) * PARTS
        return np.asarray(STEP / PARTS * np.arange(-steps, steps + 1))

    @cached_property
    def zero(self) -> slice:
        """Lags that are none."""
        near = np.flatnonzero(np.abs(self.lags) <= NEAR_ZERO + 1e-9)
        return slice(int(near[0]), int(near[-1]) + 1)

    def windows(self, sensor: str) -> Windows:
        """Windows that are longer by AROUND on either side."""
        if sensor not in self._longer:
            (cut,) = joint_windows.cut(self.pairs.series, (sensor,), AROUND, averaged=AVERAGED)
            self._longer[sensor] = cut
        return self._longer[sensor]

    def use(self, joint: Joint) -> NDArray[np.bool_]:
        """Windows (K,) in which both sensors have samples at all lags."""
        a, b = (self.windows(s).share.mean(axis=1) for s in joint)
        return np.asarray((a > COMPLETE) & (b > COMPLETE))

    def noise(self, joint: Joint) -> Array:
        """Mean square (K,) of an axis that intact sensors leave: their noise and scales, and what skin makes of the joint's place."""
        around = {s for j in self.pairs.joints if {*j} & {*joint} for s in j}
        skin = np.max([self._energy_of_arm(s) for s in around], axis=0)
        a = self._signal(joint, joint[0], at_no_lag=True).at(0)
        return np.asarray(NOISE**2 + (ARM * SKIN) ** 2 * skin + SCALE**2 * _energy_of(a))

    def is_odd(self, joint: Joint) -> bool:
        """Whether several windows leave more than noise without a delay."""
        a, b = (self._signal(joint, s, at_no_lag=True).at(0) for s in joint)
        left, use = _difference(a, b), self.pairs.use(*joint)
        if np.count_nonzero((left > ODD * NOISE**2) & use) < paired_test.FEWEST:
            return False
        return bool(np.count_nonzero((left > ODD * self.noise(joint)) & use) >= paired_test.FEWEST)

    def left_by(self, joint: Joint, step: int) -> Array:
        """What is left over (K,), mean square of an axis, with the child's readings taken later by so many steps."""
        a, b = (self._signal(joint, s) for s in joint)
        return _difference(a.at(0), b.at(step))

    def left(self, joint: Joint, sign: int = 1) -> Array:
        """The same (L, K) at all lags, or with the child's taken earlier by each (`sign` -1)."""
        if joint not in self._curves:
            self._curves[joint] = _left_at_lags(*(self._signal(joint, s) for s in joint))
        left = self._curves[joint]
        return left if sign == 1 else left[::-1]

    def _energy_of_arm(self, sensor: str) -> Array:
        """Mean square (K,) that vibration adds, of an axis, to an arm of 1 m in any direction, 1/s^4."""
        if sensor not in self._arms:
            arm = self.pairs.windows(sensor).arm
            flat = np.swapaxes(arm.reshape(*arm.shape[:2], 9), 1, 2)
            spectrum = np.abs(flat @ _transform(arm.shape[1])) ** 2
            self._arms[sensor] = spectrum.sum(axis=2).mean(axis=1)
        return self._arms[sensor]

    def _signal(self, joint: Joint, sensor: str, at_no_lag: bool = False) -> "_Signal":
        if at_no_lag:
            return _signal_of(self.pairs.windows(sensor), self._arm(joint, sensor), 0)
        if (joint, sensor) not in self._signals:
            arm = self._arm(joint, sensor)
            self._signals[joint, sensor] = _signal_of(self.windows(sensor), arm, AROUND)
        return self._signals[joint, sensor]

    def _arm(self, joint: Joint, sensor: str) -> Array:
        place = self.pairs.joint(*joint, joint).place
        return place[:3] if sensor == joint[0] else place[3:]


def find(vibration: Vibration, faulty: Collection[str] = ()) -> list[Delay]:
    """Late sensors and strips, most certain first; at most one for each joint that shows it, none at joints of `faulty` sensors."""
    pairs = vibration.pairs
    t = pairs.windows(pairs.series.sensors[0]).t
    parts = delays.spans(*pairs.series.span)
    return delays.most_certain(
        [j for j in pairs.joints if not {*j} & {*faulty} and vibration.is_odd(j)],
        delays.groups(pairs),
        lambda g: [d for s in parts if (d := _best(vibration, g, s, (t >= s[0]) & (t < s[1])))],
        _count(vibration),
    )


def p_value_of(vibration: Vibration, joint: Joint, late: float) -> float:
    """Probability that `find` would tell of a delay put into what is beyond a joint."""
    use, noise = vibration.use(joint), vibration.noise(joint)
    right, wrong = vibration.left_by(joint, 0), vibration.left_by(joint, round(late / STEP))
    if np.count_nonzero((wrong > ODD * noise) & use) < paired_test.FEWEST:
        return 1.0
    p, _ = _tested(wrong[None], right[None], noise[None], use[None])
    return min(1.0, p * _count(vibration))


def _count(vibration: Vibration) -> int:
    """Delays that are looked for: lags that differ by the inverse of the bandwidth are others."""
    lags = 2 * delays.FURTHEST * (FREQUENCIES[-1] - FREQUENCIES[0])
    return int(len(delays.groups(vibration.pairs)) * lags * (2 * delays.PARTS - 1))


def _best(
    vibration: Vibration,
    group: tuple[str, ...],
    span: tuple[float, float],
    inside: NDArray[np.bool_],
) -> Delay | None:
    """The delay of a group that explains its joints best within a span."""
    touched = [
        (j, 1 if j[1] in group else -1)
        for j in vibration.pairs.joints
        if (j[0] in group) != (j[1] in group)
    ]
    if not touched or np.count_nonzero(inside) < paired_test.FEWEST:
        return None
    left = np.array([vibration.left(*each) for each in touched])[:, :, inside]
    noise = np.array([vibration.noise(j) for j, _ in touched])[:, inside]
    use = np.array([vibration.use(j) for j, _ in touched])[:, inside]
    total = (np.log(left + noise[:, None]) * use[:, None]).sum(axis=(0, 2))
    lags, zero = vibration.lags, vibration.zero
    k = int(np.argmin(total))
    if k in (0, len(lags) - 1) or zero.start <= k < zero.stop:
        return None
    none = zero.start + int(np.argmin(total[zero]))
    p, evidence = _tested(left[:, none], left[:, k], noise, use)
    return Delay(group, delays.vertex(lags, total, k), p, evidence, span)


def _tested(
    before: Array, after: Array, noise: Array, use: NDArray[np.bool_]
) -> tuple[float, float]:
    """Paired test of what joints (J, K) leave with a delay against without: probability, and log ratio beyond the margin, which joints that tell nothing make smaller."""
    each = paired_test.log_rest(before, noise) - paired_test.log_rest(after, noise)
    gain, weights = (
        np.where(use, each, 0.0),
        np.where(use, paired_test.weight(before, after, noise), 0.0),
    )
    if float((weights * after).sum()) > delays.EXPLAINED * float((weights * noise).sum()):
        return 1.0, 0.0
    weight, count = weights.max(axis=0), use.sum(axis=0)
    p = paired_test.p_value(gain.sum(axis=0) / np.maximum(count, 1), MARGIN, weight)
    return p, float((gain.sum(axis=0) - MARGIN * count) @ (weight > 0))


@dataclass(frozen=True)
class _Signal:
    """Acceleration of a joint's centre by one sensor."""

    vertical: Array  # (K, n) m/s^2
    level: NDArray[np.complex128]  # (K, n) both horizontal components, in axes of the window
    around: int  # instants before the window, and behind it

    def at(self, step: int) -> tuple[Array, Array]:
        """Spectra (K, F) of the vertical, (K, 2F) of the horizontal components at positive and negative frequencies, by so many steps later."""
        count = self.vertical.shape[1] - 2 * self.around
        part, transform = slice(self.around + step, self.around + step + count), _transform(count)
        vertical, level = self.vertical[:, part] @ transform, self.level[:, part]
        return vertical, np.concatenate([level @ transform, level @ transform.conj()], axis=1)


def _signal_of(windows: Windows, arm: Array, around: int) -> _Signal:
    """From a sensor's windows, the joint's centre lying at `arm` (3,) m in its frame."""
    up = windows.force.mean(axis=1)
    up = up / np.maximum(np.linalg.norm(up, axis=1), 1e-9)[:, None]
    seen = windows.force + windows.arm @ arm
    east = np.cross(up, np.eye(3)[np.argmin(np.abs(up), axis=1)])
    east /= np.maximum(np.linalg.norm(east, axis=1), 1e-9)[:, None]
    north = np.cross(up, east)
    vertical, x, y = (np.asarray((seen @ axis[..., None])[..., 0]) for axis in (up, east, north))
    return _Signal(vertical, x + 1j * y, around)


@cache
def _transform(count: int) -> Array:
    """Fourier transform (m, F) of a window of m instants, tapered (Hann), under which white noise keeps its mean square."""
    taper = np.hanning(count + 2)[1:-1]
    at = np.arange(count)[:, None] * (joint_windows.LENGTH / count)
    wave = taper[:, None] * np.exp(-2j * np.pi * FREQUENCIES * at)
    return np.asarray(wave / np.sqrt((taper**2).sum() * len(FREQUENCIES)))


def _energy_of(spectra: tuple[Array, Array]) -> Array:
    """Mean square (K,) of an axis."""
    vertical, level = ((np.abs(s) ** 2).sum(axis=1) for s in spectra)
    return np.asarray((vertical + 0.5 * level) / 3)


def _difference(a: tuple[Array, Array], b: tuple[Array, Array], turn: Array | None = None) -> Array:
    """Mean square (K,) of an axis of the difference, at the heading that fits best; `turn` (F,) shifts the second by a phase."""
    vertical, level = b
    if turn is not None:
        vertical, level = vertical * turn, level * np.concatenate([turn, turn.conj()])
    along = np.abs((level.conj() * a[1]).sum(axis=1))
    upright = (np.abs(a[0] - vertical) ** 2).sum(axis=1)
    sideways = 0.5 * ((np.abs(a[1]) ** 2 + np.abs(level) ** 2).sum(axis=1)) - along
    return np.asarray((upright + np.maximum(sideways, 0.0)) / 3)


def _left_at_lags(a: _Signal, b: _Signal) -> Array:
    """What is left over (L, K) at all lags of Vibration.lags."""
    first, found = a.at(0), []
    turns = [np.exp(2j * np.pi * FREQUENCIES * STEP * part / PARTS) for part in range(PARTS)]
    for step in range(1 - AROUND, AROUND):
        second = b.at(step)
        found += [_difference(first, second, turn) for turn in turns]
    return np.array(found[: 1 - PARTS])
