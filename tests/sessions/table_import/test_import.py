"""Tables of other loggers: mapped, checked and processed as the recording that they were made from."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import ACC, GYR, ORIENTATION, TRACKED_POINTS, Block
from handscope.estimators.methods import METHODS
from handscope.estimators.orientation import fusion
from handscope.estimators.pipeline.process import process
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import recordings
from handscope.sessions.motion_bids.writer import events_table
from handscope.sessions.table_import.column_map import Channels, ColumnMap, MappedSensor
from handscope.sessions.table_import.examine import examine
from handscope.sessions.table_import.guess import guess
from tests.simulated import DEG

Change = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> LoadedRecording:
    path = tmp_path_factory.mktemp("import") / "tapping.zip"
    assert main(["simulate", "tapping", "--out", str(path), "--seed", "11"]) == 0
    return recordings.load(path)


@pytest.fixture(scope="module")
def german(original: LoadedRecording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a table of decimal commas, degrees and g, shuffled columns that no program knows, its map and events."""
    folder = tmp_path_factory.mktemp("german")
    block = original.samples["imu"]
    t = block.t
    columns = [("zeit", (t - t[0]) * 1e3)]
    sensors = {}
    for k, point in enumerate(block.stream.sensors):
        gyr, acc = block.of(GYR)[:, k] / DEG, block.of(ACC)[:, k] / 9.80665
        columns += [(f"a{k}{c}", gyr[:, j]) for j, c in enumerate("uvw")]
        columns += [(f"b{k}{c}", acc[:, j]) for j, c in enumerate("uvw")]
        sensors[point] = {
            "gyr": {"columns": [f"a{k}{c}" for c in "uvw"], "unit": "deg/s"},
            "acc": {"columns": [f"b{k}{c}" for c in "uvw"], "unit": "g"},
            "mounting": [float(x) for x in original.mounting.get(point, (1, 0, 0, 0))],
        }
    order = np.random.default_rng(3).permutation(len(columns))
    lines = ["Logger 7;exported"]
    lines.append(";".join(columns[k][0] for k in order))
    rows = np.column_stack([columns[k][1] for k in order])
    lines += [";".join(f"{v:.7f}" for v in row).replace(".", ",") for row in rows]
    (folder / "log.csv").write_text("\n".join(lines) + "\n")
    column_map = {
        "hand": original.hand,
        "table": {"delimiter": ";", "decimal": ",", "header": True, "skip": 1},
        "time": {"column": "zeit", "unit": "ms"},
        "sensors": sensors,
        "geometry": {"hand_length": 0.18},
    }
    (folder / "map.json").write_text(json.dumps(column_map))
    (folder / "events.tsv").write_bytes(events_table(original.events))
    return folder


def imported(folder: Path, out: Path, **changed: object) -> int:
    """Import with the map of the folder, some of its keys changed."""
    column_map = json.loads((folder / "map.json").read_text()) | changed
    (out.parent / "map.json").write_text(json.dumps(column_map))
    words = ["import", str(folder / "log.csv"), "--map", str(out.parent / "map.json")]
    return main([*words, "--events", str(folder / "events.tsv"), "--out", str(out)])


def test_decimal_commas_degrees_and_g_give_the_angles_of_the_original(
    original: LoadedRecording, german: Path, tmp_path: Path
) -> None:
    assert imported(german, tmp_path / "r.mcap") == 0
    recording = recordings.load(tmp_path / "r.mcap")
    assert recording.hand == original.hand and recording.events == original.events
    method = METHODS["m2"]
    inertial = LoadedRecording(
        original.hand,
        recording.geometry,
        original.mounting,
        {"imu": original.samples["imu"]},
        original.events,
    )
    ours, theirs = (process(method, method.Params(), r).trajectory for r in (recording, inertial))
    rows = np.searchsorted(ours.t, theirs.t - 1e-4)
    np.testing.assert_allclose(ours.angles[rows], theirs.angles, atol=0.2 * DEG, equal_nan=True)


def test_a_guess_finds_layout_and_time_and_says_what_is_open(
    german: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    guess = tmp_path / "guess.json"
    assert main(["import", str(german / "log.csv"), "--guess", str(guess)]) == 0
    found = json.loads(guess.read_text())
    assert found["table"] == {"delimiter": ";", "decimal": ",", "header": True, "skip": 1}
    assert found["time"] == {"column": "zeit", "unit": "ms"} and found["sensors"] == {}
    assert "fill in sensors" in capsys.readouterr().out


def test_a_guess_reads_names_of_segments_quantities_and_units(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    names = [f"index_middle {q} {a}" for q in ("Gyr [deg/s]", "Acc") for a in "XYZ"]
    rows = np.column_stack(
        [np.arange(200) * 0.01, 400 * rng.normal(size=(200, 3)), np.tile([0.0, 0.0, 1.0], (200, 1))]
    )
    table = "\n".join([",".join(["time", *names]), *(",".join(map(str, r)) for r in rows)])
    (tmp_path / "right_hand.csv").write_text(table)
    guess = tmp_path / "guess.json"
    assert main(["import", str(tmp_path / "right_hand.csv"), "--guess", str(guess)]) == 0
    sensor = json.loads(guess.read_text())["sensors"]["index_middle"]
    assert sensor["gyr"] == {"columns": names[:3], "unit": "deg/s"}
    assert sensor["acc"] == {"columns": names[3:], "unit": "g"}


@pytest.mark.parametrize(
    ("key", "value", "sentence"),
    [
        ("sensor", {}, "unknown keys: sensor"),
        ("hand", "both", "say left or right"),
        ("sensors", {"toe": {}}, "toe is no tracked point"),
        ("sensors", {"indx_middle": {}}, "points are index_middle, "),
        ("sensors", {"indx_middle": {}}, f"(the nearest of {len(TRACKED_POINTS)})"),
        ("time", {"column": "ziet", "unit": "ms"}, "columns are zeit, "),
        ("time", {"column": "nowhere", "unit": "ms"}, "no column 'nowhere'"),
        ("time", {"column": "zeit", "unit": "s"}, "is the unit of the time right?"),
        ("time", {"column": "a1u", "unit": "ms"}, "do not increase"),
        ("rate", 100, "either time"),
        ("table", {"delimiter": ";", "decimal": ".", "skip": 1}, "is the decimal mark '.'?"),
    ],
)
def test_a_map_that_is_wrong_is_refused_and_nothing_is_left(
    german: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    key: str,
    value: object,
    sentence: str,
) -> None:
    assert imported(german, tmp_path / "r.mcap", **{key: value}) == 2
    assert sentence in capsys.readouterr().err
    assert not (tmp_path / "r.mcap").exists()


@pytest.mark.parametrize(
    ("quantity", "unit", "sentence"),
    [("acc", "m/s^2", "this looks like g mapped as m/s^2"), ("gyr", "rad/s", "are they deg/s")],
)
def test_a_unit_that_contradicts_the_numbers_is_named(
    german: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    quantity: str,
    unit: str,
    sentence: str,
) -> None:
    sensors = json.loads((german / "map.json").read_text())["sensors"]
    for sensor in sensors.values():
        sensor[quantity]["unit"] = unit
    assert imported(german, tmp_path / "r.mcap", sensors=sensors) == 2
    assert sentence in capsys.readouterr().err and not (tmp_path / "r.mcap").exists()


def test_columns_without_a_header_are_counted_from_0_and_a_rate_may_stand_for_times(
    tmp_path: Path,
) -> None:
    rows = np.tile([0.01, 0.02, 0.03, 0.0, 0.0, 9.81], (300, 1))
    np.savetxt(tmp_path / "t.tsv", rows, delimiter="\t")
    column_map = {
        "hand": "right",
        "table": {"delimiter": "\t", "header": False},
        "rate": 50.0,
        "sensors": {
            "hand": {
                "gyr": {"columns": [0, 1, 2], "unit": "rad/s"},
                "acc": {"columns": [3, 4, 5], "unit": "m/s^2"},
            }
        },
    }
    (tmp_path / "map.json").write_text(json.dumps(column_map))
    words = ["import", str(tmp_path / "t.tsv"), "--map", str(tmp_path / "map.json")]
    assert main([*words, "--out", str(tmp_path / "r.mcap")]) == 0
    block = recordings.load(tmp_path / "r.mcap").samples["hand"]
    assert len(block.t) == 300 and block.stream.rate == 50
    np.testing.assert_allclose(block.values[7, 0], rows[0], rtol=1e-6)


@pytest.mark.parametrize(
    ("first", "unit", "start"),
    [
        (1_740_830_400.25, "s", "2025-03-01T12:00:00.250000+00:00"),
        (1_740_830_400_250.0, "ms", "2025-03-01T12:00:00.250000+00:00"),
        (52_133.0, "s", None),  # s since the logger was switched on
        (4_102_444_800.0, "s", None),  # in 2100
    ],
)
def test_an_imported_table_is_dated_by_its_own_times_or_not_at_all(
    tmp_path: Path, first: float, unit: str, start: str | None
) -> None:
    times = first + np.arange(100) * (0.02 if unit == "s" else 20.0)
    rows = np.column_stack([times, np.tile([0.0, 0.0, 9.81, 0.0, 0.0, 0.1], (100, 1))])
    np.savetxt(tmp_path / "t.tsv", rows, "%.3f", delimiter="\t")
    column_map = {
        "hand": "right",
        "table": {"delimiter": "\t", "header": False},
        "time": {"column": 0, "unit": unit},
        "sensors": {
            "hand": {
                "acc": {"columns": [1, 2, 3], "unit": "m/s^2"},
                "gyr": {"columns": [4, 5, 6], "unit": "rad/s"},
            }
        },
    }
    (tmp_path / "map.json").write_text(json.dumps(column_map))
    words = ["import", str(tmp_path / "t.tsv"), "--map", str(tmp_path / "map.json")]
    assert main([*words, "--out", str(tmp_path / "r.mcap")]) == 0
    assert recordings.load(tmp_path / "r.mcap").start_utc == start


def test_a_point_where_the_comma_is_the_decimal_mark_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It would be read as ten times as much, or a thousand times."""
    (tmp_path / "t.csv").write_text(
        "24.11.2026;0,02;0,03;0,0;0,0;9.81\n" * 3
    )  # nobody maps the date
    sensor = {"acc": {"columns": [3, 4, 5], "unit": "m/s^2"}}
    layout = {"delimiter": ";", "decimal": ",", "header": False}
    value = {"hand": "left", "table": layout, "rate": 100, "sensors": {"hand": sensor}}
    (tmp_path / "map.json").write_text(json.dumps(value))
    words = ["import", str(tmp_path / "t.csv"), "--map", str(tmp_path / "map.json")]
    assert main([*words, "--out", str(tmp_path / "r.mcap")]) == 2
    assert "line 1, column 5: '9.81' is not a number; is the decimal mark ','?" in (
        capsys.readouterr().err
    )
    assert not (tmp_path / "r.mcap").exists()


def test_orientations_alone_give_the_angles_of_the_original(
    original: LoadedRecording, tmp_path: Path
) -> None:
    raw = LoadedRecording(
        original.hand,
        original.geometry,
        original.mounting,
        {"imu": original.samples["imu"]},
        original.events,
    )
    ours = process(METHODS["m2"], METHODS["m2"].Params(), raw)
    block = exported_orientations(raw, ours.calibrations[0])
    names = [f"{p} quat {c}" for p in block.stream.sensors for c in "wxyz"]
    rows = np.column_stack([block.t, block.values.reshape(len(block.t), -1)])
    table = tmp_path / "device.csv"
    np.savetxt(table, rows, delimiter=",", header=",".join(["time", *names]), comments="")
    (tmp_path / "events.tsv").write_bytes(events_table(original.events))
    assert main(["import", str(table), "--guess", str(tmp_path / "map.json")]) == 0
    column_map = json.loads((tmp_path / "map.json").read_text()) | {"hand": original.hand}
    assert set(column_map["sensors"]) == set(block.stream.sensors)
    for point, q in original.mounting.items():
        if point in column_map["sensors"]:
            column_map["sensors"][point]["mounting"] = [float(x) for x in q]
    (tmp_path / "map.json").write_text(json.dumps(column_map))
    words = ["import", str(table), "--map", str(tmp_path / "map.json")]
    out = tmp_path / "r.mcap"
    assert main([*words, "--events", str(tmp_path / "events.tsv"), "--out", str(out)]) == 0
    given = process(METHODS["m2"], METHODS["m2"].Params(), recordings.load(out)).trajectory
    start = ours.calibrations[0].t
    a, b = given.between(start, np.inf), ours.trajectory.between(start, np.inf)
    assert np.nanmax(np.abs(a.angles - b.angles)) < 1.0 * DEG
    words = ["assess", str(out), "--out", str(tmp_path / "out"), "--method", "m2"]
    assert main(words) == 0


def exported_orientations(recording: LoadedRecording, known: Calibration) -> Block:
    """What our own fusion makes of the sensors, as a device with a fusion of its own would send it."""
    block = recording.samples["imu"]
    params = METHODS["m2"].Params()
    state = fusion.start(block.stream, {}, known.gyr_bias)
    state, part = fusion.step(params, state, block)
    _, rest = fusion.finish(params, state)
    q = np.concatenate([part.q_GS, rest.q_GS])
    return Block(replace(block.stream, quantities=(ORIENTATION,)), block.t, q)


def test_columns_that_no_program_knows_are_found_by_their_numbers(
    german: Path, original: LoadedRecording
) -> None:
    found = guess(german / "log.csv")
    triads = {t.columns: (t.quantity, t.unit, t.point) for t in found.triads}
    sensors = len(original.samples["imu"].stream.sensors)
    expected = {tuple(f"a{k}{c}" for c in "uvw"): ("gyr", "deg/s", None) for k in range(sensors)}
    expected |= {tuple(f"b{k}{c}" for c in "uvw"): ("acc", "g", None) for k in range(sensors)}
    assert triads == expected
    codes = [q.code for q in found.questions]
    assert codes.count("import.guess_which_segment") == 2 * sensors


def test_columns_without_names_are_taken_as_they_stand_side_by_side(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    q = rng.normal(size=(100, 4))
    parts = [
        q / np.linalg.norm(q, axis=1, keepdims=True),
        [0, 0, 9.81] + 0.1 * rng.normal(size=(100, 3)),
    ]
    rows = np.hstack([np.arange(100)[:, None] * 10.0, *parts, 90 * rng.normal(size=(100, 3))])
    (tmp_path / "a.csv").write_text("\n".join(",".join(map(str, r)) for r in rows))
    found = guess(tmp_path / "a.csv")
    assert found.columns.time == (0, "ms")
    assert [(t.quantity, t.unit, t.columns) for t in found.triads] == [
        ("orientation", "1", (1, 2, 3, 4)),
        ("acc", "m/s^2", (5, 6, 7)),
        ("gyr", "deg/s", (8, 9, 10)),
    ]


def test_an_import_says_what_it_took_the_numbers_for(
    german: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert imported(german, tmp_path / "r.mcap") == 0
    words = capsys.readouterr().out
    assert "accelerometers read 1.00 at rest: taken as g" in words
    assert "at rest, the longest from" in words or "at rest from" in words
    assert "warning" not in words


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda t, gyr, acc: (t, gyr[:, [1, 2, 0]], acc), "import.seen_disagreement"),
        (lambda t, gyr, acc: (t, gyr / 57.3, acc), "import.seen_rates_small"),
        (lambda t, gyr, acc: (t, gyr, 1.1 * acc), "import.seen_gravity_off"),
        (lambda t, gyr, acc: (t, gyr, acc / 9.81), "import.seen_gravity_unit"),
        (lambda t, gyr, acc: (t + 0.5 * (t > 6), gyr, acc), "import.seen_gaps"),
        (lambda t, gyr, acc: (t + 0.004 * (np.arange(len(t)) % 2), gyr, acc), "import.seen_uneven"),
        (lambda t, gyr, acc: (t, gyr + 0.3, acc), "import.seen_no_rest"),
    ],
)
def test_what_does_not_fit_together_is_warned_of(
    original: LoadedRecording, change: Change, code: str
) -> None:
    block = original.samples["imu"]
    point = block.stream.sensors.index("index_distal")
    t, gyr, acc = change(block.t - block.t[0], block.of(GYR)[:, point], block.of(ACC)[:, point])
    stream = replace(block.stream, sensors=("index_distal",), quantities=(GYR, ACC))
    one = Block(stream, t, np.concatenate([gyr, acc], axis=1)[:, None])
    units = {GYR: Channels(("a", "b", "c"), "rad/s"), ACC: Channels(("d", "e", "f"), "m/s^2")}
    columns = ColumnMap("left", {"index_distal": MappedSensor(units)})
    found = [m.code for m in examine([one], columns).messages if m.severity == "warning"]
    assert found == [code]
