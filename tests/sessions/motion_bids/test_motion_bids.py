"""Motion-BIDS written and read: equal numbers, converted units, missing values, chosen recordings."""

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from handscope.estimators.data.samples import ACC, FORCE, GYR, MAG, TORQUE, Event
from handscope.sessions import motion_bids
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import reader
from handscope.sessions.tables_io.number_table import NumberTable
from tests.bids import (
    BASE,
    PLATE,
    Files,
    N,
    dataset,
    folder,
    packed,
    recording,
    with_line,
    with_sidecar,
    with_text,
    without,
)

TIDY = (Event(0.05, 0.1, "initial_pose", {"thumb_cmc_flexion_deg": 0.0, "thumb_cmc_deviation_deg": -45.0, "thumb_cmc_pronation_deg": 60.0}),
        Event(0.15, 0.1, "task", {"task_name": "rom"}),
        Event(0.2, 0.0, "annotation", {"note": "a tab, a line break and ü"}))  # fmt: skip


def _loaded(files: Files, place: Path) -> LoadedRecording:
    return motion_bids.load(folder(files, place))


@pytest.mark.parametrize("name", ["folder", "recording.zip"])
def test_what_is_written_is_read_back_to_the_last_bit(tmp_path: Path, name: str) -> None:
    written = recording()
    motion_bids.write(written, tmp_path / name, session="02")
    read = motion_bids.load(tmp_path / name)
    assert set(read.samples) == set(written.samples)
    for system, block in written.samples.items():
        np.testing.assert_array_equal(read.samples[system].t, block.t)
        np.testing.assert_array_equal(read.samples[system].values, block.values)
        assert read.samples[system].stream.sensors == block.stream.sensors
        assert read.samples[system].stream.quantities == block.stream.quantities
        assert read.samples[system].stream.rate == block.stream.rate
    assert (read.hand, read.geometry) == (written.hand, written.geometry)
    assert read.events == TIDY
    assert read.warnings == ()
    assert read.plate == PLATE
    for point, q in written.mounting.items():
        np.testing.assert_allclose(read.mounting[point], q, atol=1e-15)
    assert read.source["recording"] == "sub-01/ses-02/motion/sub-01_ses-02_task-hand"
    assert read.source.get("device") == written.source.get("device"), (
        "no tracking system's name passes for the device's"
    )


def test_folder_and_zip_of_the_same_recording_have_the_same_checksum(tmp_path: Path) -> None:
    for name in ("folder", "recording.zip"):
        motion_bids.write(recording(), tmp_path / name)
    a, b = (motion_bids.load(tmp_path / name).checksum for name in ("folder", "recording.zip"))
    assert a == b
    assert len(a) == 64


def test_the_same_recording_makes_the_same_zip(tmp_path: Path) -> None:
    for name in ("a.zip", "b.zip"):
        motion_bids.write(recording(), tmp_path / name)
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()


def test_a_zip_may_wrap_the_dataset_in_a_folder_and_hold_a_systems_own_files(
    tmp_path: Path,
) -> None:
    files = {f"my data/{name}": data for name, data in dataset().items()}
    files |= {f"__MACOSX/my data/{name}": b"\0\1" for name in dataset()} | {
        "my data/.DS_Store": b"\0"
    }
    (tmp_path / "a.zip").write_bytes(packed(files))
    assert set(motion_bids.load(tmp_path / "a.zip").samples) == set(recording().samples)


@pytest.mark.parametrize(
    ("system", "si", "unit", "factor", "quantity"),
    [
        ("index", "rad/s", "deg/s", np.pi / 180, GYR),
        ("index", "rad/s", "°/s", np.pi / 180, GYR),
        ("index", "m/s^2", "m/s²", 1.0, ACC),
        ("mag", "T", "uT", 1e-6, MAG),
        ("mag", "T", "µT", 1e-6, MAG),
        ("mag", "T", "μT", 1e-6, MAG),
    ],
)
def test_units_are_converted(
    tmp_path: Path, system: str, si: str, unit: str, factor: float, quantity: str
) -> None:
    files = with_text(
        dataset(),
        f"_tracksys-{system}_channels.tsv",
        lambda text: text.replace(f"\t{si}\t", f"\t{unit}\t"),
    )
    read, plain = _loaded(files, tmp_path).samples[system], recording().samples[system]
    np.testing.assert_array_equal(read.of(quantity), plain.of(quantity) * factor)


@pytest.mark.parametrize("word", ["n/a", "NaN", "nan", "inf", "-Infinity", "1e999"])
def test_missing_values_are_nan(tmp_path: Path, word: str) -> None:
    files = with_line(
        dataset(),
        "_tracksys-hand_motion.tsv",
        5,
        lambda line: "\t".join([line.split("\t")[0], word, *line.split("\t")[2:]]),
    )
    values = _loaded(files, tmp_path).samples["hand"].values
    assert np.argwhere(np.isnan(values)).tolist() == [[4, 0, 0]]


@pytest.mark.parametrize("form", ["\r\n", "\ufeff"])
def test_line_ends_and_byte_order_marks_of_other_systems_are_read(
    tmp_path: Path, form: str
) -> None:
    files = {
        name: (
            data.decode().replace("\n", form) if form == "\r\n" else form + data.decode()
        ).encode()
        for name, data in dataset().items()
    }
    read = _loaded(files, tmp_path)
    np.testing.assert_array_equal(read.samples["index"].values, recording().samples["index"].values)
    assert read.events == TIDY


def test_columns_may_come_in_any_order(tmp_path: Path) -> None:
    files, order = dataset(), np.random.default_rng(1).permutation(19)
    motion, channels = f"{BASE}_tracksys-index_motion.tsv", f"{BASE}_tracksys-index_channels.tsv"
    rows = [line.split("\t") for line in files[motion].decode().splitlines()]
    header, *told = files[channels].decode().splitlines()
    files[motion] = "\n".join("\t".join(row[k] for k in order) for row in rows).encode()
    files[channels] = "\n".join([header, *(told[k] for k in order)]).encode()
    np.testing.assert_array_equal(
        _loaded(files, tmp_path).samples["index"].values, recording().samples["index"].values
    )


def test_without_latency_the_sampling_frequency_makes_the_times(tmp_path: Path) -> None:
    files = with_text(
        dataset(), "_tracksys-hand_channels.tsv", lambda text: text.replace("LATENCY", "OTHER")
    )
    block = _loaded(files, tmp_path).samples["hand"]
    np.testing.assert_array_equal(block.t, np.arange(N) / 100)
    assert block.stream.rate == 100.0


def test_time_stamps_count_where_the_sampling_frequency_says_otherwise(tmp_path: Path) -> None:
    read = _loaded(with_sidecar(dataset(), "hand", SamplingFrequency=128.0), tmp_path)
    assert read.samples["hand"].stream.rate == pytest.approx(100.0)
    assert any("tracksys-hand" in w and "128 Hz" in w and "100 Hz" in w for w in read.warnings)


@pytest.mark.parametrize(
    ("rate", "told"), [(128.0, 128.0), (128.0, None), (99.0, 100.0), (300.0, 300.0)]
)
def test_the_rate_is_that_of_the_time_stamps_though_they_are_rounded_and_samples_lost(
    tmp_path: Path, rate: float, told: float | None
) -> None:
    """Angular rates are integrated with it: 1 % of error in the rate is 0.9 deg in a movement of 90."""
    t = np.round(np.delete(np.arange(400) / rate, np.r_[100:110, 200]), 3)
    hand = recording().samples["hand"]
    block = replace(hand, t=t, values=np.ones((len(t), 1, 6)))
    files = with_sidecar(
        dataset(replace(recording(), samples={"hand": block})), "hand", SamplingFrequency=told
    )
    assert _loaded(files, tmp_path).samples["hand"].stream.rate == pytest.approx(rate, rel=0.5e-3)


def test_a_point_may_go_on_in_another_tracking_system(tmp_path: Path) -> None:
    """The strip's rate was changed while recording."""
    whole = recording()
    index = whole.samples["index"]
    anew = replace(
        index,
        stream=replace(index.stream, name="index2", rate=50.0),
        t=index.t[-1] + (1 + np.arange(5)) / 50,
        values=index.values[:5],
    )
    motion_bids.write(replace(whole, samples={**whole.samples, "index2": anew}), tmp_path / "a.zip")
    read = motion_bids.load(tmp_path / "a.zip")
    np.testing.assert_array_equal(read.samples["index2"].values, anew.values)


def test_points_that_are_not_known_are_left_out_with_a_warning(tmp_path: Path) -> None:
    files = with_text(
        dataset(),
        "_tracksys-mag_channels.tsv",
        lambda text: text.replace("\tindex_distal\t", "\tsixth_finger\t"),
    )
    read = _loaded(files, tmp_path)
    assert read.samples["mag"].stream.sensors == ("hand",)
    assert any("sixth_finger" in w for w in read.warnings)


def test_channels_of_other_kinds_are_passed_over(tmp_path: Path) -> None:
    files = with_text(
        dataset(),
        "_tracksys-mag_channels.tsv",
        lambda text: text.replace("MAGN\tindex_distal\tT", "POS\tindex_distal\tm"),
    )
    assert _loaded(files, tmp_path).samples["mag"].stream.sensors == ("hand",)


def test_the_hand_may_be_given_where_the_recording_does_not_say_it(tmp_path: Path) -> None:
    files = dataset()
    for system in recording().samples:
        files = with_sidecar(files, system, MeasuredHand=None)
    place = folder(files, tmp_path)
    assert motion_bids.load(place, "right").hand == "right"
    assert motion_bids.load(place, "right").geometry.hand == "right"


def test_one_sidecar_that_says_the_hand_is_enough(tmp_path: Path) -> None:
    files = dataset()
    for system in list(recording().samples)[1:]:
        files = with_sidecar(files, system, MeasuredHand="n/a", HandGeometry=None)
    read = _loaded(with_sidecar(files, "hand", MeasuredHand="Left"), tmp_path)
    assert read.hand == "left"
    assert read.geometry == recording().geometry


def _two_recordings() -> Files:
    other = {name.replace("task-hand", "task-handgrip"): data for name, data in dataset().items()}
    return dataset() | with_renamed_event(other)


def with_renamed_event(files: Files) -> Files:
    return {name: data.replace(b"\trom", b"\tgrip") for name, data in files.items()}


@pytest.mark.parametrize(
    ("unit", "factor"), [("Nm", 1.0), ("N·m", 1.0), ("N*mm", 1e-3), ("mNm", 1e-3)]
)
def test_torques_are_told_apart_from_forces_by_their_unit(
    unit: str, factor: float, tmp_path: Path
) -> None:
    files = with_text(
        dataset(),
        "_tracksys-force_channels.tsv",
        lambda text: text.replace("\tN*m\t", f"\t{unit}\t"),
    )
    read, force = _loaded(files, tmp_path).samples["force"], recording().samples["force"]
    np.testing.assert_array_equal(read.of(FORCE), force.of(FORCE))
    np.testing.assert_allclose(read.of(TORQUE), force.of(TORQUE) * factor, rtol=1e-15)


@pytest.mark.parametrize(
    ("told", "instead"),
    [
        ("_torque_y\ty\t", "_torque_y\tx\t"),
        ("_torque_z\tz\t", "_torque_z\tn/a\t"),
        ("_torque_x\tx\tMISC", "_torque_x\tx\tPOS"),
    ],
)
def test_torques_that_are_not_told_about_every_axis_do_not_keep_the_forces_from_being_read(
    told: str, instead: str, tmp_path: Path
) -> None:
    files = with_text(
        dataset(), "_tracksys-force_channels.tsv", lambda text: text.replace(told, instead)
    )
    read, force = _loaded(files, tmp_path), recording().samples["force"]
    assert read.samples["force"].stream.quantities == (FORCE,)
    np.testing.assert_array_equal(read.samples["force"].of(FORCE), force.of(FORCE))
    assert [w for w in read.warnings if "torques are passed over" in w and "thumb_tip_force" in w]


def test_the_path_of_a_motion_tsv_chooses_among_several_recordings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = folder(_two_recordings(), tmp_path)
    for task, name in (("hand", "rom"), ("handgrip", "grip")):
        read = motion_bids.load(
            place / f"sub-01/motion/sub-01_task-{task}_tracksys-index_motion.tsv"
        )
        assert set(read.samples) == set(recording().samples)
        assert [e.details["task_name"] for e in read.of_type("task")] == [
            name
        ]  # its own events, not those of a task whose name begins alike
    monkeypatch.chdir(place / "sub-01" / "motion")
    assert (
        motion_bids.load(Path("sub-01_task-hand_tracksys-index_motion.tsv")).source["task"]
        == "hand"
    )


def test_runs_are_recordings_of_their_own(tmp_path: Path) -> None:
    runs = {}
    for run in ("01", "02"):
        for name, data in dataset().items():
            changed = name.replace("_motion.", f"_run-{run}_motion.").replace(
                "_channels.", f"_run-{run}_channels."
            )
            runs[changed.replace("_events.", f"_run-{run}_events.")] = (
                data if run == "01" else data.replace(b"\trom", b"\tsecond")
            )
    place = folder(runs, tmp_path)
    read = motion_bids.load(place / f"{BASE}_tracksys-hand_run-02_motion.tsv")
    assert [e.details["task_name"] for e in read.of_type("task")] == ["second"]
    assert set(read.samples) == set(recording().samples)


def test_events_may_belong_to_a_tracking_system(tmp_path: Path) -> None:
    files = dataset()
    files[f"{BASE}_tracksys-hand_events.tsv"] = files.pop(f"{BASE}_events.tsv")
    assert _loaded(files, tmp_path).events == TIDY


def test_derivatives_in_the_dataset_are_no_recordings(tmp_path: Path) -> None:
    derived = {
        f"derivatives/handscope/{name.replace('_motion', '_desc-m2_motion').replace('_channels', '_desc-m2_channels')}": d
        for name, d in dataset().items()
    }
    beside = {
        name.replace("tracksys-hand", "tracksys-handscope_desc-m2"): d
        for name, d in dataset().items()
        if "tracksys-hand_" in name
    }
    read = _loaded(dataset() | derived | beside, tmp_path)
    assert set(read.samples) == set(recording().samples)


def test_events_are_optional_and_extra_columns_are_kept(tmp_path: Path) -> None:
    assert _loaded(without(dataset(), "_events.tsv"), tmp_path / "a").events == ()
    files = dataset() | {
        f"{BASE}_events.tsv": b"duration\tonset\ttrial_type\ttask_name\trepetition\nn/a\t1.5\ttask\ttapping\t3\n"
    }
    assert _loaded(files, tmp_path / "b").events == (
        Event(1.5, 0.0, "task", {"task_name": "tapping", "repetition": "3"}),
    )


def test_a_stream_without_samples_for_us_is_passed_over(tmp_path: Path) -> None:
    files = with_text(
        dataset(), "_tracksys-mag_channels.tsv", lambda text: text.replace("MAGN", "OTHER")
    )
    assert "mag" not in _loaded(files, tmp_path).samples


def test_unknown_mounting_is_identity_and_a_stream_of_another_name_keeps_it(tmp_path: Path) -> None:
    bare = replace(recording(), mounting={})
    motion_bids.write(bare, tmp_path / "a.zip")
    assert motion_bids.load(tmp_path / "a.zip").mounting == {}


def test_numbers_are_written_with_just_the_digits_that_bring_them_back(
    rng: np.random.Generator,
) -> None:
    table = np.concatenate(
        [
            rng.normal(size=(50, 3)) * 10.0 ** rng.integers(-300, 300, (50, 1)),
            [[0.0, -0.0, np.nan], [1e-7, 5e-324, 1 / 3]],
        ]
    )
    text = bytes(NumberTable((table,)))
    np.testing.assert_array_equal(reader.numbers([text], "x", 3), table)
    assert b"n/a" in text
    assert bytes(NumberTable((np.empty((0, 3)),))) == b""


def test_sidecars_count_their_channels(tmp_path: Path) -> None:
    about = json.loads(dataset()[f"{BASE}_tracksys-index_motion.json"])
    assert {k: v for k, v in about.items() if k.endswith("Count")} == {
        "TrackedPointsCount": 3, "LATENCYChannelCount": 1, "GYROChannelCount": 9, "ACCELChannelCount": 9, "MotionChannelCount": 19,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("acq_time", "start"),
    [
        ("2025-03-01T12:00:00Z", "2025-03-01T12:00:00+00:00"),
        ("2025-03-01T12:00:00.500+02:00", "2025-03-01T10:00:00.500000+00:00"),
        ("2025-03-01T12:00:00", datetime(2025, 3, 1, 12).astimezone(UTC).isoformat()),
        ("1900-03-01T12:00:00Z", None),  # shifted on purpose
        ("n/a", None),
        ("yesterday", None),
    ],
)
def test_a_recording_is_dated_by_the_scans_file(
    tmp_path: Path, acq_time: str, start: str | None
) -> None:
    files = dataset()
    recorded = [name.removeprefix("sub-01/") for name in files if name.endswith("_motion.tsv")]
    other = "motion/sub-01_task-other_tracksys-imu_motion.tsv\t2001-01-01T00:00:00Z"
    lines = ["filename\tacq_time", *(f"{name}\t{acq_time}" for name in recorded), other]
    files["sub-01/sub-01_scans.tsv"] = "\n".join(lines).encode()
    read = _loaded(files, tmp_path)
    assert read.start_utc == start
    is_warned_of = any(f"acq_time {acq_time}" in words for words in read.warnings)
    assert is_warned_of == (acq_time == "yesterday")
