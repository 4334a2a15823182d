"""`handscope simulate`: tasks, experiments and captured motion, with magnetometers and losses as asked."""

from pathlib import Path

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.estimators.data.samples import GYR, MAG
from handscope.estimators.methods import m2
from handscope.estimators.pipeline.process import process
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import recordings as formats_recordings

PILLOW = Path(__file__).parents[2] / "estimators" / "simulation" / "pillow_grasp.tsv.gz"


def _made(folder: Path, *words: str) -> LoadedRecording:
    path = folder / f"{abs(hash(words))}.zip"
    assert main(["simulate", *words, "--out", str(path)]) == 0
    loaded = formats_recordings.load(path)
    assert isinstance(loaded, LoadedRecording)
    return loaded


def _refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(["simulate", *words]) != 0
    return capsys.readouterr().err


def test_an_experiment_is_a_task_like_any_other(tmp_path: Path) -> None:
    made = _made(tmp_path, "P3 F1-F2", "--seed", "3", "--pose-error", "2.5")
    assert [e.details.get("task_name") for e in made.events if e.trial_type == "task"] == [
        "P3",
        "P3",
    ]
    assert "initial_pose" in {e.trial_type for e in made.events}


@pytest.mark.slow
def test_a_functional_calibration_can_be_recorded_with_sensors_put_on_anyhow(
    tmp_path: Path,
) -> None:
    made = _made(
        tmp_path,
        "functional_calibration",
        "--misalignment",
        "30",
        "--pose-error",
        "2.5",
        "--seed",
        "4",
        "--hand",
        "right",
    )
    assert {"initial_pose", "flat_hand", "flexion_mcp", "figure_eight", "task"} <= {
        e.trial_type for e in made.events
    }
    found = process(m2, m2.Params(), made).calibrations[0]
    assert found.description == "initial pose and functional calibration"
    assert 10 < max(np.degrees(q.misalignment) for q in found.quality.values()) < 35


def test_the_disturbed_setting_changes_the_magnetometers_and_nothing_else(tmp_path: Path) -> None:
    calm, office = (
        _made(tmp_path, "A-F2", "--setting", setting, "--seed", "2") for setting in "12"
    )
    np.testing.assert_array_equal(calm.samples["imu"].values, office.samples["imu"].values)
    first, second = (
        np.linalg.norm(made.samples["mag"].of(MAG), axis=-1) for made in (calm, office)
    )
    assert np.abs(second - first).max() > 1e-6
    assert calm.geometry == office.geometry


def test_a_failing_link_loses_samples_and_gives_the_forearm_a_clock_of_its_own(
    tmp_path: Path,
) -> None:
    made = _made(tmp_path, "rest", "--link", "failing")
    assert 0.02 < np.isnan(made.samples["imu"].values).mean() < 0.2
    assert made.samples["forearm"].stream.sensors == ("forearm",)


def test_a_preset_has_its_own_noise(tmp_path: Path) -> None:
    noise = []
    for preset in ("MPU-9250", "LSM330DLC/HMC5983"):
        block = _made(tmp_path, "rest", "--preset", preset).samples["imu"].between(8.0, 15.0)
        noise.append(np.diff(block.of(GYR), axis=0).std())
    assert noise[1] / noise[0] == pytest.approx(
        0.03 / 0.01, rel=0.1
    )  # of the data sheets, deg/s/sqrt(Hz)


def test_the_hand_moves_as_a_captured_one_did(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = _made(tmp_path, "captured", "--markers", str(PILLOW), "--hand", "right")
    assert "markers followed within" in capsys.readouterr().out
    assert made.duration > 18


def test_what_cannot_be_simulated_is_refused_with_what_can(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ("--out", str(tmp_path / "x.zip"))
    assert "experiments are A-F1" in _refused(capsys, "juggle", *out)
    assert "--pose-error is for experiments" in _refused(capsys, "rest", "--pose-error", "2", *out)
    assert "outside 0 to 30 deg" in _refused(capsys, "A-F1", "--pose-error", "-1", *out)
    assert "captured needs the markers" in _refused(capsys, "captured", *out)
    assert "cannot be read" in _refused(
        capsys, "captured", "--markers", str(tmp_path / "none.tsv"), *out
    )
    (tmp_path / "words.tsv").write_text("MARKER_NAMES\ta\nFrame\tTime\ta X\n1\tnow\t3\n")
    assert "no Qualisys export" in _refused(
        capsys, "captured", "--markers", str(tmp_path / "words.tsv"), *out
    )
    (tmp_path / "few.tsv").write_text(
        "MARKER_NAMES\ta\nFrame\tTime\ta X\ta Y\ta Z\n1\t0\t3\t3\t3\n2\t0.1\t3\t3\t3\n"
    )
    assert "has no marker 'hand_top'" in _refused(
        capsys, "captured", "--markers", str(tmp_path / "few.tsv"), *out
    )
