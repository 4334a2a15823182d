"""The calibration of one inertial and magnetic sensor, and how it is applied: corrected = matrix @ (reading - bias).

In      readings of any number of sensors, SI, in the sensors' frames
Out     the same corrected: matrix holds scale and cross-axis (and, for the gyroscope and magnetometer, the turn into the accelerometer's axes)
Source  Valtin, Salchow, Seel et al. 2017 (calibration matrices on the strip's flash); Tedaldi, Pretto & Menegatti 2014, ICRA, (1)-(6)
Limits  temperature is not modelled
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from estimators.quaternions import Array
from estimators.samples import ACC, GYR, MAG

CALIBRATED = (GYR, ACC, MAG)  # order on the wire


@dataclass(frozen=True)
class ImuCalibration:
    """By quantity; one that is absent is taken as it reads."""

    matrix: Mapping[str, Array] = field(default_factory=dict)  # (3, 3)
    bias: Mapping[str, Array] = field(default_factory=dict)  # (3,) rad/s, m/s^2, T: the reading's own units

    def of(self, quantity: str) -> tuple[Array, Array]:
        """Matrix (3, 3) and bias (3,) of a quantity."""
        return self.matrix.get(quantity, np.eye(3)), self.bias.get(quantity, np.zeros(3))

    @property
    def trivial(self) -> bool:
        """Whether it changes nothing."""
        return all(np.array_equal(m, np.eye(3)) and not np.any(b) for m, b in map(self.of, CALIBRATED))


def apply(calibrations: Sequence[ImuCalibration], quantities: Sequence[str], values: Array) -> Array:
    """Corrected values (..., sensors, 3 * quantities), each sample by itself; a missing axis leaves its whole sample missing.

    Three exact zeros of an accelerometer stay what they are: a sensor that does not answer.
    """
    assert values.shape[-2:] == (len(calibrations), 3 * len(quantities))
    corrected = values.copy()
    for k, calibration in enumerate(calibrations):
        for n, quantity in enumerate(quantities):
            if quantity in calibration.matrix or quantity in calibration.bias:
                axes = slice(3 * n, 3 * n + 3)
                corrected[..., k, axes] = _corrected(*calibration.of(quantity), values[..., k, axes], quantity == ACC)
    return corrected


def _corrected(matrix: Array, bias: Array, reading: Array, zeros_are_missing: bool) -> Array:
    """Axis by axis, so that a sample's result does not depend on how many come with it."""
    with np.errstate(over="ignore", invalid="ignore"):
        x, y, z = (reading[..., axis] - bias[axis] for axis in range(3))
        made = np.stack([row[0] * x + row[1] * y + row[2] * z for row in matrix], axis=-1)
    silent = (reading == 0).all(axis=-1, keepdims=True) & zeros_are_missing
    return np.asarray(np.where(silent, reading, np.where(np.isfinite(made), made, np.nan)))


def after(first: ImuCalibration, second: ImuCalibration) -> ImuCalibration:
    """One calibration that does what `first` and then `second` do."""
    matrix, bias = {}, {}
    for quantity in CALIBRATED:
        (M_1, b_1), (M_2, b_2) = first.of(quantity), second.of(quantity)
        matrix[quantity], bias[quantity] = M_2 @ M_1, b_1 + np.linalg.solve(M_1, b_2)
    return ImuCalibration(matrix, bias)


def reach(calibrations: Sequence[ImuCalibration], quantity: str, full_scale: float) -> float:
    """Least size that a corrected axis can have while the sensor is at its limit: what then counts as full scale."""
    return min((_least(*c.of(quantity), full_scale) for c in calibrations), default=full_scale)


def _least(matrix: Array, bias: Array, full_scale: float) -> float:
    size, slack = np.abs(matrix), np.abs(bias)
    own = np.diag(size) * (full_scale - slack)
    others = (size - np.diag(np.diag(size))) @ (full_scale + slack)
    return float(max((own - others).min(), 0.0))
