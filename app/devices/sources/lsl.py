"""A Lab Streaming Layer stream as a source: the channels that a map names, and the markers of the same network.

In      lsl://NAME?map=FILE.json; channels by the label of the stream's description, or by number from 0
Out     samples at LSL's own times, corrected by its time_correction; a marker is an annotation, or the event that its JSON describes
Source  pylsl (Lab Streaming Layer); Kothe et al. 2025, Imaging Neuroscience (time synchronisation)
Limits  what is corrected anew every CORRECT_AGAIN s may set times by parts of a millisecond
"""

import contextlib
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from handscope.app.devices.sources.addresses import SourceAddress
from handscope.app.devices.sources.channel_labels import channel_sets
from handscope.app.devices.sources.lsl_originals import (
    TEXT,
    correction_message,
    info_message,
    samples_message,
)
from handscope.app.devices.sources.source import About, Arrived, Measured, Occurred
from handscope.estimators.errors import InputError
from handscope.estimators.numerics.typing import Array
from handscope.sessions.files.original_messages import Original
from handscope.sessions.table_import.column_map import Column, ColumnMap

FIND_WAIT = 3.0  # s that a stream of this name is searched
MARKERS_WAIT = 0.3  # s that streams of markers are searched, and that each is waited for
CORRECT_AGAIN = 5.0  # s
MOST_SAMPLES = 1024  # pulled at once
MARKERS = "Markers"  # LSL's type of streams of events


def open_source(address: SourceAddress) -> "Inlet":
    """Find and open the stream; InputError where there is none, or where the map does not fit it."""
    columns = address.columns()
    if columns is None:
        raise InputError("device.lsl_map_missing", url=address.url)
    lsl = _library()
    found = lsl.resolve_byprop("name", address.what, 1, FIND_WAIT)
    if not found:
        raise InputError("device.lsl_stream_missing", name=address.what)
    markers = lsl.resolve_byprop("type", MARKERS, 1, MARKERS_WAIT)
    inlet = lsl.StreamInlet(found[0], recover=False)
    try:
        inlet.open_stream(FIND_WAIT)
    except Exception:  # pylsl's TimeoutError and LostError
        raise InputError("device.lsl_stream_silent", name=address.what) from None
    return Inlet(
        inlet, _open_markers([lsl.StreamInlet(m) for m in markers]), columns, lsl.local_clock
    )


def _open_markers(markers: list[Any]) -> list[Any]:
    """Streams of markers, opened: what is sent before the first pull would be lost otherwise."""
    for inlet in markers:
        with contextlib.suppress(Exception):  # a stream that has just gone; it is pulled in vain
            inlet.open_stream(MARKERS_WAIT)
    return markers


def _library() -> Any:
    try:
        import pylsl
    except (ImportError, RuntimeError):
        raise InputError("device.lsl_package_missing") from None
    return pylsl


class Inlet:
    """An open stream; `inlet` and `markers` are pylsl.StreamInlet, `clock` LSL's local clock in s."""

    def __init__(self, inlet: Any, markers: Sequence[Any], columns: ColumnMap, clock: Any) -> None:
        self._inlet, self._markers, self._columns = inlet, list(markers), columns
        info = inlet.info(2.0)
        self._rate = float(info.nominal_srate()) or None
        self._name, self._count = str(info.name()), int(info.channel_count())
        labels = _labels(info)
        self._sets = [
            (s, [self._channel(label, labels) for label in s.labels]) for s in channel_sets(columns)
        ]
        self._clock, self._offset = clock, time.monotonic() - clock()
        self._originals: list[Original] = []
        self._streams: list[tuple[str, int]] = []  # uid and format by inlet: the samples' first
        self._describe(info)
        for marker in self._markers:
            self._describe(_info(marker))
        self._corrections: dict[int, float] = {}  # s, by inlet: 0 the samples', then the markers'
        self._corrected = -np.inf
        self._first_correction: float | None = None
        self._newest = 0  # ns

    @property
    def about(self) -> About:
        """What the stream says of itself, and the map of the hand."""
        mounting = {p: s.mounting for p, s in self._columns.sensors.items()}
        number = int.from_bytes(self._streams[0][0].encode()[:6])
        return About(f"LSL {self._name}", number, self._columns.hand, mounting=mounting)

    def receive(self, wait: float) -> Sequence[Arrived]:
        """Samples and markers that came."""
        self._correct()
        try:
            samples, t = self._inlet.pull_chunk(wait, MOST_SAMPLES)
        except Exception as problem:  # pylsl's LostError, which lies in its inner modules
            raise OSError(f"the LSL stream {self._name} ended ({problem})") from None
        self._keep(0, samples, t)
        return [
            *self._split_channels(np.asarray(samples, float), np.asarray(t, float)),
            *self._events(),
        ]

    def take_originals(self) -> Sequence[Original]:
        """Every channel of every stream as it came, the clocks' corrections, the descriptions."""
        taken, self._originals = self._originals, []
        return taken

    def counts(self) -> Mapping[str, int | float]:
        """The corrections by which the remote times were made ours, s."""
        if self._first_correction is None:
            return {}
        newest = self._corrections.get(0, 0.0)
        return {
            "lsl_first_correction_s": self._first_correction,
            "lsl_newest_correction_s": newest,
        }

    def close(self) -> None:
        """Leave the streams."""
        for inlet in (self._inlet, *self._markers):
            inlet.close_stream()

    def _channel(self, label: Column, labels: Sequence[str]) -> int:
        """Which channel a label names; InputError where there is none."""
        if isinstance(label, int) and 0 <= label < self._count:
            return label
        if isinstance(label, str) and labels.count(label) == 1:
            return labels.index(label)
        known = ", ".join(labels[:40]) or f"0 to {self._count - 1}"
        raise InputError("device.lsl_channel_missing", name=self._name, label=label, known=known)

    def _correct(self) -> None:
        """Ask how far the remote clocks are off, from time to time; what does not answer stays as it was."""
        if time.monotonic() - self._corrected < CORRECT_AGAIN:
            return
        self._corrected = time.monotonic()
        for k, inlet in enumerate((self._inlet, *self._markers)):
            with contextlib.suppress(Exception):  # pylsl.TimeoutError: nobody answers now
                self._corrections[k] = float(inlet.time_correction(1.0))
                uid = self._streams[k][0]
                self._originals.append(correction_message(uid, self._corrections[k], self._clock()))
        if self._first_correction is None:
            self._first_correction = self._corrections.get(0)

    def _describe(self, info: Any) -> None:
        """Note a stream's uid and format; None where it has gone."""
        if info is None:
            self._streams.append(("", TEXT))
            return
        self._streams.append((str(info.uid()), int(info.channel_format())))
        self._originals.append(info_message(str(info.uid()), info))

    def _keep(self, inlet: int, samples: Sequence[Any], t: Sequence[float]) -> None:
        if len(t):
            uid, number = self._streams[inlet]
            self._originals.append(samples_message(uid, samples, t, number))

    def _nanoseconds(self, t: Array, inlet: int) -> Any:
        """Remote times (n,) s as ns of the host's monotonic clock."""
        return np.rint((t + self._corrections.get(inlet, 0.0) + self._offset) * 1e9).astype(
            np.int64
        )

    def _split_channels(self, samples: Array, t: Array) -> Iterator[Measured]:
        if not len(t):
            return
        at = np.maximum(self._nanoseconds(t, 0), self._newest + 1)
        at = np.maximum.accumulate(at - np.arange(len(at))) + np.arange(len(at))
        self._newest = int(at[-1])
        for channels, columns in self._sets:
            values = samples[:, columns] * channels.factors
            sensor = f"{self._name}/{channels.point}"
            yield Measured(
                (channels.point,), channels.quantities, at, values[:, None], self._rate, sensor
            )

    def _events(self) -> Iterator[Occurred]:
        for k, inlet in enumerate(self._markers, start=1):
            with contextlib.suppress(Exception):  # one stream of markers that is gone
                texts, t = inlet.pull_chunk(0.0, MOST_SAMPLES)
                self._keep(k, texts, t)
                for text, at in zip(texts, self._nanoseconds(np.asarray(t, float), k)):
                    yield marker_event(str(text[0]), int(at))


def marker_event(text: str, at: int) -> Occurred:
    """A marker as an event: JSON with trial_type, duration (s) and details, or a note."""
    try:
        value = json.loads(text)
        kind, duration = str(value.pop("trial_type")), float(value.pop("duration", 0.0))
    except (ValueError, TypeError, KeyError, AttributeError):
        return Occurred(at, "annotation", {"note": text[:200]})
    details = {str(k)[:40]: str(v)[:200] for k, v in list(value.items())[:20]}
    length = duration if 0 <= duration < 3600 else 0.0
    return Occurred(at, kind[:40], details, round(length * 1e9))


def _info(inlet: Any) -> Any:
    """The description of a stream of markers; None where it has just gone."""
    try:
        return inlet.info(2.0)
    except Exception:  # pylsl's TimeoutError and LostError
        return None


def _labels(info: Any) -> list[str]:
    """The channels' labels, as many as the description has."""
    found: list[str] = []
    channel = info.desc().child("channels").child("channel")
    while not channel.empty() and len(found) < info.channel_count():
        found.append(str(channel.child_value("label")))
        channel = channel.next_sibling("channel")
    return found
