"""What flows: blocks of samples of a stream, and the events that say what the patient was doing.

A stream is a set of sensors sampled together: one tracking system of a Motion-BIDS recording, one
strip of a glove. Each keeps its own rate and clock; times in blocks are seconds from the start of
the recording. Values are in each sensor's own frame; NaN is a missing sample.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Protocol, runtime_checkable

import numpy as np

from handscope.estimators.data.events import Event as Event
from handscope.estimators.data.magnet_declaration import Plate
from handscope.estimators.hand.anatomy import SEGMENTS, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.jit import rowwise_bool
from handscope.estimators.numerics.typing import Array, Bools

GYR, ACC, MAG, FORCE, TORQUE = "gyr", "acc", "mag", "force", "torque"
# unit quaternion w, x, y, z: takes vectors from the sensor to a frame of its maker's, z up
ORIENTATION = "orientation"
# of full scale counts as saturated; ours: sensors clip a little early, and fast tapping comes near
# 2000 deg/s
SATURATION = 0.98
SLOWEST_RATE, FASTEST_RATE = 5.0, 10_000.0  # Hz that a hand's movement is sampled at
UNITS = {GYR: "rad/s", ACC: "m/s^2", MAG: "T", FORCE: "N", TORQUE: "Nm", ORIENTATION: "1"}
COMPONENTS = {q: "wxyz" if q == ORIENTATION else "xyz" for q in UNITS}
# base of the magnet's array: an inertial sensor, and a magnetometer where it has one
TRUNK = "trunk"
# more magnetometers on the trunk, rigid with it
TRUNK_MAGNETOMETERS = tuple(f"trunk_mag_{k}" for k in range(1, 33))
FORCE_POINTS = tuple(
    f"{finger}_tip_force" for finger in ("thumb", "index", "middle", "ring", "little")
)
TRACKED_POINTS = (*SEGMENTS, TRUNK, *FORCE_POINTS, *TRUNK_MAGNETOMETERS)


@dataclass(frozen=True)
class Stream:
    """Sensors that are sampled together: which quantities they give, how fast, by
    whose clock; `width` numbers a sensor."""

    name: str
    sensors: tuple[str, ...]  # names of TRACKED_POINTS
    # of GYR, ACC, MAG, FORCE, TORQUE (of a force sensor with six axes, about its origin),
    # ORIENTATION
    quantities: tuple[str, ...]
    rate: float  # Hz, nominal
    clock: str = "recording"
    # largest value of a quantity that the sensor can give, where known
    full_scale: Mapping[str, float] = field(default_factory=dict)
    # by force sensor that was calibrated, share by which its forces may be wrong
    scale_sd: Mapping[str, float] = field(default_factory=dict)
    # by force sensor, rad by which it may be turned against its cuff's inertial sensor, where known
    turn_sd: Mapping[str, float] = field(default_factory=dict)

    @property
    def inertial(self) -> bool:
        return GYR in self.quantities and ACC in self.quantities

    @property
    def oriented(self) -> bool:
        """Whether the sensors bring orientations and not what they are computed from."""
        return ORIENTATION in self.quantities and not self.inertial

    @property
    def width(self) -> int:
        """How many numbers a sample of one sensor has."""
        return width_of(self.quantities)

    def axes(self, quantity: str) -> slice:
        """Where the quantity's components lie in the last axis of a block's values."""
        return _axes(self.quantities, quantity)


@dataclass(frozen=True)
class Block:
    """Consecutive samples of one stream; a recording may be cut into blocks anywhere."""

    stream: Stream
    t: Array  # (n,) s from the start of the recording, increasing
    values: Array  # (n, sensors, width) SI, in the sensors' frames, NaN where missing

    def of(self, quantity: str) -> Array:
        """Values of one quantity (n, sensors, 3), of orientations (n, sensors, 4)."""
        return self.values[..., self.stream.axes(quantity)]

    def at_limit(self, quantity: str) -> Bools:
        """Which readings (n, sensors) of a quantity are at the sensor's limit; none where its full
        scale is not known."""
        limit = self.stream.full_scale.get(quantity)
        if limit is None or quantity not in self.stream.quantities:
            return np.zeros(self.values.shape[:2], dtype=bool)
        return exceeds(self.of(quantity), SATURATION * limit)

    def between(self, start: float, stop: float) -> "Block":
        """The samples with start <= t < stop."""
        k = np.searchsorted(self.t, [start, stop])
        return Block(self.stream, self.t[k[0] : k[1]], self.values[k[0] : k[1]])

    def parts(self, length: int) -> "Iterator[Block]":
        """The same samples in blocks of at most `length`; none of an empty block."""
        for k in range(0, len(self.t), length):
            yield Block(self.stream, self.t[k : k + length], self.values[k : k + length])


class Recording(Protocol):
    """What every kind of recording can tell (native, Motion-BIDS, simulated)."""

    @property
    def hand(self) -> Hand: ...

    @property
    def geometry(self) -> HandGeometry: ...

    @property
    def mounting(self) -> Mapping[str, Array]:
        """Nominal sensor-to-segment rotation q_BS (4,) by tracked point; identity where absent."""
        ...

    @property
    def streams(self) -> tuple[Stream, ...]: ...

    @property
    def events(self) -> tuple[Event, ...]: ...

    @property
    def warnings(self) -> tuple[str, ...]: ...

    @property
    def plate(self) -> Plate | None:
        """Declared setup of magnetometers on the trunk and a magnet on the hand."""
        ...

    def blocks(self) -> Iterator[Block]:
        """All samples, streams interleaved, each stream in order."""
        ...


@runtime_checkable
class WholeRecording(Recording, Protocol):
    """A recording that holds each of its streams whole, in memory."""

    @property
    def samples(self) -> Mapping[str, Block]:
        """By the stream's name."""
        ...


@dataclass(frozen=True)
class RecordingView:
    """A recording seen in another way: what a view does not change is the recording's."""

    recording: Recording

    @property
    def hand(self) -> Hand:
        return self.recording.hand

    @property
    def geometry(self) -> HandGeometry:
        return self.recording.geometry

    @property
    def mounting(self) -> Mapping[str, Array]:
        return self.recording.mounting

    @property
    def streams(self) -> tuple[Stream, ...]:
        return self.recording.streams

    @property
    def events(self) -> tuple[Event, ...]:
        return self.recording.events

    @property
    def warnings(self) -> tuple[str, ...]:
        return self.recording.warnings

    @property
    def plate(self) -> Plate | None:
        return self.recording.plate

    def blocks(self) -> Iterator[Block]:
        return self.recording.blocks()


@cache
def _axes(quantities: tuple[str, ...], quantity: str) -> slice:
    k = width_of(quantities[: quantities.index(quantity)])
    return slice(k, k + len(COMPONENTS[quantity]))


def width_of(quantities: Sequence[str]) -> int:
    """How many numbers these quantities have together."""
    return sum(len(COMPONENTS[q]) for q in quantities)


def every(flags: Bools) -> Bools:
    """Whether all of a vector's components are true: (..., 3) -> (...). Numpy's own reduction over
    so short an axis takes ten times as long."""
    return np.asarray(flags[..., 0] & flags[..., 1] & flags[..., 2])


@rowwise_bool("(v),()->()")
def exceeds(vector: Array, limit: float, result: Bools) -> None:
    """Whether one of a vector's components (..., 3) is as large as a limit (...): false for missing samples."""
    result[0] = abs(vector[0]) >= limit or abs(vector[1]) >= limit or abs(vector[2]) >= limit


exceeds_row = exceeds.row  # as other kernels call it


def join(blocks: list[Block]) -> Block:
    """One block of consecutive blocks of the same stream."""
    return Block(
        blocks[0].stream,
        np.concatenate([b.t for b in blocks]),
        np.concatenate([b.values for b in blocks]),
    )


def join_consecutive(blocks: Sequence[Block]) -> list[Block]:
    """Consecutive blocks of the same stream as one; a stream with a new description is another one."""
    runs: list[list[Block]] = []
    newest: dict[str, list[Block]] = {}  # by name
    for block in blocks:
        run = newest.get(block.stream.name)
        if run is None or run[0].stream != block.stream:
            run = newest[block.stream.name] = []
            runs.append(run)
        run.append(block)
    return [join(run) for run in runs]
