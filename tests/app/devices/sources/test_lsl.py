"""LSL streams: channels by label, times corrected by LSL's own correction, markers as events."""

import io
import json
import time
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest

from handscope.app.devices import acquisition
from handscope.app.devices.sources import lsl
from handscope.app.devices.sources.addresses import open_source, parse_source
from handscope.app.devices.sources.lsl_originals import samples_message, samples_of
from handscope.app.devices.sources.source import Measured, Occurred
from handscope.app.devices.sources.translated import TranslatedPort
from handscope.estimators.data.samples import ACC, GYR, ORIENTATION
from handscope.estimators.errors import InputError
from handscope.sessions.files import native
from handscope.sessions.files.original_messages import pack, read_originals, unpack
from handscope.sessions.files.recorder import Recorder
from handscope.sessions.sealing.keys import VARIABLE, make_key
from handscope.sessions.sealing.stored import is_sealed
from handscope.sessions.table_import.column_map import parse_map
from handscope.sessions.wire.assembly import Assembler

LABELS = ["counter", "wx", "wy", "wz", "ax", "ay", "az", "q0", "q1", "q2", "q3"]
MAP = {
    "hand": "right",
    "sensors": {
        "index_middle": {
            "gyr": {"columns": ["wx", "wy", "wz"], "unit": "deg/s"},
            "acc": {"columns": ["ax", "ay", "az"], "unit": "mg"},
            "orientation": {"columns": [7, 8, 9, 10], "unit": "1"},
        }
    },
}
ROW = [7.0, 180.0, 0.0, 0.0, 0.0, 0.0, 1000.0, 1.0, 0.0, 0.0, 0.0]


class _Inlet:
    """What pylsl gives, from a script: the remote clock is 5 s ahead."""

    def __init__(self, chunks: list[tuple[list[Any], list[float]]], number: int = 2) -> None:
        self._chunks, self._number = chunks, number

    def info(self, timeout: float) -> Any:
        labels = iter([*LABELS, ""])
        return SimpleNamespace(
            nominal_srate=lambda: 100.0,
            name=lambda: "Logger",
            channel_count=lambda: len(LABELS),
            uid=lambda: f"a-b-c-d-{self._number}",
            channel_format=lambda: self._number,
            as_xml=lambda: f"<info><name>Logger {self._number} é</name></info>",
            desc=lambda: _Node(labels),
        )

    def pull_chunk(self, timeout: float, most: int) -> tuple[list[Any], list[float]]:
        return self._chunks.pop(0) if self._chunks else ([], [])

    def time_correction(self, timeout: float) -> float:
        return -5.0

    def close_stream(self) -> None:
        pass


class _Commands:
    """A server that goes away when all pieces were taken."""

    def __init__(self, pieces: list[Any]) -> None:
        self._pieces = pieces

    def read(self, size: int) -> bytes:
        while self._pieces:
            time.sleep(0.01)
        return b""


class _Node:
    """The description's channels."""

    def __init__(self, labels: Any) -> None:
        self._labels = labels
        self._label = ""

    def child(self, name: str) -> "_Node":
        if name == "channel":
            self._label = next(self._labels)
        return self

    def next_sibling(self, name: str) -> "_Node":
        self._label = next(self._labels)
        return self

    def empty(self) -> bool:
        return not self._label

    def child_value(self, name: str) -> str:
        return self._label


def _open(inlet: Any, markers: list[Any] | None = None, **changes: Any) -> lsl.Inlet:
    columns = parse_map(MAP | changes, "map.json", True)
    return lsl.Inlet(inlet, markers or [], columns, time.monotonic)


def test_mapped_channels_are_converted_and_times_corrected() -> None:
    opened = _open(_Inlet([([ROW, ROW], [105.00, 105.01])]))
    raw, given = (m for m in opened.receive(0.0) if isinstance(m, Measured))
    assert (raw.quantities, given.quantities) == ((GYR, ACC), (ORIENTATION,))
    np.testing.assert_allclose(raw.values[0, 0], [np.pi, 0, 0, 0, 0, 9.80665])
    np.testing.assert_allclose(raw.t / 1e9, [100.0, 100.01], atol=1e-3)
    assert opened.counts() == {"lsl_first_correction_s": -5.0, "lsl_newest_correction_s": -5.0}
    assert opened.about.hand == "right"


@pytest.mark.parametrize("sealed", [False, True])
def test_a_recording_keeps_every_channel_as_it_came(
    sealed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bit for bit in the stream's own format, with its own times: also the channels that no map names, and markers."""
    if sealed:
        make_key(tmp_path / "key")
        monkeypatch.setenv(VARIABLE, str(tmp_path / "key"))
    rng = np.random.default_rng(3)
    rows, t = rng.normal(size=(40, len(LABELS))), 105.0 + np.cumsum(rng.uniform(0.009, 0.011, 40))
    pieces = [(rows[k : k + 10].tolist(), t[k : k + 10].tolist()) for k in range(0, 40, 10)]
    pieces.append(([], []))  # when it is asked for, the others are on their way to the file
    opened = _open(_Inlet(pieces), [_Inlet([([["grip é"]], [106.25])], number=3)])
    monkeypatch.setattr(acquisition, "open_port", lambda url: TranslatedPort(opened))
    path = tmp_path / "r.mcap"
    with Recorder(path, {}, time.monotonic(), stored=sealed) as recorder:
        recording = acquisition.Acquisition("lsl://Logger?map=m.json", recorder, io.BytesIO())
        recording.run(_Commands(pieces))  # type: ignore[arg-type]
    assert is_sealed(path) == sealed
    kept = list(read_originals(path))
    of = lambda kind, n: [  # noqa: E731
        o for o in kept if (o.head["kind"], o.head["stream"]) == (kind, f"a-b-c-d-{n}")
    ]
    assert [o.body.decode() for n in (2, 3) for o in of("lsl_info", n)] == [
        f"<info><name>Logger {n} é</name></info>" for n in (2, 3)
    ]
    assert [o.head["correction"] for o in of("lsl_time_correction", 2)] == [-5.0]
    times, values = zip(*(samples_of(o) for o in of("lsl_samples", 2)))
    np.testing.assert_array_equal(np.concatenate(times), t)
    np.testing.assert_array_equal(np.concatenate(values), rows)
    (marker_times, texts), *others = [samples_of(o) for o in of("lsl_samples", 3)]
    assert (marker_times.tolist(), texts, others) == ([106.25], [["grip é"]], [])
    assert {len(b.t) for b in native.load(path).samples.values()} == {40}


@pytest.mark.parametrize(("number", "dtype"), [(1, "<f4"), (4, "<i4"), (5, "<i2"), (7, "<i8")])
def test_other_formats_are_kept_as_they_are(number: int, dtype: str) -> None:
    values = np.array([[3, -5], [2**15 - 1, 7]], dtype)
    kept = unpack(pack(samples_message("u", values.tolist(), [0.1, 0.3], number)))
    t, read = samples_of(kept)
    assert (read.dtype.str, t.tolist()) == (dtype, [0.1, 0.3])
    np.testing.assert_array_equal(read, values)


def test_times_never_run_back() -> None:
    opened = _open(_Inlet([([ROW, ROW], [105.0, 104.0]), ([ROW], [103.0])]))
    t = [m.t for _ in range(2) for m in opened.receive(0.0) if m.quantities == (ORIENTATION,)]
    assert (np.diff(np.concatenate(t)) > 0).all()


def test_markers_are_events() -> None:
    pose = json.dumps({"trial_type": "initial_pose", "duration": 3, "held_by": "therapist"})
    markers = _Inlet([([["start"], [pose]], [105.0, 106.0])], number=3)
    found = [o for o in _open(_Inlet([]), [markers]).receive(0.0) if isinstance(o, Occurred)]
    assert [o.trial_type for o in found] == ["annotation", "initial_pose"]
    assert found[0].details == {"note": "start"}
    assert (found[1].duration, found[1].details) == (3_000_000_000, {"held_by": "therapist"})


@pytest.mark.parametrize(
    "text", ["[1]", "3", '{"duration": 3}', '{"trial_type": "x", "duration": "y"}']
)
def test_a_marker_that_is_no_event_is_a_note(text: str) -> None:
    assert lsl.marker_event(text, 1).details == {"note": text}


def test_a_channel_that_is_not_there_is_named() -> None:
    sensors = {"hand": {"gyr": {"columns": ["wx", "wy", "w"], "unit": "deg/s"}}}
    with pytest.raises(InputError, match="Logger has no channel 'w'; channels are counter"):
        _open(_Inlet([]), sensors=sensors)


def test_a_stream_without_a_map_is_refused() -> None:
    with pytest.raises(InputError, match="names no map"):
        lsl.open_source(parse_source("lsl://Logger"))


@pytest.mark.slow
def test_a_real_stream_comes_as_wire_protocol(tmp_path: Path) -> None:
    pylsl = pytest.importorskip("pylsl")
    name = f"Handscope test {tmp_path.name}"
    info = pylsl.StreamInfo(name, "MoCap", len(LABELS), 100.0, "double64", tmp_path.name)
    channels = info.desc().append_child("channels")
    for label in LABELS:
        channels.append_child("channel").append_child_value("label", label)
    outlet = pylsl.StreamOutlet(info)
    (tmp_path / "map.json").write_text(json.dumps(MAP))
    url = f"lsl://{quote(name)}?map={quote(str(tmp_path / 'map.json'))}"
    assembler, blocks = Assembler(), []
    with closing(open_source(url)) as port:
        assert outlet.wait_for_consumers(5.0)
        rows = [[k / 3, *ROW[1:]] for k in range(100)]
        t = [pylsl.local_clock() + 0.01 * k for k in range(100)]
        for row, at in zip(rows, t):
            outlet.push_sample(row, at)
        until = time.monotonic() + 5.0
        while sum(len(b.t) for b in blocks) < 200 and time.monotonic() < until:
            blocks += assembler.feed(port.read(65536), time.monotonic())
        kept = port.take_originals()
    taken = [samples_of(o) for o in kept if o.head["kind"] == "lsl_samples"]
    assert [x for times, _ in taken for x in times] == t
    assert [list(row) for _, values in taken for row in values] == rows
    assert outlet.get_info().uid().encode() in next(
        o.body for o in kept if o.head["kind"] == "lsl_info"
    )
    assert "lsl_time_correction" in {o.head["kind"] for o in kept}
    streams = {b.stream.name: b.stream.quantities for b in blocks}
    assert streams == {"index": (GYR, ACC), "index_orientation": (ORIENTATION,)}
    assert sum(len(b.t) for b in blocks) == 200
