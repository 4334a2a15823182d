"""The flash of a virtual glove's strips: the errors with which their sensors read, and the calibrations kept for the host to remove them.

reading = inverse(matrix) @ truth + bias. As delivered a strip keeps just what removes its errors; a calibration written later takes that one's place
and leaves the errors as they are. Force sensors read newtons, or, where somebody has a calibration of theirs, what it turns to newtons.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from handscope.estimators.data.samples import ACC, FORCE, GYR, MAG, TORQUE, Stream
from handscope.estimators.errors import InputError
from handscope.estimators.force.sensor import ForceCalibration
from handscope.estimators.force.setup import ForceSetup
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.sensors.imu_calibration import CALIBRATED, ImuCalibration
from handscope.sessions.wire.force_calibration import ForceSensorCalibration, messages_of_setups
from handscope.sessions.wire.messages import StripCalibration
from handscope.sessions.wire.strip_calibration import correction_of, message_of

# MPU-9250 specification rev. 1.0, tables 1-2: 5 deg/s, 60 mg; magnetometer ours
BIAS = {GYR: np.radians(5.0), ACC: 0.06 * GRAVITY, MAG: 30e-6}
# the same, tolerance of the sensitivity; magnetometer ours
SCALE = {GYR: 0.03, ACC: 0.03, MAG: 0.05}
CROSS_AXIS = 0.02  # the same


@dataclass
class Flash:
    """By strip name, one calibration a sensor; a strip that is absent sends samples corrected by itself."""

    # what would remove the sensors' true errors
    errors: dict[str, list[ImuCalibration]] = field(default_factory=dict)
    stored: dict[str, list[ImuCalibration]] = field(default_factory=dict)
    # by point, of force sensors that send what they read
    forces: dict[str, ForceSetup] = field(default_factory=dict)
    tells_forces: bool = True  # False: whoever reads them has to know

    def is_raw(self, stream: Stream) -> bool:
        """Whether the strip leaves it to the host to correct what it sends."""
        return stream.name in self.stored or (
            FORCE in stream.quantities and bool(self.forces) and self.tells_forces
        )

    def full_scale(self, stream: Stream) -> dict[str, float]:
        """Of what is sent: that of force sensors is the largest reading under all loads that they can tell."""
        limits = dict(stream.full_scale)
        if FORCE in stream.quantities and self.forces:
            loads = np.repeat([limits[q] for q in stream.quantities], 3)
            reach = [
                np.abs(np.linalg.inv(c.matrix)) @ loads[: len(c.offset)] + np.abs(c.offset)
                for c in (_calibration(self.forces[point]) for point in stream.sensors)
            ]
            limits |= {
                q: float(max(r[stream.axes(q)].max() for r in reach)) for q in stream.quantities
            }
        return limits

    def readings(self, stream: Stream, truth: Array) -> Array:
        """What the stream's sensors read (n, sensors, axes) where the truth is this."""
        if FORCE in stream.quantities and self.forces:
            calibrations = [_calibration(self.forces[point]) for point in stream.sensors]
            return np.stack(
                [
                    truth[:, k] @ np.linalg.inv(c.matrix).T + c.offset
                    for k, c in enumerate(calibrations)
                ],
                axis=1,
            )
        if stream.name not in self.errors:
            return truth
        read = truth.copy()
        for k, calibration in enumerate(self.errors[stream.name]):
            for quantity in set(stream.quantities) & set(CALIBRATED):
                matrix, bias = calibration.of(quantity)
                read[:, k, stream.axes(quantity)] = (
                    truth[:, k, stream.axes(quantity)] @ np.linalg.inv(matrix).T + bias
                )
        return read

    def calibration_messages(
        self, stream: Stream, slot: int
    ) -> list[StripCalibration | ForceSensorCalibration]:
        """The messages that say what is kept for a strip."""
        if FORCE in stream.quantities and self.forces and self.tells_forces:
            return [
                m for m in messages_of_setups(self.forces, slot, stream.sensors) if m is not None
            ]
        return [
            message_of(c, slot, k)
            for k, c in enumerate(
                self.stored.get(stream.name, [ImuCalibration()] * len(stream.sensors))
            )
        ]

    def store(self, strip: str, message: StripCalibration) -> bool:
        """Take a calibration in; False where the strip keeps none for that sensor."""
        if message.sensor >= len(self.stored.get(strip, ())):
            return False
        self.stored[strip][message.sensor] = correction_of(message)
        return True


def factory_flash(streams: Sequence[Stream], rng: np.random.Generator) -> Flash:
    """Strips as the factory calibrated them."""
    errors = {
        s.name: [_draw_errors(rng) for _ in s.sensors]
        for s in streams
        if not {FORCE, TORQUE} & set(s.quantities)
    }
    return Flash(errors, {name: list(calibrations) for name, calibrations in errors.items()})


def require_fitting(forces: dict[str, ForceSetup], streams: Sequence[Stream]) -> None:
    """InputError where calibrations are not those of the glove's force sensors."""
    worn = next((s for s in streams if FORCE in s.quantities), None)
    if worn is None:
        raise InputError("device.no_force_strip")
    axes = 3 * len(worn.quantities)
    for point in worn.sensors:
        one = forces.get(point)
        if one is None or one.calibration is None:
            raise InputError("device.force_matrix_missing", point=point, value=point.split("_")[0])
        if one.calibration.matrix.shape != (axes, axes):
            read = " by ".join(str(n) for n in one.calibration.matrix.shape)
            raise InputError("device.force_matrix_shape", point=point, read=read, axes=axes)


def _calibration(setup: ForceSetup) -> ForceCalibration:
    assert setup.calibration is not None
    return setup.calibration


def _draw_errors(rng: np.random.Generator) -> ImuCalibration:
    """Errors evenly spread within the tolerances, in the precision in which a strip keeps what removes them."""
    matrix: dict[str, Array] = {}
    bias: dict[str, Array] = {}
    for quantity in CALIBRATED:
        error: Array = CROSS_AXIS * rng.uniform(-1, 1, (3, 3))
        error[range(3), range(3)] = SCALE[quantity] * rng.uniform(-1, 1, 3)
        matrix[quantity] = np.asarray(np.linalg.inv(np.eye(3) + error), dtype=np.float64)
        bias[quantity] = BIAS[quantity] * rng.uniform(-1, 1, 3)
    return correction_of(message_of(ImuCalibration(matrix, bias), 0, 0))
