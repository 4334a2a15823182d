"""Sample recordings: made from seeds, small, with their truth, and what is wrong with one of them is found."""

import json
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest

import handscope as hs
from handscope.app.analysis.samples import BROKEN, LARGEST
from handscope.app.cli import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("samples")
    assert main(["samples", "--out", str(folder)]) == 0
    return folder


@pytest.mark.parametrize("name", hs.samples.SAMPLES)
def test_each_is_small_says_its_licence_and_has_its_truth(folder: Path, name: str) -> None:
    path = folder / f"{name}.zip"
    assert path.stat().st_size < LARGEST
    with zipfile.ZipFile(path) as archive:
        described = json.loads(archive.read("dataset_description.json"))
        assert (
            described["License"] == "CC0"
            and "Nobody was measured" in archive.read("README").decode()
        )
    recording = hs.load(path)
    assert recording.source["device"] == "simulated"
    assert hs.truth(path).angles().index[-1] == pytest.approx(recording.duration, abs=0.1)


def test_the_same_seed_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    again = hs.samples.make("tapping_slow", tmp_path)
    assert again.read_bytes() == (folder / "tapping_slow.zip").read_bytes()


def test_the_three_tappers_differ_as_their_truth_does(folder: Path) -> None:
    names = ("tapping_fast", "tapping_slow", "tapping_small")
    found = [hs.process(folder / f"{n}.zip", method="m2").measures("tapping") for n in names]
    rates = [float(f.set_index("name").value["tapping_rate"]) for f in found]
    np.testing.assert_allclose(rates, [3.2, 1.4, 2.4], atol=0.05)


def test_what_is_wrong_with_the_faulty_one_is_found(folder: Path) -> None:
    recording = hs.load(folder / "faults.zip")
    (block,) = recording.samples.values()
    assert np.isnan(block.values).any()
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        hs.process(recording, method="m2")
    assert any(str(w.message).startswith(f"{BROKEN[0]}: the x axis") for w in warned)


def test_a_name_that_is_none_is_refused_and_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["samples", "tapping_fast", "nonsense", "--out", str(tmp_path / "new")]) == 2
    assert "samples are tapping_fast" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()
