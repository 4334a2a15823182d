"""What the fusion of a stream keeps from sample to sample, and what it gives.

In      sensors each for itself, or all of a stream together while they miss nothing
Source  ours
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.samples import Block, Stream
from handscope.estimators.data.trajectory import Flag
from handscope.estimators.numerics.typing import Array, Bools
from handscope.estimators.orientation.vqf_bank import FilterBank

LOST, NEVER_KNOWN = int(Flag.HEADING_LOST), int(Flag.UNCALIBRATED)


@dataclass(frozen=True)
class SensorState:
    """One sensor's filter; `filter_state` is None until its first complete sample."""

    start: Array | None  # (4,) q_GS to start from, None = from the first accelerometer sample
    bias: Array  # (3,) rad/s, subtracted before the filter
    # s, `start` holds up to here; a sensor that begins later does not know its heading
    known_until: float = np.inf
    # rad, heading of magnetic north in the pose; None: it is taken from the first magnetometer
    # sample
    north: float | None = None
    filter_state: Mapping[str, Any] | None = None
    last: Array | None = None  # (6,) newest complete sample, bias still in it
    last_t: float = -np.inf
    previous: Array | None = None  # (6,) the one before, where nothing is missing between them
    previous_t: float = -np.inf
    q_GS: Array | None = None  # (4,) newest orientation
    rotation_variance: float = 0.0  # rad^2, variance of the heading that gaps have cost so far
    lost: bool = False  # a gap was too long; true until the next calibration or magnetometer sample
    has_north: bool = False  # a magnetometer has given the heading
    absent: bool = True  # at this moment there is nothing to bridge from

    @property
    def is_running(self) -> bool:
        """Whether the filter runs and nothing has been missed that it could not bridge."""
        return self.filter_state is not None and not self.absent

    @property
    def headless(self) -> np.uint8:
        """Flags of a heading that is lost or was never known."""
        return np.uint8(
            (LOST if self.lost else 0)
            | (NEVER_KNOWN if self.start is None and not self.has_north else 0)
        )


@dataclass(frozen=True)
class JointState:
    """All sensors of a stream whose filters go on without magnetometers: what changes from sample
    to sample, and what is prepared once."""

    initial: tuple[SensorState, ...]  # as they were when this began
    bias: Array  # (sensors, 3)
    headless: NDArray[np.uint8]  # (sensors,)
    rotation_variance: Array  # (sensors,)
    filters: FilterBank
    last: Array  # (sensors, 6)
    last_t: float
    q_GS: Array  # (sensors, 4)
    previous: Array | None = None  # (sensors, 6); None: they have not gone on yet
    previous_t: float = -np.inf

    def each(self) -> tuple[SensorState, ...]:
        """The sensors as they are now."""
        if self.previous is None:
            return self.initial
        newest = zip(self.initial, self.filters.states(), self.last, self.previous, self.q_GS)
        return tuple(
            replace(
                s,
                filter_state=f,
                last=last,
                last_t=self.last_t,
                previous=before,
                previous_t=self.previous_t,
                q_GS=q,
            )
            for s, f, last, before, q in newest
        )


@dataclass(frozen=True)
class StreamState:
    """State of one stream's fusion."""

    stream: Stream
    fused: tuple[SensorState, ...] | JointState
    period: float  # s, between samples as they come
    # (rows, sensors, 3) rad/s of the newest rows, at most RECENT; NaN where missing
    recent: Array
    t: float = -np.inf  # newest sample seen
    held: Block | None = None  # samples that wait until a gap at their end is over
    held_sampled: Bools = field(default_factory=lambda: np.empty(0, bool))

    @property
    def sensors(self) -> tuple[SensorState, ...]:
        return self.fused.each() if isinstance(self.fused, JointState) else self.fused


@dataclass(frozen=True)
class Oriented:
    """Orientations at the stream's samples and at the instants where samples are missing."""

    t: Array  # (n,)
    q_GS: Array  # (n, sensors, 4)
    flags: NDArray[np.uint8]  # (n, sensors)
    # (n, sensors) rad^2, variance of the heading that gaps have cost so far
    rotation_variance: Array
    sampled: Bools  # (n,) false at instants where the recording has no sample
