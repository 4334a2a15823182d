"""How the samples of a stream are read: what its strip and its StreamInfo say of it together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.samples import (
    COMPONENTS,
    FORCE,
    FORCE_POINTS,
    GYR,
    MAG,
    ORIENTATION,
    SATURATION,
    TORQUE,
    Block,
    Stream,
)
from handscope.estimators.numerics.typing import Array
from handscope.estimators.sensors import imu_calibration
from handscope.estimators.sensors.imu_calibration import Correction, ImuCalibration
from handscope.sessions.wire import force_calibration
from handscope.sessions.wire.force_calibration import ForceSensorCalibration
from handscope.sessions.wire.messages import Samples, StreamInfo, StripCalibration
from handscope.sessions.wire.sample_values import decode_values
from handscope.sessions.wire.strip_calibration import correction_of

# behind the strip's name, by the first of these that a stream gives
KINDS = {GYR: "", MAG: "_mag", FORCE: "_force", TORQUE: "_torque", ORIENTATION: "_orientation"}


@dataclass(frozen=True)
class Reading:
    """How the samples of a stream are read as long as neither strip nor stream is described anew."""

    stream: Stream
    info: StreamInfo
    messages: tuple[StripCalibration, ...]
    correction: Correction | None
    # (axes,) sizes that count as the sensor's limit, SI; infinite where none is known
    limits: Array
    forces: tuple[ForceSensorCalibration | None, ...]  # calibrations of force sensors
    raw: bool  # whether they are still to be applied

    def is_of(
        self,
        stream: Stream,
        info: StreamInfo,
        messages: tuple[StripCalibration, ...],
        forces: tuple[ForceSensorCalibration | None, ...],
    ) -> bool:
        """Whether it is made from just these."""
        known = self.stream, self.info, self.messages, self.forces
        return known == (stream, info, messages, forces)


@dataclass(frozen=True)
class Burst:
    """Samples at their times; the first `stale` ones would run back in time."""

    reading: Reading
    t: np.ndarray  # (count,) s of recording
    stale: int
    samples: Samples


def name_of(points: tuple[str, ...], quantities: Sequence[str]) -> str:
    """What a stream is called: its strip, and the first of KINDS that it gives."""
    return _label(points) + next((kind for q, kind in KINDS.items() if q in quantities), "_other")


def _label(points: tuple[str, ...]) -> str:
    """What people call the strip: its finger, its only point, or where it is worn."""
    fingers = {point.split("_")[0] for point in points}
    return (
        fingers.pop()
        if len(fingers) == 1
        else "fingertips"
        if set(points) <= set(FORCE_POINTS)
        else "_".join(points)
    )


def describe_stream(
    name: str,
    points: tuple[str, ...],
    info: StreamInfo,
    messages: tuple[StripCalibration, ...],
    forces: tuple[ForceSensorCalibration | None, ...],
    applied: bool,
) -> Stream:
    """The stream that a StreamInfo and its strip announce; `forces` are applied to what was sent where `applied`."""
    scales = {
        q: imu_calibration.saturation_level(_corrections(info, messages), q, f)
        for q, f in zip(info.quantities, info.full_scale)
        if f > 0
    }
    known = {p: f for p, f in zip(points, forces) if f is not None}
    if known and applied:
        # a limit is of what was sent
        scales = {q: f for q, f in scales.items() if q not in (FORCE, TORQUE)}
    scale_sd = {p: f.scale_sd for p, f in known.items()}
    turn_sd = {p: f.turn_sd for p, f in known.items() if f.turn_sd is not None}
    clock = f"clock{info.clock}"
    return Stream(name, points, info.quantities, info.rate, clock, scales, scale_sd, turn_sd)


def make_reading(
    stream: Stream,
    info: StreamInfo,
    messages: tuple[StripCalibration, ...],
    forces: tuple[ForceSensorCalibration | None, ...],
    applied: bool,
) -> Reading:
    """How the samples of a described stream are read."""
    calibrations = _corrections(info, messages)
    correction = imu_calibration.correction(calibrations, info.quantities) if calibrations else None
    limits = np.repeat(
        [SATURATION * stream.full_scale.get(q, np.inf) for q in stream.quantities],
        [len(COMPONENTS[q]) for q in stream.quantities],
    )
    return Reading(stream, info, messages, correction, limits, forces, applied)


def _corrections(info: StreamInfo, messages: tuple[StripCalibration, ...]) -> list[ImuCalibration]:
    """Of every sensor; none where a device sends orientations."""
    return [] if ORIENTATION in info.quantities else [correction_of(m) for m in messages]


def samples_of(bursts: list[Burst]) -> tuple[Block, int]:
    """Samples of consecutive bursts of one stream, in SI units and corrected; how many of them are at their sensor's limit."""
    reading = bursts[0].reading
    t = bursts[0].t if len(bursts) == 1 else np.concatenate([b.t for b in bursts])
    values = decode_values([b.samples for b in bursts], reading.info, len(reading.stream.sensors))
    if any(b.stale for b in bursts):
        fresh = np.concatenate([np.arange(len(b.t)) >= b.stale for b in bursts])
        t, values = t[fresh], values[fresh]
    if reading.correction is not None:
        values = imu_calibration.correct(reading.correction, values)
    if reading.forces and reading.raw:
        values = force_calibration.correct_forces(
            values, reading.info.quantities, reading.info.full_scale, reading.forces
        )
    at_limit = np.abs(values) >= reading.limits
    if not at_limit.any():
        return Block(reading.stream, t, values), 0
    saturated = sum(
        int(at_limit[..., reading.stream.axes(q)].any(axis=-1).sum())
        for q in reading.stream.quantities
    )
    return Block(reading.stream, t, values), saturated
