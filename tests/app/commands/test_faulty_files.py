"""Files with a fault through info, process and assess: exit codes, findings by their codes, flags and grades."""

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.estimators.data.samples import ACC, Block, Event
from handscope.estimators.data.trajectory import Flag
from handscope.sessions import motion_bids
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.files.sensor_corrections import CORRECTION, correct_block, parse
from handscope.sessions.formats import recordings as formats_recordings
from tests.schedule import swept

SENSOR = "index_middle"
SIGN = f"gyroscope {SENSOR} 1 0 0 0 1 0 0 0 -1"


@pytest.fixture(scope="module")
def intact(tmp_path_factory: pytest.TempPathFactory) -> LoadedRecording:
    path = tmp_path_factory.mktemp("intact") / "fist.zip"
    assert main(["simulate", "rom_fist", "--hand", "left", "--out", str(path)]) == 0
    return formats_recordings.load(path)


def negated(block: Block) -> Block:
    return correct_block(block, [parse(SIGN)])


def exchanged(block: Block) -> Block:
    return correct_block(block, [parse(f"exchange {SENSOR} index_distal")])


def turned(block: Block) -> Block:
    """A sensor mounted a right angle about its x axis from where it should be."""
    values, names = block.values.copy(), block.stream.sensors
    if SENSOR in names:
        one = values[:, names.index(SENSOR)].reshape(len(values), -1, 3)
        values[:, names.index(SENSOR)] = (one[..., [0, 2, 1]] * [1, 1, -1]).reshape(len(values), -1)
    return replace(block, values=values)


def in_g(block: Block) -> Block:
    values = block.values.copy()
    if ACC in block.stream.quantities:
        values[..., block.stream.axes(ACC)] /= 9.81
    return replace(block, values=values)


FAULTS: dict[str, tuple[Callable[[Block], Block], str]] = {
    "sign": (negated, "sensor.gyroscope_sign"),
    "exchange": (exchanged, "sensors.exchanged_angles"),
    "g": (in_g, "file.accelerometer_unit"),
}


def written(
    recording: LoadedRecording, change: Callable[[Block], Block], path: Path, *events: Event
) -> str:
    spoilt = replace(
        recording,
        samples={name: change(b) for name, b in recording.samples.items()},
        events=(*recording.events, *events),
    )
    motion_bids.write(spoilt, path)
    return str(path)


@pytest.mark.parametrize("fault", swept(FAULTS, kept=tuple(FAULTS)[:1]))
def test_info_lists_what_is_wrong_by_its_code_and_with_its_sensors(
    intact: LoadedRecording, tmp_path: Path, capsys: pytest.CaptureFixture[str], fault: str
) -> None:
    change, code = FAULTS[fault]
    path = written(intact, change, tmp_path / "faulty")
    assert main(["info", path, "--json", str(tmp_path / "info.json")]) == 0
    said = capsys.readouterr().out
    table = json.loads((tmp_path / "info.json").read_text())
    found = {f["code"]: f for f in table["findings"]}
    assert code in found and SENSOR in found[code]["sensors"]
    assert f"{found[code]['severity']}: {found[code]['sentence']}" in said
    assert (found[code]["spans"][0][0] or 0.0) <= 1.0 and table["hand"] == "left"


def test_info_finds_nothing_in_an_intact_file(intact: LoadedRecording, tmp_path: Path) -> None:
    path = written(intact, lambda b: b, tmp_path / "intact")
    assert main(["info", path, "--json", str(tmp_path / "info.json")]) == 0
    assert json.loads((tmp_path / "info.json").read_text())["findings"] == []


def test_a_faulty_file_is_processed_with_flags_and_no_figure_on_its_sensor_is_good(
    intact: LoadedRecording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(intact, negated, tmp_path / "faulty")
    words = [path, "--method", "m2", "--out"]
    assert main(["process", *words, str(tmp_path / "derivative")]) == 0
    assert "wrong sign" in capsys.readouterr().out
    sidecar, flags = _derivative(tmp_path / "derivative")
    assert [f["code"] for f in sidecar["findings"]] == ["sensor.gyroscope_sign"]
    assert np.mean((flags[SENSOR] & Flag.FAULTY) != 0) > 0.9
    assert not ((flags["ring_middle"] & Flag.FAULTY) != 0).any()
    assert main(["assess", *words, str(tmp_path / "figures")]) == 0
    grades = _grades(tmp_path / "figures")
    assert "good" not in {grade for name, grade in grades.items() if "index_pip" in name}
    assert "good" in {grade for name, grade in grades.items() if "ring_pip" in name}


def test_what_all_accelerometers_have_is_said_once(
    intact: LoadedRecording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(intact, in_g, tmp_path / "faulty")
    assert main(["process", path, "--method", "m2", "--out", str(tmp_path / "derivative")]) == 0
    warnings = [w for w in capsys.readouterr().out.splitlines() if w.startswith("warning")]
    assert sum("this looks like g" in w for w in warnings) == 1
    assert not any("check its calibration" in w for w in warnings)


def test_a_sensor_turned_by_a_right_angle_ends_with_exit_code_2_and_no_good_figure(
    intact: LoadedRecording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(intact, turned, tmp_path / "faulty")
    out = str(tmp_path / "figures")
    assert main(["assess", path, "--method", "m2", "--out", out]) == 2
    captured = capsys.readouterr()
    assert "turned by about 90 deg" in captured.out
    assert SENSOR in captured.err and captured.err.count("\n") == 1
    grades = _grades(tmp_path / "figures")
    assert "good" not in {grade for name, grade in grades.items() if "index_pip" in name}


def test_a_recording_corrected_while_it_was_made_gives_the_result_of_an_intact_one(
    intact: LoadedRecording, tmp_path: Path
) -> None:
    agreed = Event(12.0, 0.0, CORRECTION, {CORRECTION: SIGN})
    tables = {}
    for name, change, events in (("clean", lambda b: b, ()), ("live", negated, (agreed,))):
        path = written(intact, change, tmp_path / name, *events)
        out = tmp_path / f"{name}-derivative"
        assert main(["process", path, "--method", "m2", "--out", str(out)]) == 0
        tables[name] = np.loadtxt(next(out.rglob("*_motion.tsv")), delimiter="\t")
        sidecar, _ = _derivative(out)
        assert sidecar["findings"] == []
        said = any("as a correction in the recording says" in w for w in sidecar["warnings"])
        assert said == (name == "live")
    np.testing.assert_array_equal(tables["live"], tables["clean"])


def _derivative(folder: Path) -> tuple[dict, dict[str, np.ndarray]]:  # type: ignore[type-arg]
    """Sidecar, and the flags of every segment."""
    motion = next(folder.rglob("*_motion.tsv"))
    sidecar = json.loads(motion.with_suffix(".json").read_text())
    with next(folder.rglob("*_channels.tsv")).open() as file:
        names = [row["name"] for row in csv.DictReader(file, delimiter="\t")]
    values = np.loadtxt(motion, delimiter="\t", ndmin=2)
    return sidecar, {
        name.removesuffix("_flags"): np.nan_to_num(values[:, k]).astype(int)
        for k, name in enumerate(names)
        if name.endswith("_flags")
    }


def _grades(folder: Path) -> dict[str, str]:
    lines = (folder / "figures.csv").read_text().splitlines()
    table = csv.DictReader(line for line in lines if not line.startswith("#"))
    return {row["name"]: row["grade"] for row in table}


def test_info_says_what_the_movement_is_too_little_to_test(
    intact: LoadedRecording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The three seconds of the initial pose: nothing moves in them."""
    quiet = {n: b.between(b.t[0], b.t[0] + 3.0) for n, b in intact.samples.items()}
    path, table = tmp_path / "quiet.zip", tmp_path / "info.json"
    motion_bids.write(replace(intact, samples=quiet, events=()), path)
    assert main(["info", str(path), "--json", str(table)]) == 0
    assert (
        "info: Not tested, as the movement is too little for it: strips of"
        in capsys.readouterr().out
    )
    assert "index_middle" in json.loads(table.read_text())["untested"]["gyroscopes"]
