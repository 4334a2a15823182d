"""What a method is given before it starts: how each sensor sits, its bias, where it points at a given
moment, the hand's geometry."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from handscope.estimators.data.held_contact import HeldContact
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array


class CalibrationSource(StrEnum):
    """Where headings and mounting come from; the values are written into files."""

    POSE = "initial pose"
    PASSIVE_POSE = "initial pose given by the therapist"
    POSE_AND_OTHER_RECORDING = "initial pose, mounting from another recording"
    OTHER_RECORDING = "another recording"
    SELF_CALIBRATION = "self-calibration"
    NONE = "none"

    @property
    def is_pose(self) -> bool:
        """Whether an initial pose of this recording gave the headings."""
        return self in (
            CalibrationSource.POSE,
            CalibrationSource.PASSIVE_POSE,
            CalibrationSource.POSE_AND_OTHER_RECORDING,
        )


SOURCE_WORDS = {
    CalibrationSource.POSE: phrase("calibration_source.pose"),
    CalibrationSource.PASSIVE_POSE: phrase("calibration_source.passive_pose"),
    CalibrationSource.POSE_AND_OTHER_RECORDING: phrase("calibration_source.pose_and_other"),
    CalibrationSource.OTHER_RECORDING: phrase("calibration_source.other"),
    CalibrationSource.SELF_CALIBRATION: phrase("calibration_source.self_calibration"),
    CalibrationSource.NONE: phrase("calibration_source.none"),
}


@dataclass(frozen=True)
class SensorQuality:
    """How well one sensor was calibrated."""

    rate_wander: float  # rad/s, largest change of the one-second mean angular rate within the pose
    tilt_change: float  # rad, largest change of gravity's direction within the pose
    bias: float  # rad/s, size of the bias removed
    misalignment: float  # rad, between the nominal mounting and the pose
    warnings: tuple[str, ...] = ()
    # rad/s, of each axis of the bias as the pose's samples scatter; None: unknown
    bias_sd: float | None = None
    # rad/s/sqrt(Hz), white noise density of a gyroscope axis; None: too few samples
    rate_noise: float | None = None


@dataclass(frozen=True)
class PriorCalibration:
    """What was found of a hand and a glove before: it holds as long as the glove is not taken off.
    Everything by segment name."""

    hand: Hand
    q_BS: Mapping[str, Array]  # (4,) sensor-to-segment rotations found from movement
    gyr_bias: Mapping[str, Array]  # (3,) rad/s
    lengths: Mapping[str, float]  # m, segment lengths found from movement
    q_BS_sd: Mapping[str, Array]  # (3,) rad about the segment's x, y, z, of q_BS
    lengths_sd: Mapping[str, float]  # m, of lengths
    acc_bias: Mapping[str, Array] = field(default_factory=dict)  # (3,) m/s^2

    def of_hand(self) -> "PriorCalibration":
        """What is the hand's alone, and holds whatever glove is worn: its lengths."""
        return replace(self, q_BS={}, q_BS_sd={}, gyr_bias={}, acc_bias={})


@dataclass(frozen=True)
class Calibration:
    """Everything by segment name; a segment without an entry is not measured."""

    hand: Hand
    geometry: HandGeometry
    # s, when `q_GS` holds: the start of the pose, of its stillest stretch where it is long
    t: float
    end: float  # s, the end of that stretch; `q_GS` holds until here
    q_GS: Mapping[str, Array]  # (4,) sensor orientations at t, headings resolved
    q_BS: Mapping[str, Array]  # (4,) sensor-to-segment rotations
    gyr_bias: Mapping[str, Array]  # (3,) rad/s
    source: CalibrationSource
    quality: Mapping[str, SensorQuality] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    # rad, heading of magnetic north as each magnetometer saw it in the pose
    north: Mapping[str, float] = field(default_factory=dict)
    # Hz, by stream: how fast its samples come where that is not the rate it names
    rates: Mapping[str, float] = field(default_factory=dict)
    # (3,) rad about the segment's x, y, z, where movements determined it
    q_BS_sd: Mapping[str, Array] = field(default_factory=dict)
    # quality of the functional steps used, angles in rad
    steps: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    # (3 k, 3 k) rad^2 of all that is in q_BS_sd, in its order: what the movements tell of
    # neighbours errs together
    q_BS_covariance: Array | None = None

    def mounting_covariance(self) -> Array:
        """Covariance (3 k, 3 k) of the mountings that movements determined; block-diagonal where correlations are unknown."""
        if self.q_BS_covariance is not None:
            return self.q_BS_covariance
        return np.diag(np.concatenate([np.zeros(0), *self.q_BS_sd.values()]) ** 2)

    # (3,) m, where a sensor sits in its segment's frame, where the method finds it
    p_BS: Mapping[str, Array] = field(default_factory=dict)
    # (3,) m/s^2, where the method finds it, or an earlier one found it: `ekf` subtracts it
    acc_bias: Mapping[str, Array] = field(default_factory=dict)
    # m, of the geometry's lengths that the method found
    lengths_sd: Mapping[str, float] = field(default_factory=dict)
    p_BS_sd: Mapping[str, Array] = field(default_factory=dict)  # (3,) m
    gyr_bias_sd: Mapping[str, Array] = field(default_factory=dict)  # (3,) rad/s
    acc_bias_sd: Mapping[str, Array] = field(default_factory=dict)  # (3,) m/s^2
    # (4,) sensor-to-segment rotations as the glove declares them, where the pose has replaced them
    nominal: Mapping[str, Array] = field(default_factory=dict)
    # rad, by joint, of the pose's angles that were measured; NaN and absent: not measured
    pose_sd: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    # (4,) as the sensors' device gave them at t, in its own frames: whose fusion was not ours
    q_ES: Mapping[str, Array] = field(default_factory=dict)
    # rad, of one axis of an orientation of those; None: nothing says how good they are
    orientation_sd: float | None = None
    # s, the movement used, where the calibration is not from a pose
    stretch: tuple[float, float] | None = None
    contacts: tuple[HeldContact, ...] = ()  # held after it, in order of time
    is_functional: bool = False  # movements of a functional calibration are combined with it
    from_prior: str = ""  # what an earlier self-calibration gave: "lengths", "seats and lengths"

    @property
    def description(self) -> str:
        """The source as it is written into files, with what is combined with it."""
        combined = SOURCE_WORDS[self.source]
        if self.is_functional:
            combined = phrase("calibration_source.functional", pose=combined)
        if not self.from_prior:
            return combined
        return (
            phrase("calibration_source.with_lengths", pose=combined)
            if self.from_prior == "lengths"
            else phrase("calibration_source.with_seats", pose=combined)
        )

    @property
    def span(self) -> tuple[float, float]:
        """From when to when it was looked at, s."""
        return self.stretch or (self.t, self.end)
