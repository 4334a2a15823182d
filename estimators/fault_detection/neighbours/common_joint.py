"""How well two sensors agree that they are moved by one joint: accelerations at a common point, whatever the sensors' seats.

In      windows of both sensors (joint_windows.py)
Out     where the joint lies in either sensor's frame, with the normal equations of each window; what is left over in each window
Source  acceleration of the joint's centre seen from either segment: Seel et al. 2012, IEEE MSC, 45; the rotation between the sensors is a free unknown of
        each window, so that neither mounting nor heading is needed
Limits  segments that do not turn, or a joint that does not move, tell nothing: any two sensors then agree
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.neighbours.joint_kernels import (
    UNKNOWNS,
    align,
    fit_unknowns,
    refit_unknowns,
)
from handscope.estimators.fault_detection.neighbours.joint_windows import (
    INSTANTS,
    Windows,
    by_vector,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

EXPECTED = (
    0.06  # m, standard deviation of a joint's place from a neighbouring sensor, any direction
)
ARM, SKIN, LEAST_TURNING = (
    0.05,
    0.045,
    0.05,
)  # m; turn of a sensor per turn of its joint (4 deg in 90); 1/s^2 that noise of a gyroscope makes: sizes ours
CLEAR = (
    2.0  # times what skin makes of the fastest sensor's rate: from here on a segment moves itself
)
BETWEEN = 0.15  # rad, error of the rotation between two sensors within a window; ours
HEADINGS = np.arange(-np.pi, np.pi, 0.25)  # rad
ACC_SCALE = 0.02  # m/s^2 that scale errors of accelerometers make while gravity turns in them, as far as it goes with the movement; ours
GRAVITY_OFF = 0.04  # m/s^2 a radian of turn: scale and cross-axis errors of 0.4 % of gravity; twice those of a calibrated MPU-9250
SCALE_OFF = 0.04  # m/s^2 an axis: scales of two accelerometers 0.5 % off each, along gravity, which no bias takes away
TURNS = 0.5  # 1/s^2, root mean square of what a window adds to an arm of 1 m along an axis: less is noise rather than movement
ACC_BIAS = 0.1  # m/s^2, standard deviation of an accelerometer axis
FLOOR = 0.015  # m/s^2, of an axis: noise of an accelerometer at 25 Hz and what a second of integrated rates leaves; size ours
WEIGHTS = 4.0 ** np.arange(0, 14, 1.0)
# of the unknowns; biases are told by what differs between windows, whose instants err alike, so that a window counts once for them
PRIOR = FLOOR**2 * np.repeat([1 / EXPECTED**2, INSTANTS / ACC_BIAS**2], 6)


@dataclass(frozen=True)
class Region:
    """Where a joint may lie: how far at most from where it is expected."""

    centre: Array  # (6,) m, in the first sensor's frame, in the second's
    reach: Array  # (2,) m, from the first sensor's centre, from the second's
    sd: float = EXPECTED  # m, of the place about the centre where movement does not tell it


ANYWHERE = Region(np.zeros(6), np.full(2, np.inf))


@dataclass(frozen=True)
class Couple:
    """Two sensors that may share a joint."""

    first: Windows
    second: Windows
    pulled: Array  # (K,) how much the segments around turn (Windows.turning), which pull the skin under the sensors
    expected: Array  # (6,) m, where the joint lies if it is known roughly

    @cached_property
    def sums(self) -> tuple[Array, Array, Array]:
        """What the fit needs of the instants of each window."""
        first, second = by_vector(self.first.vectors), by_vector(self.second.vectors)
        return self.first.gram, np.swapaxes(first, 1, 2) @ second, self.second.outer

    @cached_property
    def turning(self) -> Array:
        """That (K,) of the sensor that turns more."""
        return np.maximum(self.first.turning, self.second.turning)

    @cached_property
    def doubt(self) -> Array:
        """How far (K,) 1/s^2 what an arm of 1 m adds may be off between samples, of the worse of both sensors."""
        return np.maximum(self.first.doubt, self.second.doubt)

    @cached_property
    def parts(self) -> Array:
        """Mean squares (K, 3) that a joint of intact sensors leaves: always, as skin moves its place and as movement between samples is not known, as scale errors turn with gravity."""
        skin = ARM * np.hypot(SKIN * np.maximum(self.pulled, self.turning), self.doubt)
        turn = np.maximum(self.first.turn, self.second.turn)
        always = np.full_like(skin, FLOOR**2 + SCALE_OFF**2)
        return np.stack([always, skin**2, (GRAVITY_OFF * turn) ** 2], axis=1)

    @cached_property
    def noise(self) -> Array:
        """Sum (K,) of the parts."""
        return np.asarray(self.parts.sum(axis=1))

    @cached_property
    def left_by_gravity(self) -> Array:
        """Mean square (K,) that is left, (m/s^2)^2, if both sensors saw one specific force: gravity, and no acceleration of their own."""
        return np.asarray(align(*self.sums, np.zeros(UNKNOWNS))[1] / self.count)

    @cached_property
    def related(self) -> tuple[Array, Array]:
        """What an arm of 1 m adds by the first sensor and not by the second: sums (K, 3, 3) of squares and products of the arms along the first's axes, mean over instants, 1/s^4; and the
        rotation (K, 3, 3) first <- second. Where their forces tell no heading between them that of all headings in which the arms add least."""
        R, _ = align(*self.sums, np.append(self.expected, np.zeros(6)))
        against, between = self._related(R, np.arange(len(R)))
        up, unknown = self._without_heading()
        if len(unknown):
            headings = quat.matrix(quat.exp(HEADINGS[:, None, None] * up[unknown])) @ R[unknown]
            of_each, turned = self._related(headings, unknown)
            k, best = np.arange(len(unknown)), _trace(of_each).argmin(axis=0)
            less = _trace(of_each[best, k]) < _trace(against[unknown])
            against[unknown[less]] = of_each[best, k][less]
            between[unknown[less]] = turned[best, k][less]
        return against, between

    def _related(self, R: Array, windows: NDArray[np.intp]) -> tuple[Array, Array]:
        """The same of some windows, with rotations (..., k, 3, 3) that take vectors of the second's frame to the first's where the window begins."""
        first, second = self.first.turned[windows], self.second.turned[windows]
        half = first.shape[1] // 2
        between = np.swapaxes(first[:, half], 1, 2) @ R @ second[:, half]
        back = np.swapaxes(between, -1, -2)
        both = np.einsum("...kin,kianb->...kab", R, self._products[windows]) @ back
        squares = self.first.arms[windows] + between @ self.second.arms[windows] @ back
        return squares - both - np.swapaxes(both, -1, -2), between

    @cached_property
    def _products(self) -> Array:
        """Mean over instants (K, 3, 3, 3, 3) of the products of what arms add by the first sensor (component, axis) and by the second."""
        arms = self.first.weighted_arm, self.second.weighted_arm
        first, second = (arm.reshape(*arm.shape[:2], 9) for arm in arms)
        mean = np.swapaxes(first, 1, 2) @ second / first.shape[1]
        return np.asarray(mean.reshape(-1, 3, 3, 3, 3))

    def _without_heading(self) -> tuple[Array, NDArray[np.intp]]:
        """Direction (K, 3) of the mean acceleration of the expected place by the first sensor, and windows in which it changes so little that the rotation about it is not known."""
        by = self.first.weight[..., None]
        seen = by * (self.first.force + self.first.arm @ self.expected[:3])
        mean = (by * seen).mean(axis=1)
        up = mean / np.maximum(np.linalg.norm(mean, axis=1), 1e-9)[:, None]
        across = seen - (seen @ up[:, :, None]) * up[:, None]
        return up, np.flatnonzero((across**2).mean(axis=(1, 2)) * BETWEEN**2 < self.noise)

    @property
    def count(self) -> float:
        """Components that are added up in a window."""
        return float(3 * self.first.force.shape[1])


@dataclass(frozen=True)
class Joint:
    """A joint between two sensors."""

    couple: Couple
    use: Array  # (K,) weight of each window
    region: Region
    unknowns: Array  # (12,) m, the place in the first sensor's frame, in the second's; m/s^2, bias of either accelerometer in its frame
    normal: Array  # (12, 12)
    gradient: Array  # (K, 12)
    sums: Array  # (K, 13, 13) of derivatives by the unknowns and of what is left over

    @property
    def place(self) -> Array:
        """Where it lies (6,) m, in the first sensor's frame, in the second's."""
        return self.unknowns[:6]

    @cached_property
    def rest(self) -> Array:
        """Mean square (K,) of what is left over in each window, (m/s^2)^2."""
        return self.sums[:, UNKNOWNS, UNKNOWNS] / self.couple.count

    @property
    def noise(self) -> Array:
        """Of it (K,) what skin, scale errors and noise explain."""
        return self.couple.noise


def place_covariances(joints: Sequence[Joint]) -> Array:
    """Of the places (J, 6, 6) m^2 of joints of as many windows each: by what differs from window to window, and by skin and scale errors in all of them."""
    of_first, of_second = systematic_errors(joints, EXPECTED)
    return scattered(joints) + of_first @ np.swapaxes(of_first, 1, 2) + of_second


def scattered(joints: Sequence[Joint]) -> Array:
    """Of the places (J, 6, 6) m^2, by what differs from window to window: sandwich estimate, windows are independent, samples within a window are not (Liang & Zeger 1986,
    Biometrika 73:13)."""
    spread = np.array([(EXPECTED / j.region.sd) ** 2 for j in joints])
    known = np.zeros((len(joints), UNKNOWNS, UNKNOWNS))
    each = np.repeat(np.stack([spread, spread, *np.ones((2, len(joints)))], axis=1), 3, axis=1)
    known[:, np.arange(UNKNOWNS), np.arange(UNKNOWNS)] = PRIOR * each
    gradient = np.array([j.gradient for j in joints])
    K = np.count_nonzero(np.abs(gradient).sum(axis=2), axis=1)
    by = K / np.maximum(K - UNKNOWNS, 1)
    meat = np.swapaxes(gradient, 1, 2) @ gradient * by[:, None, None] + FLOOR**2 * known
    inverse = np.linalg.inv(np.array([j.normal for j in joints]) + known)
    return np.asarray((inverse @ meat @ inverse)[:, :6, :6])


def systematic_errors(joints: Sequence[Joint], most: float) -> tuple[Array, Array]:
    """What skin and scale errors make of places in all windows: nothing shows it where a sensor is turned by the skin that its neighbour pulls.

    Segments that turn as one leave the place free to slide along both; an axis that they turn about leaves it free along the axis.

    Parameters
    ----------
    joints : sequence of Joint
        Of as many windows each.
    most : float
        Largest standard deviation of a place, m, where movement tells nothing.

    Returns
    -------
    of_first : ndarray, shape (J, 6, 6)
        Factors, m, by what the first sensors do wrong, of what is the same in both sensors' frames (slides) and of what is not.
    of_second : ndarray, shape (J, 6, 6)
        Covariances, m^2, of the places in the second sensors' frames by what these do wrong.
    """
    use = np.array([j.use for j in joints])
    w = use / np.maximum(use.sum(axis=1), 1e-12)[:, None]
    sensors = [j.couple.first for j in joints], [j.couple.second for j in joints]
    own, other = (np.sqrt((w * [s.turning**2 for s in each]).sum(axis=1)) for each in sensors)
    larger = np.maximum(own, other)
    against, between = (np.array(part) for part in zip(*(j.couple.related for j in joints)))
    first, second = (np.array([s.arms for s in each]) for each in sensors)
    unlike = _weighted(w, against) - ((BETWEEN * larger) ** 2 / 3)[:, None, None] * np.eye(3)
    mean = aligned(_weighted(w * _trace(first), between))
    slides = _error_factors(unlike, larger, most)
    of_first = np.zeros((len(joints), 6, 6))
    of_first[:, :3, :3] = slides
    of_first[:, 3:, :3] = np.swapaxes(mean, 1, 2) @ slides
    of_first[:, :3, 3:] = _error_factors(_weighted(w, first), other, most)
    of_second = np.zeros((len(joints), 6, 6))
    turned = _error_factors(_weighted(w, second), own, most)
    of_second[:, 3:, 3:] = turned @ turned
    return of_first, of_second


def _error_factors(squares: Array, pull: Array, most: float) -> Array:
    """Symmetric square roots (J, 3, 3) of places' covariances, m: an error of the acceleration that goes with the movement, over what arms add (J, 3, 3), 1/s^4."""
    size = np.hypot(ARM * np.hypot(SKIN * pull, LEAST_TURNING), ACC_SCALE)
    values, axes = np.linalg.eigh(squares)
    sd = size[:, None] / np.sqrt(np.maximum(values, 0.0) + (size[:, None] / most) ** 2)
    return np.asarray((axes * sd[:, None]) @ np.swapaxes(axes, 1, 2))


def _trace(matrices: Array) -> Array:
    return np.asarray(np.trace(matrices, axis1=-2, axis2=-1))


def _weighted(w: Array, matrices: Array) -> Array:
    """Means (J, 3, 3) over windows (J, K)."""
    return np.asarray((w[:, :, None, None] * matrices).sum(axis=1))


def fit(couple: Couple, use: Array, region: Region | None = None) -> Joint:
    """Find the joint that explains the windows best.

    Parameters
    ----------
    couple : Couple
        The two sensors, K windows each.
    use : ndarray, shape (K,)
        Weight of each window, 0 where it is left out.
    region : Region, optional
        Where the joint lies; anywhere without it.
    """
    use, region = use * (couple.turning > TURNS), region or ANYWHERE
    found = fit_unknowns(*couple.sums, *_problem(couple, use, region))
    return Joint(couple, use, region, *found)


def refit(known: Joint, use: Array, region: Region) -> Joint:
    """Find the joint of other windows near one that is known: linear about it, at a fraction of the cost."""
    use = use * (known.couple.turning > TURNS)
    problem = _problem(known.couple, use, region)
    x, normal, gradient = refit_unknowns(known.sums, known.unknowns, *problem)
    return Joint(known.couple, use, region, x, normal, gradient, known.sums)


def _problem(couple: Couple, use: Array, region: Region) -> tuple[Any, ...]:
    """Weights, region and sizes as the kernels take them."""
    return (
        use / (couple.noise + FLOOR**2),
        np.append(region.centre, np.zeros(6)),
        PRIOR,
        region.reach,
        WEIGHTS * (EXPECTED / region.sd) ** 2,
        FLOOR**2,
        couple.count,
    )


def aligned(products: Array) -> Array:
    """Rotations (..., 3, 3) that take vectors b to a best, of the sums of a b' (Wahba's problem by SVD: Markley 1988)."""
    U, _, Vt = np.linalg.svd(products)
    U[..., 2] *= np.linalg.det(U @ Vt)[..., None]
    return np.asarray(U @ Vt)
