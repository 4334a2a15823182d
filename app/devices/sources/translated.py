"""A source read as if it were a port that speaks the wire protocol: recording, live view and files know one device only.

In      samples at the host's clock (source.py)
Out     frames of the wire protocol, values as they came in float32; a stream is announced as soon as its rate is known
Limits  of a device that states no rate the first samples wait until RATE_FROM s are there
"""

import secrets
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any

import numpy as np

from handscope.app.devices.sources.source import Battery, Level, Measured, Occurred, Source
from handscope.app.devices.sources.tracker_table import TrackerTable
from handscope.sessions.files.original_messages import Original
from handscope.sessions.wire import messages as wire
from handscope.sessions.wire.bursts import bursts_of
from handscope.sessions.wire.framing import Decoder, Encoder

READ_WAIT = 0.1  # s that a read waits for the first sample
RATE_FROM = 1.0  # s of samples from which a rate is measured
ANNOUNCED = 1.0  # s between two descriptions of all that is known
MOST_STREAMS = 250  # of a recording: a sensor that is moved to another segment begins a new one
Key = tuple[tuple[str, ...], tuple[str, ...]]  # points, quantities


@dataclass
class _Stream:
    """One stream on its way to the wire."""

    number: int
    info: wire.StreamInfo | None = None  # None: its rate is not known yet
    waiting: list[Measured] = field(default_factory=list)
    sent: int = 0  # samples


class TranslatedPort:
    """A port that reads a source; what is written to it is answered as a glove does."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._encoder, self._decoder = Encoder(), Decoder()
        self._boot = secrets.randbits(32)
        self._slots: dict[tuple[str, ...], int] = {}
        self._streams: dict[Key, _Stream] = {}
        self._numbers = count()  # of slots
        self._stream_numbers = count()
        self._table = TrackerTable()
        self._places: Mapping[str, str] | None = None  # to be taken over by the next read
        self._answers: list[wire.Message] = []
        self._announced = -np.inf

    def read(self, most: int) -> bytes:
        """Frames of what came; empty where nothing did. OSError where the device went away."""
        del most
        found = self._replace_strips()
        arrived = self._source.receive(READ_WAIT)
        for one in arrived:
            match one:
                case Measured():
                    found += self._take(one)
                case Level():
                    self._table.note_level(one)
                case Occurred():
                    self._table.note_tap(one.details.get("tracker", ""), time.monotonic())
                    mark = wire.Mark(one.t, one.duration, one.trial_type, dict(one.details))
                    found.append(mark)
                case Battery():
                    found.append(wire.Status(one.t, 0, one.percent, float("nan")))
        found = [*self._take_answers(), *self._descriptions(bool(found)), *found]
        return b"".join(self._encoder.frame(m) for m in found)

    def write(self, data: bytes) -> int:
        """Take the host's commands: who asks is answered, everything else a source cannot do."""
        for message in self._decoder.feed(data):
            if isinstance(message, wire.Identify):
                self._announced = -np.inf
            elif isinstance(message, wire.Ping):
                self._answers.append(wire.Pong(message.token, time.monotonic_ns()))
        return len(data)

    def place(self, places: Mapping[str, str]) -> None:
        """Where a person says that sensors sit, by their names (empty: not worn); from any thread."""
        self._places = dict(places)

    def trackers(self) -> list[dict[str, Any]]:
        """A row a sensor, for pages."""
        return self._table.rows(time.monotonic())

    def take_originals(self) -> Sequence[Original]:
        """What the source gave since the last call, as it came."""
        return self._source.take_originals()

    def counts(self) -> Mapping[str, int | float]:
        """What the source counted."""
        return self._source.counts()

    def close(self) -> None:
        """Close the source."""
        self._source.close()

    def _take_answers(self) -> list[wire.Message]:
        answers, self._answers = self._answers, []
        return answers

    def _descriptions(self, needed: bool) -> list[wire.Message]:
        """Who the device is and what it sends, at first and from time to time."""
        now = time.monotonic()
        if now - self._announced < ANNOUNCED or (not needed and not np.isinf(self._announced)):
            return []
        self._announced = now
        about = self._source.about
        identity = wire.Identity(
            about.device_id, self._boot, about.hand, about.name, about.firmware
        )
        described = (
            [self._strip(points, slot) for points, slot in self._slots.items()],
            [s.info for s in self._streams.values() if s.info is not None],
        )
        return [identity, *described[0], *described[1]]

    def _strip(self, points: tuple[str, ...], slot: int) -> wire.Strip:
        mounting = self._source.about.mounting
        own = [self._table.own_place(p) for p in points]
        turned = tuple(x for p in own for x in mounting.get(p, (1.0, 0.0, 0.0, 0.0)))
        return wire.Strip(slot, True, slot + 1, points, turned)

    def _replace_strips(self) -> list[wire.Message]:
        """Take over a person's places: strips of segments with another sensor are pulled, the next samples plug them in anew."""
        places, self._places = self._places, None
        if places is None:
            return []
        changed = self._table.place(places)
        pulled = {points: slot for points, slot in self._slots.items() if changed & set(points)}
        found = [replace(self._strip(p, slot), attached=False) for p, slot in pulled.items()]
        for points in pulled:
            del self._slots[points]
        self._streams = {k: s for k, s in self._streams.items() if not changed & set(k[0])}
        return list(found)

    def _take(self, measured: Measured) -> list[wire.Message]:
        """The messages that samples make; none while the stream's rate is not known."""
        placed = self._table.placed(measured)
        if placed is None:
            return []
        measured = placed
        key = measured.points, measured.quantities
        if key not in self._streams:
            number = next(self._stream_numbers)
            if number >= MOST_STREAMS:
                return []
            self._streams[key] = _Stream(number)
        stream = self._streams[key]
        if stream.info is not None:
            return self._bursts(stream, measured)
        stream.waiting.append(measured)
        rate = measured.rate or _measured_rate(stream.waiting)
        if rate is None:
            return []
        if measured.points not in self._slots:
            self._slots[measured.points] = next(self._numbers)
        slot = self._slots[measured.points]
        n = len(measured.quantities)
        stream.info = wire.StreamInfo(
            stream.number,
            slot,
            0,
            measured.quantities,
            wire.Format.FLOAT32,
            rate,
            (1.0,) * n,
            (0.0,) * n,
        )
        waiting, stream.waiting = stream.waiting, []
        bursts = [m for part in waiting for m in self._bursts(stream, part)]
        return [self._strip(measured.points, slot), stream.info, *bursts]

    def _bursts(self, stream: _Stream, measured: Measured) -> list[wire.Message]:
        assert stream.info is not None
        found = list(bursts_of(measured.t, measured.values, stream.info, stream.sent))
        stream.sent += len(measured.t)
        return list(found)


def _measured_rate(waiting: list[Measured]) -> float | None:
    """Rate (Hz) of samples that came over at least RATE_FROM s; None where there are too few."""
    t = np.concatenate([m.t for m in waiting])
    span = float(t[-1] - t[0]) * 1e-9
    if span < RATE_FROM:
        return None
    rate = float(np.clip((len(t) - 1) / span, 1.0, 10_000.0))
    return float(f"{rate:.3g}")
