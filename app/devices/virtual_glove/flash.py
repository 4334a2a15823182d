"""The flash of a virtual glove's strips: the errors with which their sensors read, and the calibrations kept for the host to remove them.

reading = inverse(matrix) @ truth + bias. As delivered a strip keeps just what removes its errors; a calibration written later takes that one's place
and leaves the errors as they are.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from estimators.gravity import GRAVITY
from estimators.imu_calibration import CALIBRATED, ImuCalibration
from estimators.quaternions import Array
from estimators.samples import ACC, FORCE, GYR, MAG, TORQUE, Stream
from sessions.wire.assembly import correction_of, message_of
from sessions.wire.messages import StripCalibration

BIAS = {
    GYR: np.radians(5.0),
    ACC: 0.06 * GRAVITY,
    MAG: 30e-6,
}  # MPU-9250 specification rev. 1.0, tables 1-2: 5 deg/s, 60 mg; magnetometer ours
SCALE = {GYR: 0.03, ACC: 0.03, MAG: 0.05}  # the same, tolerance of the sensitivity; magnetometer ours
CROSS_AXIS = 0.02  # the same


@dataclass
class Flash:
    """By strip name, one calibration a sensor; a strip that is absent sends samples corrected by itself."""

    errors: dict[str, list[ImuCalibration]] = field(default_factory=dict)  # what would remove the sensors' true errors
    kept: dict[str, list[ImuCalibration]] = field(default_factory=dict)

    def readings(self, stream: Stream, truth: Array) -> Array:
        """What the stream's sensors read (n, sensors, axes) where the truth is this."""
        if stream.name not in self.errors:
            return truth
        read = truth.copy()
        for k, calibration in enumerate(self.errors[stream.name]):
            for quantity in set(stream.quantities) & set(CALIBRATED):
                matrix, bias = calibration.of(quantity)
                read[:, k, stream.axes(quantity)] = truth[:, k, stream.axes(quantity)] @ np.linalg.inv(matrix).T + bias
        return read

    def told(self, strip: str, slot: int, sensors: int) -> list[StripCalibration]:
        """The messages that say what is kept for a strip."""
        return [message_of(c, slot, k) for k, c in enumerate(self.kept.get(strip, [ImuCalibration()] * sensors))]

    def keep(self, strip: str, message: StripCalibration) -> bool:
        """Take a calibration in; False where the strip keeps none for that sensor."""
        if message.sensor >= len(self.kept.get(strip, ())):
            return False
        self.kept[strip][message.sensor] = correction_of(message)
        return True


def delivered(streams: Sequence[Stream], rng: np.random.Generator) -> Flash:
    """Strips as the factory calibrated them."""
    errors = {s.name: [_drawn(rng) for _ in s.sensors] for s in streams if not {FORCE, TORQUE} & set(s.quantities)}
    return Flash(errors, {name: list(calibrations) for name, calibrations in errors.items()})


def _drawn(rng: np.random.Generator) -> ImuCalibration:
    """Errors evenly spread within the tolerances, in the precision in which a strip keeps what removes them."""
    matrix: dict[str, Array] = {}
    bias: dict[str, Array] = {}
    for quantity in CALIBRATED:
        error: Array = CROSS_AXIS * rng.uniform(-1, 1, (3, 3))
        error[range(3), range(3)] = SCALE[quantity] * rng.uniform(-1, 1, 3)
        matrix[quantity] = np.asarray(np.linalg.inv(np.eye(3) + error), dtype=np.float64)
        bias[quantity] = BIAS[quantity] * rng.uniform(-1, 1, 3)
    return correction_of(message_of(ImuCalibration(matrix, bias), 0, 0))
