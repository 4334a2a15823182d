"""The calibration of one inertial and magnetic sensor, and how it is applied: corrected = matrix @
(reading - bias).

In      readings of any number of sensors, SI, in the sensors' frames
Out     the same corrected: matrix holds scale and cross-axis (and, for the gyroscope and
        magnetometer, the turn into the accelerometer's axes)
Source  Valtin, Salchow, Seel et al. 2017 (calibration matrices on the strip's flash); Tedaldi,
        Pretto & Menegatti 2014, ICRA, (1)-(6)
Limits  temperature is not modelled
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from handscope.estimators.data.samples import ACC, GYR, MAG
from handscope.estimators.numerics.jit import rowwise
from handscope.estimators.numerics.typing import Array

CALIBRATED = (GYR, ACC, MAG)  # order on the wire


@dataclass(frozen=True)
class ImuCalibration:
    """By quantity; one that is absent is taken as it reads."""

    matrix: Mapping[str, Array] = field(default_factory=dict)  # (3, 3)
    # (3,) rad/s, m/s^2, T: the reading's own units
    bias: Mapping[str, Array] = field(default_factory=dict)

    def of(self, quantity: str) -> tuple[Array, Array]:
        """Matrix (3, 3) and bias (3,) of a quantity."""
        return self.matrix.get(quantity, np.eye(3)), self.bias.get(quantity, np.zeros(3))

    @property
    def trivial(self) -> bool:
        """Whether it changes nothing."""
        return all(
            np.array_equal(m, np.eye(3)) and not np.any(b) for m, b in map(self.of, CALIBRATED)
        )


@dataclass(frozen=True)
class Correction:
    """The calibrations of a stream's sensors side by side."""

    matrix: Array  # (sensors, quantities, 3, 3)
    bias: Array  # (sensors, quantities, 3)
    known: Array  # (sensors, quantities) 1 or 0: the others are taken as they read
    acc: Array  # (quantities,) 1 or 0


def correction(calibrations: Sequence[ImuCalibration], quantities: Sequence[str]) -> Correction:
    """What `corrected` needs of one calibration a sensor."""
    parts = [[c.of(q) for q in quantities] for c in calibrations]
    known = [[q in c.matrix or q in c.bias for q in quantities] for c in calibrations]
    matrix, bias = ([[np.asarray(part[k], float) for part in row] for row in parts] for k in (0, 1))
    return Correction(
        np.array(matrix),
        np.array(bias),
        np.array(known, float),
        np.array([q == ACC for q in quantities], float),
    )


def apply(
    calibrations: Sequence[ImuCalibration], quantities: Sequence[str], values: Array
) -> Array:
    """Corrected values (..., sensors, 3 * quantities) by one calibration a sensor."""
    return correct(correction(calibrations, quantities), values)


def correct(by: Correction, values: Array) -> Array:
    """Corrected values (..., sensors, 3 * quantities), each sample by itself; a missing axis leaves
    its whole sample missing.

    Three exact zeros of an accelerometer stay what they are: a sensor that does not answer.
    """
    reading = values.reshape(*values.shape[:-1], values.shape[-1] // 3, 3)
    assert reading.shape[-3:] == by.bias.shape
    with np.errstate(over="ignore"):
        return np.asarray(_correct(reading, by.matrix, by.bias, by.known, by.acc)).reshape(
            values.shape
        )


@rowwise("(a),(a,a),(a),(),()->(a)")
def _correct(
    reading: Array, matrix: Array, bias: Array, known: float, acc: float, made: Array
) -> None:
    """One reading; `known` and `acc` are 1 where the sensor's calibration tells the quantity, and
    where it is specific force."""
    made[0], made[1], made[2] = reading[0], reading[1], reading[2]
    if known > 0 and not (acc > 0 and reading[0] == 0 and reading[1] == 0 and reading[2] == 0):
        x, y, z = reading[0] - bias[0], reading[1] - bias[1], reading[2] - bias[2]
        for axis in range(3):
            value = matrix[axis, 0] * x + matrix[axis, 1] * y + matrix[axis, 2] * z
            made[axis] = value if math.isfinite(value) else math.nan


def compose(first: ImuCalibration, second: ImuCalibration) -> ImuCalibration:
    """One calibration that does what `first` and then `second` do."""
    matrix, bias = {}, {}
    for quantity in CALIBRATED:
        (M_1, b_1), (M_2, b_2) = first.of(quantity), second.of(quantity)
        matrix[quantity], bias[quantity] = M_2 @ M_1, b_1 + np.linalg.solve(M_1, b_2)
    return ImuCalibration(matrix, bias)


def saturation_level(
    calibrations: Sequence[ImuCalibration], quantity: str, full_scale: float
) -> float:
    """Least size that a corrected axis can have while the sensor is at its limit: what then counts
    as full scale."""
    return min((_least(*c.of(quantity), full_scale) for c in calibrations), default=full_scale)


def _least(matrix: Array, bias: Array, full_scale: float) -> float:
    size, slack = np.abs(matrix), np.abs(bias)
    own = np.diag(size) * (full_scale - slack)
    others = (size - np.diag(np.diag(size))) @ (full_scale + slack)
    return float(max((own - others).min(), 0.0))
