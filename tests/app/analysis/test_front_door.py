"""`import handscope` as a scientist wished for it: arrays in, tables out, nothing to guess."""

import doctest
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import handscope as hs
from handscope.app.analysis import recording as recording_module
from handscope.app.cli import main
from handscope.app.language import ENGLISH
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import codes_of

pytest.importorskip("pandas")
pytestmark = pytest.mark.filterwarnings("ignore:.*:UserWarning")


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> str:
    place = tmp_path_factory.mktemp("front") / "tapping.zip"
    assert main(["simulate", "tapping", "--out", str(place), "--seed", "3"]) == 0
    return str(place)


@pytest.fixture(scope="module")
def arrays(path: str) -> Any:
    """The same samples as plain arrays in deg/s and g, with pose and task as somebody notes them."""
    block = hs.load(path).samples["imu"]
    rec = hs.from_arrays(
        block.t,
        np.degrees(block.of("gyr")),
        block.of("acc") / 9.80665,
        segments=block.stream.sensors,
        hand="left",
        gyr_unit="deg/s",
        acc_unit="g",
    )
    rec.add_pose(1.5, 3.0, thumb_cmc_deg=(0, -45, 60))
    rec.add_task("tapping", 7.0, 14.8)
    return rec


@pytest.fixture(scope="module")
def moved(arrays: Any) -> Any:
    return hs.process(arrays, method="ekf")


def test_arrays_in_other_units_give_angles_near_the_truth(moved: Any, path: str) -> None:
    angles, truth = moved.angles(unit="deg"), hs.truth(path).angles(unit="deg")
    assert list(angles) == list(truth)
    assert angles.index.name == "time"
    assert np.abs(angles["index_pip_flexion"] - truth["index_pip_flexion"]).max() < 5
    np.testing.assert_allclose(moved.angles(unit="rad") * 180 / np.pi, angles)
    sd = moved.angles_sd(unit="deg")
    assert 0 < sd["index_pip_flexion"].iloc[-1] < 10


def test_measures_lengths_and_what_to_cite(moved: Any) -> None:
    taps = moved.measures("tapping").set_index("name")
    assert 2 < taps.loc["tapping_rate", "value"] < 3
    assert hs.measure(moved, "tapping").equals(moved.measures("tapping"))
    assert 20 < moved.segment_lengths(unit="mm").loc["index_proximal", "length"] < 70
    assert "method ekf" in moved.cite()
    assert "Kortier" in moved.cite()


def test_strings_and_paths_are_taken_alike_and_the_result_keeps_its_parts(path: str) -> None:
    a, b = hs.process(path, "m2"), hs.process(Path(path), method="m2")
    np.testing.assert_array_equal(a.trajectory.angles, b.trajectory.angles)
    assert a.calibrations[0].hand == "left"
    with pytest.raises(InputError, match="ekf"):
        a.angles_sd()


def test_each_code_is_warned_of_once(path: str) -> None:
    """Three middle sensors with one axis negated: what is said of each stands in the result, once a code in the warnings."""
    block = hs.load(path).samples["imu"]
    gyr = np.degrees(block.of("gyr"))
    middle = [k for k, s in enumerate(block.stream.sensors) if s.endswith("_middle")][:3]
    gyr[:, middle] *= [1, 1, -1]
    rec = hs.from_arrays(
        block.t, gyr, block.of("acc"), segments=block.stream.sensors, hand="left", gyr_unit="deg/s"
    )
    rec.add_pose(1.5, 3.0, thumb_cmc_deg=(0, -45, 60))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        result = hs.process(rec, method="m2")
    texts = [w.message.args[0] for w in said if isinstance(w.message, UserWarning)]
    codes = [codes_of(text) for text in texts if codes_of(text)]
    assert codes and len(codes) == len(set(codes))
    every = [codes_of(w) for w in result.warnings]
    assert set(codes) == {c for c in every if c} and len(every) > len(codes)


def test_findings_come_as_a_table(arrays: Any) -> None:
    assert list(arrays.check()) == ["severity", "code", "sensors", "message", "p_value"]


def test_bids_is_not_written_where_a_file_is(arrays: Any, tmp_path: Path) -> None:
    (tmp_path / "mydata").write_text("mine")
    with pytest.raises(InputError, match="mydata is a file; this format is written to a folder"):
        arrays.save_bids(tmp_path / "mydata")
    with pytest.raises(InputError, match="cannot be written to: Not a directory"):
        arrays.save_bids(tmp_path / "mydata" / "within")
    assert (tmp_path / "mydata").read_text() == "mine"


def test_bids_report_and_exports_are_written(moved: Any, arrays: Any, tmp_path: Path) -> None:
    arrays.save_bids(str(tmp_path / "mydata"))
    again = hs.load(tmp_path / "mydata")
    assert [e.trial_type for e in again.events] == ["initial_pose", "task"]
    moved.report(tmp_path / "r.html")
    assert ENGLISH.say("no_date") in (tmp_path / "r.html").read_text()
    assert moved.export("jsonl", tmp_path / "a.jsonl") == []
    assert (tmp_path / "a.jsonl").stat().st_size > 1000


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"gyr_unit": "rpm"}, "gyr_unit is 'rpm'; units are rad/s, deg/s"),
        ({"hand": "both"}, "left or right"),
        ({"segments": ["hand", "nose"]}, "there is no segment 'nose'"),
        ({"segments": ["hand"]}, "has the shape"),
        ({"t": [0.0, 0.0, 1.0]}, "later than the one before"),
        ({"t": [0.0, 10.0, 20.0]}, "0.1 samples a second; is the unit of the time right?"),
        ({"t": [0.0, 1e-5, 2e-5]}, r"1e\+05 samples a second"),
        (
            {"t": np.array(["NaT", "2026-01-01", "2026-01-02"], "datetime64[s]")},
            "one time a sample",
        ),
    ],
)
def test_arrays_that_do_not_fit_are_refused_with_what_to_do(
    change: dict[str, Any], said: str
) -> None:
    zero = np.zeros((3, 2, 3))
    given: dict[str, Any] = {"t": [0.0, 0.1, 0.2], "gyr": zero, "acc": zero}
    given |= {"segments": ["hand", "index_proximal"], "hand": "left"}
    with pytest.raises(InputError, match=said):
        hs.from_arrays(**{**given, **change})


def test_clock_times_count_from_the_first_sample() -> None:
    zero = np.zeros((3, 1, 3))
    for unit in ("ms", "ns"):
        t = np.array(["2026-01-01T10:00:00.000", "2026-01-01T10:00:00.010"], f"datetime64[{unit}]")
        rec = hs.from_arrays(np.append(t, t[1] + (t[1] - t[0])), zero, zero, ["hand"], "left")
        np.testing.assert_allclose(rec.samples["arrays"].t, [0.0, 0.01, 0.02], atol=1e-12)


def test_infinite_values_are_missing_samples_and_said_once() -> None:
    gyr = np.zeros((300, 2, 3))
    gyr[100], gyr[200, 1, 0] = np.inf, -np.inf
    t, names = np.arange(300) / 100, ["hand", "index_proximal"]
    rec = hs.from_arrays(t, gyr, np.full(gyr.shape, 5.7), names, "left")
    assert np.isnan(rec.samples["arrays"].of("gyr")[100]).all()
    (warning,) = rec.warnings
    assert warning == "values that are infinite: 7 (hand, index_proximal); they count as missing"


def test_events_outside_the_recording_and_unknown_names_are_refused(arrays: Any, path: str) -> None:
    with pytest.raises(InputError, match="not within the recording"):
        arrays.add_task("tapping", 20.0, 30.0)
    with pytest.raises(InputError, match="no angle of a pose"):
        arrays.add_pose(1.0, 2.0, nose_deg=3)
    with pytest.raises(InputError, match="there is no method"):
        hs.process(path, method="magic")
    with pytest.raises(InputError, match="no task"):
        hs.process(path, method="m2").measures("rom")


def test_a_recording_without_truth_is_refused(arrays: Any, tmp_path: Path) -> None:
    arrays.save_bids(tmp_path / "plain.zip")
    with pytest.raises(InputError, match="no truth"):
        hs.truth(tmp_path / "plain.zip")


def test_examples_in_docstrings_run() -> None:
    tried = doctest.testmod(recording_module)
    assert tried.attempted > 0
    assert tried.failed == 0
