"""Calibrate magnetometers by turning them through all directions where the field is homogeneous:
readings are mapped onto a sphere.

In      readings of one magnetometer (n, 3), T, or of several on one rigid plate (n, magnetometers,
        3); no equipment, no other sensor
Out     Sphere: matrix and bias (corrected = matrix @ (reading - bias)) with standard deviations,
        strength of the field, what is left
Source  Kok & Schoen 2016, IEEE Sensors J. 16:5679, (20)-(26) (maximum likelihood; Kortier, thesis
        5.2.4 uses it); first values: the quadric of least squares, Gander, Golub & Strebel 1994,
        BIT 34:558. Hard iron is the bias, soft iron and the axes' scales are the matrix
Limits  strength alone cannot see a turn of the whole magnetometer: the matrix is symmetric; on one
        plate `find_common_axes` finds the turns against the first,
        six_position_calibration.py the turn against the accelerometer. The field's strength is not known from readings: theirs is kept, or given
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from handscope.estimators.data.samples import MAG
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.axis_estimation import fit_common_rotation
from handscope.estimators.numerics.typing import Array, Bools
from handscope.estimators.sensors.imu_calibration import ImuCalibration

FEWEST = 50  # readings
MOST = 4000  # readings that are fitted: more are thinned out evenly
# largest standard deviation of an entry of the matrix and of the bias as a share of the field that
# counts as observed
SEEN = 0.05
# of the field: more left on the sphere is no homogeneous field, or no magnetometer in order
HOMOGENEOUS = 0.05
MIRRORED = 0.5  # of the residual: a decrease by so much shows that an axis points the other way
MISALIGNED = 0.1  # of the field: more left of a magnetometer against the first is no common plate
ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # of a symmetric matrix


@dataclass(frozen=True)
class EllipsoidCalibration:
    """One magnetometer's calibration with what is known of it."""

    matrix: Array  # (3, 3) symmetric
    bias: Array  # (3,) T
    strength: float  # T, length of corrected readings
    matrix_sd: Array  # (3, 3)
    bias_sd: Array  # (3,) T
    before: float  # share of the field, RMS deviation of the readings' strength as they came
    after: float  # the same corrected

    @property
    def calibration(self) -> ImuCalibration:
        """As it is kept with a sensor."""
        return ImuCalibration({MAG: self.matrix}, {MAG: self.bias})

    def corrected(self, mag: Array) -> Array:
        """Readings (..., 3) in T without hard and soft iron."""
        return np.asarray((mag - self.bias) @ self.matrix)  # the matrix is symmetric


@dataclass(frozen=True)
class CommonAxes:
    """How the axes of magnetometers on one plate are turned against the first one's."""

    # (magnetometers, 4) into the first one's axes, of readings that are turned round where mirrored
    q_1l: Array
    # (magnetometers,) left-handed, or the others are: an axis points the other way than on most
    mirrored: Bools
    left: Array  # (magnetometers,) share of the field that does not agree with the first

    @property
    def signs(self) -> Array:
        """By which readings are multiplied (magnetometers,)."""
        return np.where(self.mirrored, -1.0, 1.0)


def fit_ellipsoid(
    mag: Array, name: str = "the magnetometer", strength: float | None = None
) -> EllipsoidCalibration:
    """Calibrate one magnetometer from readings (n, 3); `strength` T of the field, if it is known.
    InputError says what was missing."""
    readings = mag[np.isfinite(mag).all(axis=-1)]
    if len(readings) < FEWEST:
        raise InputError(
            "sensor.too_few_readings", name=name, readings=len(readings), fewest=FEWEST
        )
    y = readings[:: max(1, -(-len(readings) // MOST))]
    middle = y.mean(axis=0)
    size = float(np.sqrt(((y - middle) ** 2).sum(axis=1).mean()))
    if not size > 1e-9 * np.abs(middle).max():
        raise InputError("sensor.readings_constant", name=name)
    z = (y - middle) / size
    begin = _quadric(z, name)
    found = least_squares(_residuals, begin, jac=_residual_jacobian, args=(z,), method="lm")
    noise = float(np.sqrt(2 * found.cost / (len(z) - 9)))
    s, V = np.linalg.svd(np.asarray(found.jac), full_matrices=False)[1:]
    sd = noise * np.sqrt((V.T**2 / np.maximum(s, 1e-12) ** 2).sum(axis=1))
    A = _symmetric(found.x[:6])
    own = np.cbrt(np.linalg.det(A))  # the readings' own strength, if none is given
    radius = size / own if strength is None else strength
    if not sd.max() < SEEN:
        raise InputError("sensor.directions_missing", name=name)
    if noise > HOMOGENEOUS:
        raise InputError("sensor.field_not_homogeneous", name=name, noise=100 * noise)
    scale = radius / size
    raw = np.linalg.norm(y, axis=1)
    return EllipsoidCalibration(
        scale * A,
        middle + size * found.x[6:],
        radius,
        scale * _symmetric(sd[:6]),
        size * sd[6:],
        float(raw.std() / raw.mean()),
        float(np.sqrt(np.mean(found.fun**2))),
    )


def find_common_axes(mag: Array) -> CommonAxes:
    """Of corrected readings (n, magnetometers, 3): all are on one rigid plate that is turned in a
    homogeneous field, no magnet near."""
    good, many = np.isfinite(mag).all(axis=(-1, -2)), mag.shape[1]
    q_1l, mirrored, left = np.tile(quat.IDENTITY, (many, 1)), np.zeros(many, bool), np.zeros(many)
    for k in range(1, many):
        as_is, flipped = (
            fit_common_rotation(mag[good, 0], sign * mag[good, k]) for sign in (1.0, -1.0)
        )
        mirrored[k] = flipped.residual < MIRRORED * as_is.residual
        found = flipped if mirrored[k] else as_is
        q_1l[k], left[k] = found.q_ab, found.residual
    # the first may be the odd one
    return CommonAxes(q_1l, ~mirrored if mirrored.mean() > 0.5 else mirrored, left)


def find_outsiders(names: Sequence[str], common: CommonAxes) -> dict[str, str]:
    """Magnetometers that did not see the first one's field turn, with a sentence for each."""
    return {
        name: phrase("magnet.other_field_turn", name=name, first=names[0], share=100 * left)
        for name, left in zip(names, common.left)
        if left > MISALIGNED
    }


def dip(mag: Array, acc: Array) -> float:
    """How far the field points below the horizon, rad: corrected readings (n, 3) and an
    accelerometer's (n, 3) in the same axes, turned slowly."""
    good = np.isfinite(mag).all(axis=1) & np.isfinite(acc).all(axis=1)
    m, a = mag[good], acc[good]
    down = -(m * a).sum(axis=1) / (np.linalg.norm(m, axis=1) * np.linalg.norm(a, axis=1))
    return float(np.arcsin(np.clip(np.median(down), -1.0, 1.0)))


def _residuals(x: Array, z: Array) -> Array:
    return np.asarray(np.linalg.norm((z - x[6:]) @ _symmetric(x[:6]), axis=1) - 1.0)


def _residual_jacobian(x: Array, z: Array) -> Array:
    """d|v|/dx with v = A (z - b), u = v / |v|."""
    A, d = _symmetric(x[:6]), z - x[6:]
    v = d @ A
    u = v / np.linalg.norm(v, axis=1, keepdims=True)
    return np.column_stack(
        [*(u[:, i] * d[:, j] + (u[:, j] * d[:, i] if i != j else 0.0) for i, j in ENTRIES), -u @ A]
    )


def _quadric(z: Array, name: str) -> Array:
    """Matrix (6 entries) and centre (3) of the ellipsoid z' Q z + 2 g' z = 1 of least squares."""
    squares = [z[:, i] * z[:, j] * (1 if i == j else 2) for i, j in ENTRIES]
    found = np.linalg.lstsq(np.column_stack([*squares, 2 * z]), np.ones(len(z)), rcond=None)[0]
    Q, g = _symmetric(np.asarray(found[:6], float)), found[6:]
    values, axes = np.linalg.eigh(Q)
    if values.min() <= 1e-3 * abs(values).max():
        raise InputError("sensor.no_ellipsoid", name=name)
    centre = -np.linalg.solve(Q, g)
    values = values / (1.0 + centre @ Q @ centre)
    A = (axes * np.sqrt(values)) @ axes.T
    return np.array([*(A[i, j] for i, j in ENTRIES), *centre])


def _symmetric(entries: Array) -> Array:
    M = np.empty((3, 3))
    for (i, j), value in zip(ENTRIES, entries):
        M[i, j] = M[j, i] = value
    return M
