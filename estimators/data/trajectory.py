"""The one result type: how the hand moved. Scene, measures, report and export read only this."""

from collections.abc import Iterable
from dataclasses import dataclass, fields
from enum import IntFlag
from functools import cache

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.hand.anatomy import FINGERS, JOINTS, SEGMENTS, Hand
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array, Indices


class Flag(IntFlag):
    """What is to be known about a segment's sample before it is trusted."""

    MISSING = 1  # no sensor sample at this time: bridged or held
    # a gap too long to bridge: the segment's heading is unknown until the next calibration
    HEADING_LOST = 2
    SATURATED = 4  # the gyroscope or accelerometer was at its limit
    UNCALIBRATED = 8  # no initial pose: heading and alignment are guesses
    MAGNETIC = 16  # the magnetometer disagreed with the field learnt before
    # the sensor is broken, turned or exchanged: estimators/sensors/fault_detection.py,
    # mounting_checks.py
    FAULTY = 32
    DOUBTFUL = 64  # something is wrong with the sensor's readings; angles may be off
    LOST = 128  # within a short gap or right after it: estimators/pipeline/losses.py


FLAG_WORDS = {
    Flag.HEADING_LOST: phrase("flag.heading_lost"),
    Flag.MISSING: phrase("flag.missing"),
    Flag.SATURATED: phrase("flag.saturated"),
    Flag.UNCALIBRATED: phrase("flag.uncalibrated"),
    Flag.MAGNETIC: phrase("flag.magnetic"),
    Flag.FAULTY: phrase("flag.faulty"),
    Flag.DOUBTFUL: phrase("flag.doubtful"),
    Flag.LOST: phrase("flag.lost"),
}


class ForceFlag(IntFlag):
    """What is to be known about a fingertip's force before it is trusted."""

    MISSING = 1  # no force sample near: bridged
    SATURATED = 2  # the force sensor was at its limit
    DRIFT = 4  # what the sensor reads of nothing changed more than its noise explains
    UNBALANCED = 8  # the forces do not add up: something that is not measured touches the object
    SLIP = 16  # the object moved against the fingers
    UNORIENTED = 32  # how the fingertip is turned was not known
    # what the fingers push against each other does not quite cancel: another may carry part of the
    # load
    SHARED = 64


FORCE_WORDS = {
    ForceFlag.MISSING: phrase("force_flag.missing"),
    ForceFlag.SATURATED: phrase("force_flag.saturated"),
    ForceFlag.DRIFT: phrase("force_flag.drift"),
    ForceFlag.UNBALANCED: phrase("force_flag.unbalanced"),
    ForceFlag.SLIP: phrase("force_flag.slip"),
    ForceFlag.UNORIENTED: phrase("force_flag.unoriented"),
    ForceFlag.SHARED: phrase("force_flag.shared"),
}


class PlaceFlag(IntFlag):
    """What is to be known about the hand's place before it is trusted."""

    MISSING = 1  # no samples of hand, trunk or magnetometers near
    # the magnet's field is too weak: the place is known to some centimetres at best
    OUT_OF_REACH = 2
    DOUBTFUL = 4  # the readings contradict the declared magnetometers, magnet and room
    SATURATED = 8  # a magnetometer was at its limit
    LOST = 16  # within a short gap of hand, trunk or magnetometers, or right after it


PLACE_WORDS = {
    PlaceFlag.DOUBTFUL: phrase("place_flag.doubtful"),
    PlaceFlag.OUT_OF_REACH: phrase("place_flag.out_of_reach"),
    PlaceFlag.SATURATED: phrase("place_flag.saturated"),
    PlaceFlag.MISSING: phrase("place_flag.missing"),
    PlaceFlag.LOST: phrase("place_flag.lost"),
}


@dataclass(frozen=True)
class Trajectory:
    """Samples of the hand's movement; NaN where a segment is not measured."""

    hand: Hand
    t: Array  # (n,) s from the start of the recording
    # (n, joints, 3) rad: flexion, deviation, pronation of anatomy.JOINTS; NaN where a joint
    # has no such freedom
    angles: Array
    q_GS: Array  # (n, segments, 4) segment orientations in the global frame
    tips: Array  # (n, 5, 3) m, ends of the distal bones in the wrist frame WCS, thumb first
    flags: NDArray[np.uint8]  # (n, segments) Flag bits
    angles_sd: Array | None = None  # (n, joints, 3) rad, where the method gives it
    tips_sd: Array | None = None  # (n, 5, 3) m
    # (n, 5, 3) N, exerted by each fingertip on what it touches, in the global frame; NaN where not
    # measured
    forces: Array | None = None
    forces_sd: Array | None = None  # (n, 5, 3) N
    # (n, 5, 3) N, of that what a hold does not average out: zero, scale, orientation
    forces_common_sd: Array | None = None
    force_flags: NDArray[np.uint8] | None = None  # (n, 5) ForceFlag bits
    # (n, 5) relative error of each force common to all samples, where a sensor was
    # calibrated
    force_scale_sd: Array | None = None
    # (n, 5, 3) Nm, exerted by each fingertip about its force sensor's origin, in the global frame;
    # of sensors with six axes
    torques: Array | None = None
    torques_sd: Array | None = None  # (n, 5, 3) Nm
    # (n, 3) m/s^2, mean specific force g + a of the fingertips with force sensors, in the global
    # frame
    lifting: Array | None = None

    # (n, 3) m, the hand's sensor from the trunk's, trunk's axes: forward, up, right; NaN where not
    # known
    place: Array | None = None
    place_sd: Array | None = None  # (n, 3) m
    place_flags: NDArray[np.uint8] | None = None  # (n,) PlaceFlag bits
    # (n, 4) of the trunk, z up, y where the horizontal field points: not the heading of q_GS
    q_trunk: Array | None = None
    q_trunk_sd: Array | None = None  # (n, 3) rad about the axes of the trunk's sensor
    # (n,) dB of the magnetometer that hears most, (5.23); 0: the earth's field alone
    signal: Array | None = None

    def __len__(self) -> int:
        return len(self.t)

    def between(self, start: float, stop: float) -> "Trajectory":
        """The samples with start <= t < stop."""
        first, last = np.searchsorted(self.t, [start, stop])
        return self._each(lambda a: a[first:last])

    def at(self, rows: Indices) -> "Trajectory":
        """The samples of these rows."""
        return self._each(lambda a: a[rows])

    def without(self, spans: Iterable[tuple[float, float]]) -> "Trajectory":
        """The samples outside these stretches of time [start, stop]."""
        kept = np.ones(len(self), bool)
        for start, stop in spans:
            kept &= (self.t < start) | (self.t > stop)
        return self if kept.all() else self._each(lambda a: a[kept])

    def reversed(self) -> "Trajectory":
        """The same samples in reverse order."""
        return self._each(lambda a: a[::-1])

    def _each(self, change: "object") -> "Trajectory":
        assert callable(change)
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return Trajectory(
            **{name: change(v) if isinstance(v, np.ndarray) else v for name, v in values.items()}
        )


@cache
def empty(hand: Hand) -> Trajectory:
    """The trajectory without samples."""
    n_joints, n_segments = len(JOINTS), len(SEGMENTS)
    return Trajectory(
        hand,
        np.empty(0),
        np.empty((0, n_joints, 3)),
        np.empty((0, n_segments, 4)),
        np.empty((0, len(FINGERS), 3)),
        np.empty((0, n_segments), np.uint8),
    )


def join(pieces: Iterable[Trajectory], hand: Hand, expected: int = 0) -> Trajectory:
    """One trajectory of consecutive pieces; those of a generator are let go as they come, so that
    the memory is not doubled. One alone is itself. Where at most so many samples are `expected`, no
    array is moved as it grows."""
    full: list[Trajectory] = [p for p in pieces if len(p)] if isinstance(pieces, list) else []
    if len(full) == 1:
        return full[0]
    grown: dict[str, Array] = {}
    partial: set[str] = set()  # standard deviations that not every piece has
    rows = 0
    for piece in pieces:
        if len(piece):
            for name in (f.name for f in fields(Trajectory) if f.name != "hand"):
                if (values := getattr(piece, name)) is None or (rows and name not in grown):
                    partial.add(name)
                else:
                    grown[name] = _append(grown.get(name), rows, values, expected)
            rows += len(piece)
    if not rows:
        return empty(hand)
    for values in grown.values():
        values.resize((rows, *values.shape[1:]), refcheck=False)
    values_by_name = {name: None if name in partial else grown[name] for name in (*grown, *partial)}
    return Trajectory(hand, **values_by_name)  # type: ignore[arg-type]


def _append(grown: Array | None, rows: int, values: Array, expected: int) -> Array:
    """`values` behind the first `rows` rows of an array that owns its memory and grows in place."""
    if grown is None:
        grown = np.empty((expected, *values.shape[1:]), values.dtype)
    needed = rows + len(values)
    if needed > len(grown):
        # the system moves pages, it copies nothing
        grown.resize((max(needed, len(grown) * 9 // 8), *grown.shape[1:]), refcheck=False)
    grown[rows:needed] = values
    return grown
