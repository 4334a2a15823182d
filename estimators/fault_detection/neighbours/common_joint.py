"""How well two sensors agree that they are moved by one joint: accelerations at a common point, whatever the sensors' seats.

In      windows of both sensors (joint_windows.py)
Out     where the joint lies in either sensor's frame, with the normal equations of each window; what is left over in each window
Source  acceleration of the joint's centre seen from either segment: Seel et al. 2012, IEEE MSC, 45; the rotation between the sensors is a free unknown of
        each window, so that neither mounting nor heading is needed
Limits  segments that do not turn, or a joint that does not move, tell nothing: any two sensors then agree
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.fault_detection.neighbours.joint_kernels import (
    UNKNOWNS,
    products,
    squares,
)
from handscope.estimators.fault_detection.neighbours.joint_windows import Windows
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
ACC_SCALE = 0.02  # m/s^2 that scale errors of accelerometers make while gravity turns in them, as far as it goes with the movement; ours
GRAVITY_OFF = 0.04  # m/s^2 a radian of turn: scale and cross-axis errors of 0.4 % of gravity; twice those of a calibrated MPU-9250
TURNS = 0.5  # 1/s^2, root mean square of what a window adds to an arm of 1 m along an axis: less is noise rather than movement
ACC_BIAS = 0.1  # m/s^2, standard deviation of an accelerometer axis
FLOOR = 0.015  # m/s^2, of an axis: noise of an accelerometer at 25 Hz and what a second of integrated rates leaves; size ours
STEPS = 4
WEIGHTS = 4.0 ** np.arange(0, 14, 1.0)
PRIOR = np.diag([FLOOR**2 / EXPECTED**2] * 6 + [FLOOR**2 / ACC_BIAS**2] * 3)


@dataclass(frozen=True)
class Joint:
    """A joint between two sensors."""

    place: Array  # (6,) m, in the first sensor's frame, in the second's
    covariance: Array  # (6, 6) m^2, of what differs from window to window
    systematic: Array  # (6, 6) m^2, of what skin and scale errors make of it in all windows
    rest: Array  # (K,) mean square of what is left over in each window, (m/s^2)^2
    noise: Array  # (K,) of it what skin, scale errors and noise explain


@dataclass(frozen=True)
class Region:
    """Where a joint may lie: how far at most from where it is expected."""

    centre: Array  # (6,) m, in the first sensor's frame, in the second's
    reach: Array  # (2,) m, from the first sensor's centre, from the second's
    sd: float = EXPECTED  # m, of the place about the centre where movement does not tell it


def fit(
    first: Windows, second: Windows, use: Array, pulled: Array, region: Region | None = None
) -> Joint:
    """Find the joint that explains the windows best.

    Parameters
    ----------
    first, second : Windows
        Of the two sensors, K windows each.
    use : ndarray, shape (K,)
        Weight of each window, 0 where it is left out.
    pulled : ndarray, shape (K,)
        How much the segments around turn (`turning`), which pull the skin under the sensors.
    region : Region, optional
        Where the joint lies; anywhere without it.
    """
    x = np.zeros(UNKNOWNS)
    if region is not None:
        x[:6] = region.centre
    use = use * (np.maximum(turning(first), turning(second)) > TURNS)
    noise = _noise(first, second, pulled)
    weight = use / (noise + FLOOR**2)
    used = use > 0
    some = tuple(values[used] for values in _read(first, second))
    for _ in range(STEPS):
        rotation = aligned(products(*some, _with_one(x)))
        normal, right, _, _ = _equations(some, rotation, x, weight[used])
        x = _solved(normal, right, region)
    every = _read(first, second)
    rotation = aligned(products(*every, _with_one(x)))
    normal, _, gradient, rest = _equations(every, rotation, x, weight)
    known = (
        PRIOR if region is None else PRIOR * np.repeat([(EXPECTED / region.sd) ** 2] * 2 + [1.0], 3)
    )
    covariance = _covariance(normal, known, gradient)[:6, :6]
    return Joint(x[:6], covariance, _systematic(first, second, rotation, use), rest, noise)


def left_by_gravity(first: Windows, second: Windows) -> Array:
    """Mean square (K,) that is left, (m/s^2)^2, if both sensors saw one specific force: gravity, and no acceleration of their own."""
    read, nothing = _read(first, second), np.zeros(UNKNOWNS)
    rotation = aligned(products(*read, _with_one(nothing)))
    return _equations(read, rotation, nothing, np.zeros(len(first.force)))[3]


def _solved(normal: Array, right: Array, region: Region | None) -> Array:
    """The unknowns that fit best; within the region by as much weight on its centre as that takes (Levenberg 1944)."""
    if region is None:
        return np.asarray(np.linalg.solve(normal + PRIOR, right))
    centre = np.concatenate([region.centre, np.zeros(3)])
    for weight in WEIGHTS * (EXPECTED / region.sd) ** 2:
        prior = PRIOR * np.repeat([weight, weight, 1.0], 3)
        x = np.linalg.solve(normal + prior, right + prior @ centre)
        off = (x - centre)[:6].reshape(2, 3)
        if (np.linalg.norm(off, axis=1) <= region.reach).all():
            break
    return np.asarray(x)


def _equations(
    read: tuple[Array, ...], rotation: Array, x: Array, use: Array
) -> tuple[Array, Array, Array, Array]:
    """Normal matrix and right side of the unknowns, gradients of the windows, mean squares of the residuals; windows that fit badly count less (Cauchy)."""
    by_window = squares(*read, rotation, _with_one(x))
    rest = by_window[:, UNKNOWNS, UNKNOWNS] / (3 * read[0].shape[1])
    weight = FLOOR**2 * use / (1.0 + rest * use)
    normal = np.einsum("k,kij->ij", weight, by_window[:, :UNKNOWNS, :UNKNOWNS])
    gradient = weight[:, None] * by_window[:, :UNKNOWNS, UNKNOWNS]
    return normal, normal @ x - gradient.sum(axis=0), gradient, rest


def _covariance(normal: Array, prior: Array, gradient: Array) -> Array:
    """Sandwich estimate: windows are independent, samples within a window are not (Liang & Zeger 1986, Biometrika 73:13)."""
    K = int(np.count_nonzero(np.abs(gradient).sum(axis=1)))
    meat = gradient.T @ gradient * K / max(K - UNKNOWNS, 1) + FLOOR**2 * prior
    inverse = np.linalg.inv(normal + prior)
    return np.asarray(inverse @ meat @ inverse)


def _noise(first: Windows, second: Windows, pulled: Array) -> Array:
    """Mean square (K,) that a joint of intact sensors leaves: skin moves its place, scale errors turn with gravity."""
    skin = ARM * SKIN * np.maximum(pulled, np.maximum(turning(first), turning(second)))
    turn = [
        np.sqrt(
            ((w.turned - w.turned.mean(axis=1, keepdims=True)) ** 2).sum(axis=(2, 3)).mean(axis=1)
            / 2
        )
        for w in (first, second)
    ]
    return np.asarray(FLOOR**2 + skin**2 + (GRAVITY_OFF * np.maximum(*turn)) ** 2)


def turning(windows: Windows) -> Array:
    """How much each window (K,) adds to an arm of 1 m, root mean square over instants and axes, 1/s^2."""
    return np.asarray(np.sqrt((windows.arm**2).mean(axis=(1, 2, 3)) * 3))


def _systematic(first: Windows, second: Windows, rotation: Array, use: Array) -> Array:
    """What skin and noise make of the places: nothing shows them where a sensor is turned by the skin that its neighbour pulls, or turns with its neighbour."""
    if not use.any():
        return EXPECTED**2 * np.eye(6)
    half = first.turned.shape[1] // 2
    between = np.swapaxes(first.turned[:, half], 1, 2) @ rotation @ second.turned[:, half]
    apart = first.arm - rotation[:, None] @ second.arm @ np.swapaxes(between, 1, 2)[:, None]
    against = float(np.sqrt(3 * np.average((apart**2).mean(axis=(1, 2, 3)), weights=use)))
    own, other = (float(np.sqrt(np.average(turning(w) ** 2, weights=use))) for w in (first, second))
    against = float(np.sqrt(max(against**2 - (BETWEEN * max(own, other)) ** 2, 0.0)))
    sd = [
        np.hypot(ARM * np.hypot(SKIN * pull, LEAST_TURNING), ACC_SCALE) / max(shown, 1e-3)
        for shown, pull in ((own, other), (other, own), (against, max(own, other)))
    ]
    return np.diag(np.repeat(np.maximum(sd[:2], sd[2]) ** 2, 3))


def _read(first: Windows, second: Windows) -> tuple[Array, ...]:
    return first.force, first.arm, first.turned, second.force, second.arm


def _with_one(x: Array) -> Array:
    return np.append(x, 1.0)


def aligned(products: Array) -> Array:
    """Rotations (..., 3, 3) that take vectors b to a best, of the sums of a b' (Wahba's problem by SVD: Markley 1988)."""
    U, _, Vt = np.linalg.svd(products)
    U[..., 2] *= np.linalg.det(U @ Vt)[..., None]
    return np.asarray(U @ Vt)
