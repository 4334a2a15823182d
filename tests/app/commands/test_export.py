"""`handscope export --format NAME`: every format of the table, whole or not at all."""

import os
from pathlib import Path

import pytest

from handscope.app.cli import main
from handscope.sessions import motion_bids
from handscope.sessions.exports import FORMATS
from handscope.sessions.tables_io import writing
from tests.simulated import loaded, pose_and_wiggle

NEEDS = {"parquet": "pyarrow", "mcap-ros2": "mcap_ros2.writer"}


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "wiggle.zip"
    motion_bids.write(loaded(pose_and_wiggle("left")), path)
    return path


@pytest.mark.parametrize("name", ["opensim", "bvh", "redcap", "fhir", "mat"])
def test_a_format_is_written_where_it_was_asked_for(
    recording: Path, tmp_path: Path, name: str
) -> None:
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    place = tmp_path / f"result{FORMATS[name].ending}"
    words = ["export", str(recording), "--format", name, "--out", str(place), "--method", "m2"]
    assert main(words) == 0
    assert any(place.iterdir()) if not FORMATS[name].ending else place.stat().st_size > 1000


def test_the_contract_names_the_formats() -> None:
    contract = "bids opensim bvh glb c3d mat parquet fhir redcap mcap-ros2 jsonl"
    assert list(FORMATS) == contract.split()


@pytest.mark.parametrize(
    ("name", "out", "said"),
    [
        ("dicom", "x.dcm", "formats are bids"),
        ("glb", "nowhere/x.glb", "there is no folder"),
        ("glb", ".", "is a folder"),
        ("opensim", "taken", "is a file"),
    ],
)
def test_a_place_or_format_that_is_not_is_one_line_and_leaves_nothing(
    recording: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    name: str,
    out: str,
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("taken").write_text("mine")
    assert main(["export", str(recording), "--format", name, "--out", out]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert os.listdir() == ["taken"]


def test_a_write_that_fails_leaves_what_stood_there(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    place = tmp_path / "a.jsonl"
    place.write_text("earlier")
    monkeypatch.setattr(writing.os, "replace", full)
    words = ["export", str(recording), "--format", "jsonl", "--out", str(place), "--method", "m2"]
    assert main(words) == 2
    assert place.read_text() == "earlier"
    assert [p.name for p in tmp_path.iterdir()] == ["a.jsonl"]
