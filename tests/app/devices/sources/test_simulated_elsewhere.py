"""A movement that another program simulated comes in as SlimeVR packets and as an LSL stream, and gives the angles of its native recording."""

import json
import struct
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest

from handscope.app.devices.sources.addresses import open_source
from handscope.app.devices.sources.slimevr.listener import Listener
from handscope.app.devices.sources.translated import TranslatedPort
from handscope.estimators.data.samples import ACC, GYR, Block
from handscope.estimators.numerics.constants import GRAVITY
from handscope.sessions.files.recorder import Recorder
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import recordings
from handscope.sessions.table_import.column_map import parse_map
from tests.app.devices.sources import slime_trackers as slime
from tests.sessions.table_import.elsewhere import (
    largest_difference,
    lift,
    processed,
    require_same_ranges,
)
from tests.simulated import DEG

MAC = "A4:CF:12:00:00:07"
UNITS = {"gyr": "deg/s", "acc": "g"}


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return lift(tmp_path_factory.mktemp("elsewhere") / "recording")


@pytest.fixture(scope="module")
def recording(native: Path) -> LoadedRecording:
    return recordings.load(native)


@pytest.fixture(scope="module")
def angles(native: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    return processed(native, tmp_path_factory.mktemp("native"))


def readings(block: Block, k: int) -> np.ndarray:
    """deg/s and g (n, 6) of one sensor, as such devices give them."""
    return np.concatenate([block.of(GYR)[:, k] / DEG, block.of(ACC)[:, k] / GRAVITY], axis=1)


def column_map(recording: LoadedRecording, labels: dict[str, list[str]]) -> dict[str, Any]:
    """Six labels by segment."""
    sensors = {
        point: {
            quantity: {"columns": names[first : first + 3], "unit": UNITS[quantity]}
            for quantity, first in (("gyr", 0), ("acc", 3))
        }
        | {"mounting": [float(x) for x in recording.mounting.get(point, (1, 0, 0, 0))]}
        for point, names in labels.items()
    }
    return {"hand": recording.hand, "sensors": sensors}


def inspection(sensor: int, row: np.ndarray) -> bytes:
    """Body of an inspection packet with raw samples in float: gyroscope, accelerometer, magnetometer."""
    numbers = (*row, 0.0, 0.0, 0.0)
    three = (struct.pack(">3fB", *numbers[k : k + 3], 255) for k in (0, 3, 6))
    return struct.pack(">3B", 1, sensor, 2) + b"".join(three)


def test_inspection_packets_of_slimevr_trackers_give_the_angles_of_the_native_recording(
    native: Path, recording: LoadedRecording, angles: dict[str, np.ndarray], tmp_path: Path
) -> None:
    """Through a real socket; each packet comes at its sample's time, which such trackers do not state."""
    block, now = recording.samples["imu"], [0]
    labels = {
        point: [f"{MAC}/{k}/{quantity}{axis}" for quantity in "ga" for axis in "xyz"]
        for k, point in enumerate(block.stream.sensors)
    }
    values = np.stack([readings(block, k) for k in range(len(labels))], axis=1)
    columns = parse_map(column_map(recording, labels), "map", True)
    path = tmp_path / "slime.mcap"
    listener = Listener("127.0.0.1", 0, columns, lambda waited: now[0])
    events = [replace(e, onset=e.onset - float(block.t[0])) for e in recording.events]
    with closing(TranslatedPort(listener)) as port, Recorder(path, {}, 0.0) as recorder:
        with closing(slime.tracker_socket()) as tracker:
            address = ("127.0.0.1", listener.port)
            tracker.sendto(slime.handshake(), address)
            recorder.write(port.read(1), 0.0)
            for number, (t, row) in enumerate(zip(block.t, values), start=1):
                now[0] = round(1e9 * t)
                parts = [(105, inspection(k, row[k])) for k in range(len(row))]
                tracker.sendto(slime.bundle(number, parts), address)
                recorder.write(port.read(1), float(t))
        assert listener.counts() == {}
        for k, event in enumerate(events):
            recorder.event(str(k), event, float(block.t[-1]))
    ours = processed(path, tmp_path / "ours")
    assert largest_difference(angles, ours) < 0.2
    require_same_ranges(native, path, tmp_path, within=0.2)


def outlets(
    pylsl: Any, recording: LoadedRecording, name: str
) -> Iterator[tuple[Any, dict[str, list[str]]]]:
    """A stream of all sensors' readings, its labels by segment, and a stream of markers."""
    points = recording.samples["imu"].stream.sensors
    labels = {p: [f"{p} {q}{a}" for q in "ga" for a in "xyz"] for p in points}
    info = pylsl.StreamInfo(name, "MoCap", 6 * len(points), 100.0, "float32", name)
    channels = info.desc().append_child("channels")
    for label in (one for names in labels.values() for one in names):
        channels.append_child("channel").append_child_value("label", label)
    yield pylsl.StreamOutlet(info), labels
    markers = pylsl.StreamInfo(f"{name} marks", "Markers", 1, 0.0, "string", f"{name} marks")
    yield pylsl.StreamOutlet(markers), {}


@pytest.mark.slow
def test_a_stream_of_lsl_with_markers_gives_the_angles_of_the_native_recording(
    native: Path, recording: LoadedRecording, angles: dict[str, np.ndarray], tmp_path: Path
) -> None:
    pylsl = pytest.importorskip("pylsl")
    block = recording.samples["imu"]
    (outlet, labels), (marks, _) = outlets(pylsl, recording, f"Elsewhere {tmp_path.name}")
    (tmp_path / "map.json").write_text(json.dumps(column_map(recording, labels)))
    name = outlet.get_info().name()
    url = f"lsl://{quote(name)}?map={quote(str(tmp_path / 'map.json'))}"
    rows = np.concatenate([readings(block, k) for k in range(len(labels))], axis=1)
    path = tmp_path / "lsl.mcap"
    with closing(open_source(url)) as port, Recorder(path, {}, time.monotonic()) as recorder:
        assert outlet.wait_for_consumers(10.0) and marks.wait_for_consumers(10.0)
        start = pylsl.local_clock() - float(block.t[-1])
        for event in recording.events:
            words = {"trial_type": event.trial_type, "duration": event.duration, **event.details}
            marks.push_sample([json.dumps(words)], start + event.onset)
        for t, row in zip(block.t, rows):
            outlet.push_sample(row.tolist(), start + float(t))
        until = time.monotonic() + 8.0
        while time.monotonic() < until:
            recorder.write(port.read(65536), time.monotonic())
    read = recordings.load(path)
    assert [e.trial_type for e in read.events] == [e.trial_type for e in recording.events]
    assert {len(b.t) for b in read.samples.values()} == {len(block.t)}
    ours = processed(path, tmp_path / "ours")
    # from the pose on: which 3 s of it are stillest may hang on a microsecond of its onset
    assert largest_difference(angles, ours, recording.events[0].end) < 0.2
    require_same_ranges(native, path, tmp_path, within=0.2)
