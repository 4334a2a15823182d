"""What processing writes: the columns of the contract, what it rests on, readable by any program of the field."""

import io
import json
from pathlib import Path

import numpy as np
import pytest

from handscope.estimators.hand.anatomy import DOF_NAMES, FINGERS, SEGMENT, SEGMENTS
from handscope.estimators.methods import m2
from handscope.estimators.pipeline.process import process
from handscope.sessions import motion_bids
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import derivative
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.motion_bids.truth import truth_files
from tests.bids import Files, folder
from tests.sessions.motion_bids.test_bids_validator import faults
from tests.simulated import in_strips, loaded, with_samples


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> LoadedRecording:
    """A recording without the thumb's strip."""
    whole = in_strips("right")
    part = with_samples(whole, {name: b for name, b in whole.samples.items() if name != "thumb"})
    path = tmp_path_factory.mktemp("derived") / "a.zip"
    motion_bids.write(loaded(part), path, subject="07", task="wiggle", session="02")
    return formats_recordings.load(path)


@pytest.fixture(scope="module")
def files(opened: LoadedRecording) -> Files:
    made = derivative.tree(
        process(m2, m2.Params(), opened), opened, "m2", m2.Params(tau_acc=2.5), "1.2.3"
    )
    return {name: bytes(data) for name, data in made.items()}


BASE = "sub-07/ses-02/motion/sub-07_ses-02_task-wiggle_tracksys-handscope_desc-m2"


def _table(files: Files) -> dict[str, np.ndarray]:
    names = [
        line.split("\t")[0] for line in files[f"{BASE}_channels.tsv"].decode().splitlines()[1:]
    ]
    table = np.loadtxt(io.BytesIO(files[f"{BASE}_motion.tsv"].replace(b"n/a", b"nan")), ndmin=2)
    assert table.shape[1] == len(names)
    return dict(zip(names, table.T))


def test_the_columns_are_those_of_the_contract(files: Files) -> None:
    columns = _table(files)
    expected = ["time", *DOF_NAMES]
    expected += [f"{finger}_tip_{c}" for finger in FINGERS[1:] for c in "xyz"]
    measured = [s for s in SEGMENTS if not s.startswith("thumb")]
    expected += [f"{segment}_quat_{c}" for segment in measured for c in "wxyz"]
    assert [name for name in columns if not name.endswith("_flags")] == expected
    kinds = [line.split("\t") for line in files[f"{BASE}_channels.tsv"].decode().splitlines()[1:]]
    assert {(k[2], k[4]) for k in kinds} == {
        ("LATENCY", "s"),
        ("JNTANG", "rad"),
        ("POS", "m"),
        ("ORNT", "n/a"),
        ("MISC", "n/a"),
    }


def test_the_numbers_are_the_trajectorys_to_the_last_bit(
    files: Files, opened: LoadedRecording
) -> None:
    moved, columns = process(m2, m2.Params(), opened).trajectory, _table(files)
    np.testing.assert_array_equal(columns["time"], moved.t)
    np.testing.assert_array_equal(
        columns["time"], opened.samples["hand"].t
    )  # one row a sample of the fastest stream
    np.testing.assert_array_equal(columns["index_pip_flexion"], moved.angles[:, 5, 0])
    np.testing.assert_array_equal(columns["little_tip_z"], moved.tips[:, 4, 2])
    np.testing.assert_array_equal(columns["forearm_quat_w"], moved.q_GS[:, SEGMENT["forearm"], 0])
    assert np.isnan(columns["thumb_ip_flexion"]).all()


def test_the_sidecar_says_how_it_was_made(files: Files, opened: LoadedRecording) -> None:
    about = json.loads(files[f"{BASE}_motion.json"])
    assert (about["method"], about["software_version"], about["MeasuredHand"]) == (
        "m2",
        "1.2.3",
        "right",
    )
    assert about["parameters"]["tau_acc"] == 2.5
    assert about["input_checksum"] == opened.checksum
    assert about["SamplingFrequency"] == pytest.approx(100.0)
    assert about["calibration_quality"]["hand"]["tilt_change"] == pytest.approx(0.0, abs=1e-6)
    found = json.loads(files[f"{BASE}_calibration.json"])
    assert np.linalg.norm(found["sensor_to_segment"]["index_distal"]["q_BS"]) == pytest.approx(1.0)
    assert (
        found["segment_lengths"]["index_distal"]["value"] == opened.geometry.lengths["index_distal"]
    )
    assert len(found["gyr_bias"]["forearm"]) == 3


def test_the_validator_minds_nothing_but_the_names_that_the_contract_asks_for(
    tmp_path: Path, files: Files
) -> None:
    """The method in `desc-` and a calibration.json beside it: the standard knows neither for motion. Columns and sidecar are in order."""
    minded = {fault.split()[0] for fault in faults(folder(files, tmp_path))}
    assert minded == {"ENTITY_NOT_IN_RULE", "NOT_INCLUDED", "SIDECAR_WITHOUT_DATAFILE"}
    named = {
        name.replace("_desc-m2", ""): data
        for name, data in files.items()
        if "calibration" not in name
    }
    assert faults(folder(named, tmp_path / "named")) == []


def test_the_truth_of_a_simulation_lies_beside_its_recording_and_is_valid(tmp_path: Path) -> None:
    recording = loaded(in_strips("left"))
    motion_bids.write(
        recording,
        tmp_path,
        task="wiggle",
        extra=truth_files(in_strips("left").truth, recording, "01", "wiggle", "1.2.3"),
    )
    assert set(motion_bids.load(tmp_path).samples) == set(recording.samples)
    assert (
        tmp_path
        / "derivatives/truth/sub-01/motion/sub-01_task-wiggle_tracksys-truth_desc-truth_motion.tsv"
    ).exists()
    assert faults(tmp_path) == []
