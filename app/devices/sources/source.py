"""What a source of live data gives, whoever made it: samples at the host's clock, occurrences, the state of its battery.

In      a device's own packets or streams
Out     values that app/devices/sources/translated.py writes as the wire protocol does
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.numerics.typing import Array, Indices
from handscope.sessions.files.original_messages import Original


@dataclass(frozen=True)
class Measured:
    """Consecutive samples of sensors that are sampled together."""

    points: tuple[str, ...]  # tracked points
    quantities: tuple[str, ...]
    t: Indices  # (n,) ns of the host's monotonic clock, increasing
    values: Array  # (n, points, width) SI, in the sensors' frames, NaN where missing
    rate: float | None = None  # Hz, where the device states it
    # its name, DEVICE or DEVICE/NUMBER; then points may be empty: nobody says where it sits
    sensor: str = ""


@dataclass(frozen=True)
class Occurred:
    """Something that the device says of a moment: its button, a marker."""

    t: int  # ns of the host's monotonic clock
    trial_type: str
    details: Mapping[str, str] = field(default_factory=dict)
    duration: int = 0  # ns


@dataclass(frozen=True)
class Battery:
    """How full the battery is."""

    t: int  # ns of the host's monotonic clock
    percent: int


@dataclass(frozen=True)
class Level:
    """How one of several devices is."""

    device: str  # the beginning of its sensors' names
    battery: int | None = None  # %
    signal: int | None = None  # dBm


@dataclass(frozen=True)
class About:
    """Who the device is."""

    name: str
    device_id: int
    hand: Hand | None = None
    firmware: str = ""
    mounting: Mapping[str, tuple[float, ...]] = field(default_factory=dict)  # q_BS by tracked point


Arrived = Measured | Occurred | Battery | Level


class Source(Protocol):
    """A device that is open."""

    @property
    def about(self) -> About: ...

    def receive(self, wait: float) -> Sequence[Arrived]:
        """What came; waits up to `wait` s for the first. OSError where the device went away."""
        ...

    def take_originals(self) -> Sequence[Original]:
        """What came since the last call, as it came, to be kept beside what was made of it."""
        ...

    def counts(self) -> Mapping[str, int | float]:
        """What is to be kept of how it went: packets left out, corrections of clocks."""
        ...

    def close(self) -> None: ...
