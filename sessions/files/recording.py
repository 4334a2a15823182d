"""A recording opened: everything it holds, in memory, whatever file it came from."""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from handscope.estimators.data.magnet_declaration import Plate
from handscope.estimators.data.samples import Block, Event, Stream
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array

SLICE = 10.0  # s of a block when a recording is gone through
LONGEST_GAP = (
    86400.0  # s between samples of one recording: a glove may pause over lunch, not for a day
)


@dataclass(frozen=True)
class LoadedRecording:
    """Satisfies estimators.samples.Recording."""

    hand: Hand
    geometry: HandGeometry
    mounting: Mapping[str, Array]
    samples: Mapping[str, Block]  # by stream name, each stream whole
    events: tuple[Event, ...]
    warnings: tuple[str, ...] = ()
    start_utc: str | None = None  # ISO 8601
    checksum: str = ""  # sha256 of the file or, for a folder, of its files in order of name
    # format, device, firmware, software: provenance in words
    source: Mapping[str, Any] = field(default_factory=dict)
    losses: Mapping[str, int] = field(default_factory=dict)  # samples lost on the way, by stream
    # which strip each tracked point was on, where the glove says
    strip_ids: Mapping[str, str] = field(default_factory=dict)
    plate: Plate | None = None  # magnetometers on the trunk and magnet on the hand, where declared

    @property
    def streams(self) -> tuple[Stream, ...]:
        return tuple(b.stream for b in self.samples.values())

    @property
    def duration(self) -> float:
        """Seconds from the first to the last sample of any stream."""
        spans = [(b.t[0], b.t[-1]) for b in self.samples.values() if len(b.t)]
        return float(max(e for _, e in spans) - min(s for s, _ in spans)) if spans else 0.0

    def blocks(self) -> Iterator[Block]:
        """All samples in slices of SLICE seconds, streams interleaved."""
        filled = [b for b in self.samples.values() if len(b.t)]
        if not filled:
            return
        first, last = min(b.t[0] for b in filled), max(b.t[-1] for b in filled)
        edges = [*np.arange(first, last, SLICE), np.inf] if last > first else [first, np.inf]
        for start, stop in itertools.pairwise(edges):
            yield from (piece for b in filled if len((piece := b.between(start, stop)).t))

    def during(self, event_start: float, event_end: float) -> list[Block]:
        """The samples of all streams within a stretch of time."""
        return [b.between(event_start, event_end) for b in self.samples.values()]

    def of_type(self, trial_type: str) -> list[Event]:
        """Events of one trial type in order of time."""
        return sorted((e for e in self.events if e.trial_type == trial_type), key=lambda e: e.onset)

    def with_events(self, events: tuple[Event, ...]) -> "LoadedRecording":
        return replace(self, events=events)


def require_samples(recording: LoadedRecording, name: str) -> LoadedRecording:
    """Refuse a recording without inertial samples or orientations, or one whose clock was set meanwhile."""
    if not any(
        (b.stream.inertial or b.stream.oriented) and len(b.t) for b in recording.samples.values()
    ):
        raise InputError("recording.no_inertial_samples", name=name)
    t = np.sort(np.concatenate([b.t for b in recording.samples.values()]))
    steps = np.diff(t)
    if len(steps) and steps.max() > LONGEST_GAP:
        at = int(steps.argmax())
        raise InputError(
            "recording.clock_jumps", name=name, days=float(steps[at]) / 86400, at=float(t[at])
        )
    return recording
