"""A recording simulated by a program that shares nothing with this one comes in as a table and gives the angles of its native recording."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.estimators.data.samples import ACC, GYR, Block
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.orientation import fusion
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import recordings
from handscope.sessions.motion_bids.writer import events_table
from tests.sessions.table_import.elsewhere import (
    largest_difference,
    lift,
    processed,
    require_same_ranges,
)
from tests.simulated import DEG, calibrated

pytestmark = pytest.mark.slow  # test_import.py holds the rule with recordings of this simulator


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return lift(tmp_path_factory.mktemp("elsewhere") / "recording")


def imported(folder: Path, recording: LoadedRecording, segments: dict[str, str]) -> Path:
    """Guess the map of log.csv, choose segments by the letters of columns as a person would, import."""
    assert main(["import", str(folder / "log.csv"), "--guess", str(folder / "map.json")]) == 0
    column_map = json.loads((folder / "map.json").read_text())
    names = (folder / "log.csv").read_text().splitlines()[0].split(";")
    column_map |= {"hand": recording.hand, "sensors": {}}
    for letter, point in segments.items():
        sensor = {"mounting": [float(x) for x in recording.mounting.get(point, (1, 0, 0, 0))]}
        for sign, quantity, unit in (
            ("1", "gyr", "deg/s"),
            ("2", "acc", "g"),
            ("3", "orientation", "1"),
        ):
            columns = sorted(n for n in names if n.startswith(f"{letter}{sign}"))
            if columns:
                sensor[quantity] = {"columns": columns, "unit": unit}  # type: ignore[assignment]
        column_map["sensors"][point] = sensor
    (folder / "map.json").write_text(json.dumps(column_map))
    begin = float(recording.samples["imu"].t[0])
    events = tuple(replace(e, onset=e.onset - begin) for e in recording.events)
    (folder / "events.tsv").write_bytes(events_table(events))
    words = ["import", str(folder / "log.csv"), "--map", str(folder / "map.json")]
    out = folder / "r.mcap"
    assert main([*words, "--events", str(folder / "events.tsv"), "--out", str(out)]) == 0
    return out


def log(path: Path, columns: dict[str, np.ndarray]) -> None:
    """Semicolons, decimal commas, columns in any order."""
    names = list(np.random.default_rng(5).permutation(list(columns)))
    rows = np.column_stack([columns[n] for n in names])
    lines = [";".join(f"{v:.7f}" for v in row).replace(".", ",") for row in rows]
    path.write_text("\n".join([";".join(names), *lines]) + "\n")


def _block(recording: LoadedRecording) -> tuple[Block, dict[str, str]]:
    block = recording.samples["imu"]
    return block, dict(zip("klmnopq", block.stream.sensors))


def test_a_german_table_gives_the_angles_of_the_native_recording(
    native: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = recordings.load(native)
    block, segments = _block(recording)
    columns = {"zeit": 1e3 * (block.t - block.t[0])}
    for k, letter in enumerate(segments):
        for sign, quantity, unit in (("1", GYR, DEG), ("2", ACC, GRAVITY)):
            values = (block.of(quantity)[:, k] / unit).T
            columns |= {f"{letter}{sign}{c}": v for c, v in zip("uvw", values)}
    log(tmp_path / "log.csv", columns)
    out = imported(tmp_path, recording, segments)
    words = capsys.readouterr().out
    assert "look like gyr in deg/s: say which segment" in words and "taken as g" in words
    ours, theirs = processed(out, tmp_path / "a"), processed(native, tmp_path / "b")
    assert largest_difference(theirs, ours) < 0.2
    require_same_ranges(native, out, tmp_path, within=0.2)


def test_orientations_alone_give_the_angles_of_the_native_recording(
    native: Path, tmp_path: Path
) -> None:
    """Of a device that knows its gyroscopes' biases; from the pose on."""
    recording = recordings.load(native)
    block, segments = _block(recording)
    known = calibrated(replace(recording, samples={"imu": block}))  # type: ignore[arg-type]
    state = fusion.start(block.stream, {}, known.gyr_bias)
    state, part = fusion.step(fusion.FusionParams(), state, block)
    _, rest = fusion.finish(fusion.FusionParams(), state)
    q = np.concatenate([part.q_GS, rest.q_GS])
    columns = {"zeit": 1e3 * (block.t - block.t[0])}
    for k, letter in enumerate(segments):
        columns |= {f"{letter}3{c}": v for c, v in zip("abcd", q[:, k].T)}
    log(tmp_path / "log.csv", columns)
    out = imported(tmp_path, recording, segments)
    ours, theirs = processed(out, tmp_path / "a"), processed(native, tmp_path / "b")
    end = recording.events[0].end
    assert largest_difference(theirs, ours, end) < 1.0
    require_same_ranges(native, out, tmp_path, within=1.0)
