"""LSL streams: channels by label, times corrected by LSL's own correction, markers as events."""

import json
import time
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest

from handscope.app.devices.sources import lsl
from handscope.app.devices.sources.addresses import open_source, parse_source
from handscope.app.devices.sources.source import Measured, Occurred
from handscope.estimators.data.samples import ACC, GYR, ORIENTATION
from handscope.estimators.errors import InputError
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

    def __init__(self, chunks: list[tuple[list[Any], list[float]]]) -> None:
        self._chunks = chunks

    def info(self, timeout: float) -> Any:
        labels = iter([*LABELS, ""])
        return SimpleNamespace(
            nominal_srate=lambda: 100.0,
            name=lambda: "Logger",
            channel_count=lambda: len(LABELS),
            uid=lambda: "a-b-c-d-e",
            desc=lambda: _Node(labels),
        )

    def pull_chunk(self, timeout: float, most: int) -> tuple[list[Any], list[float]]:
        return self._chunks.pop(0) if self._chunks else ([], [])

    def time_correction(self, timeout: float) -> float:
        return -5.0

    def close_stream(self) -> None:
        pass


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


def test_times_never_run_back() -> None:
    opened = _open(_Inlet([([ROW, ROW], [105.0, 104.0]), ([ROW], [103.0])]))
    t = [m.t for _ in range(2) for m in opened.receive(0.0) if m.quantities == (ORIENTATION,)]
    assert (np.diff(np.concatenate(t)) > 0).all()


def test_markers_are_events() -> None:
    pose = json.dumps({"trial_type": "initial_pose", "duration": 3, "held_by": "therapist"})
    markers = _Inlet([([["start"], [pose]], [105.0, 106.0])])
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
        for k in range(100):
            outlet.push_sample([float(k), *ROW[1:]], pylsl.local_clock() + 0.01 * k)
        until = time.monotonic() + 5.0
        while sum(len(b.t) for b in blocks) < 200 and time.monotonic() < until:
            blocks += assembler.feed(port.read(65536), time.monotonic())
    streams = {b.stream.name: b.stream.quantities for b in blocks}
    assert streams == {"index": (GYR, ACC), "index_orientation": (ORIENTATION,)}
    assert sum(len(b.t) for b in blocks) == 200
