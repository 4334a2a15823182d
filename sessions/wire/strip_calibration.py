"""What corrects an inertial sensor, as a strip's flash holds it and as a message carries it."""

import numpy as np

from handscope.estimators.sensors.imu_calibration import CALIBRATED, ImuCalibration
from handscope.sessions.wire.messages import StripCalibration


def correction_of(message: StripCalibration) -> ImuCalibration:
    """The value of a message."""
    bias, matrix = np.reshape(message.bias, (3, 3)), np.reshape(message.matrix, (3, 3, 3))
    return ImuCalibration(dict(zip(CALIBRATED, matrix)), dict(zip(CALIBRATED, bias)))


def message_of(calibration: ImuCalibration, slot: int, sensor: int) -> StripCalibration:
    """The inverse of `correction_of`, in the single precision of the wire."""
    parts = [calibration.of(q) for q in CALIBRATED]
    bias = np.concatenate([b for _, b in parts]).astype("<f4")
    matrix = np.concatenate([M.ravel() for M, _ in parts]).astype("<f4")
    return StripCalibration(slot, sensor, tuple(map(float, bias)), tuple(map(float, matrix)))
