"""`handscope locate`: from the table of an array with all that a bench does to it to places of a magnet that are right, or to a word why not."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.estimators.errors import InputError
from handscope.estimators.magnet.array import bench_readings
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.magnetic_field import MagneticField, homogeneous
from handscope.sessions.tables_io import array_table
from handscope.sessions.tables_io.array_description import read_description

PLACES = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.12, 0], [0.1, 0.12, 0.03], [0.05, 0.06, 0.0]])
CHIPS = np.array(  # rows: what each chip calls x, y, z in the board's axes
    [
        np.eye(3),
        [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
        [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
        [[0, 1, 0], [1, 0, 0], [0, 0, 1]],
        np.eye(3),
    ]
)  # the fourth is left-handed: x and y exchanged
HARD = 1e-6 * np.random.default_rng(4).normal(size=(5, 3)) * 20
RATE, NOISE = 60.0, 0.1e-6
HEADER = ",".join(["t", *(f"m{k}_{axis}" for k in range(5) for axis in "xyz")])


def _table(path: Path, B: Array, rng: np.random.Generator, extra: Array | None = None) -> Array:
    """Readings (n, 5, 3) of fields B in the board's axes, in gauss, as a CSV file; gives them."""
    table = np.einsum("kij,nkj->nki", CHIPS, B) + HARD + NOISE * rng.normal(size=B.shape)
    table = 1e4 * (table if extra is None else table + extra)
    t = np.arange(len(B)) / RATE
    np.savetxt(
        path,
        np.column_stack([t, table.reshape(len(B), -1)]),
        delimiter=",",
        header=HEADER,
        comments="",
        fmt="%.7f",
    )
    return table


def _board(path: Path) -> Path:
    each = {f"m{k}": {"place": p.tolist()} for k, p in enumerate(PLACES)}
    path.write_text(json.dumps({"unit": "G", "moment": 0.32, "magnetometers": each}))
    return path


@pytest.fixture
def bench(tmp_path: Path) -> tuple[Path, Path, Array, Array]:
    """A board that is turned, then held still while a magnet goes round in front of it: folder, the board's file, its fields and the magnet's places."""
    rng, earth = np.random.default_rng(1), homogeneous().earth
    n = 1500
    t = np.arange(n) / RATE
    q = quat.multiply(
        quat.about(2, 2 * np.pi * 0.31 * t),
        quat.multiply(quat.about(0, 2 * np.pi * 0.17 * t), quat.about(1, np.sin(t))),
    )
    turned = np.repeat(
        quat.rotate(quat.conjugate(q), np.broadcast_to(earth, (n, 3)))[:, None], 5, axis=1
    )
    _table(tmp_path / "turned.csv", turned, rng)
    t = np.arange(300) / RATE
    p = PLACES.mean(axis=0) + np.column_stack(
        [0.05 * np.cos(t), 0.05 * np.sin(t), 0.13 + 0.02 * np.sin(2 * t)]
    )
    m = np.array([0.32, 0.0, 0.0])
    B = np.array([MagneticField(earth, one[None], m[None]).at(PLACES) for one in p])
    return tmp_path, _board(tmp_path / "board.json"), B, p


def _located(folder: Path, board: Path, turned: bool = True) -> Array:
    words = [
        "locate",
        str(folder / "magnet.csv"),
        "--array",
        str(board),
        "--out",
        str(folder / "out.tsv"),
    ]
    assert main(words + (["--turned", str(folder / "turned.csv")] if turned else [])) == 0
    return np.genfromtxt(folder / "out.tsv", names=True, delimiter="\t")


def test_a_magnet_is_found_whatever_the_chips_axes(
    bench: tuple[Path, Path, Array, Array], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, board, B, p = bench
    _table(folder / "magnet.csv", B[::3], np.random.default_rng(2))
    out = _located(folder, board)
    place, sd = (np.column_stack([out[a + end] for a in "xyz"]) for end in ("", "_sd"))
    found = out["found"] > 0.5
    assert found.mean() > 0.95
    assert np.median(np.linalg.norm(place - p[::3], axis=1)[found]) < 0.002
    assert (((place - p[::3]) / sd)[found] ** 2).mean() < 1.5
    said = capsys.readouterr().out
    assert "m3: an axis points the other way than on most" in said and "magnet found in" in said


def test_how_the_first_chip_is_turned_may_be_told(bench: tuple[Path, Path, Array, Array]) -> None:
    """The second one of the board as the first of the array's file: its axes are the board's turned by a quarter."""
    folder, board, B, p = bench
    description = json.loads(board.read_text())
    quarter = [float(np.sqrt(0.5)), 0.0, 0.0, float(np.sqrt(0.5))]  # from its axes to the board's
    description["magnetometers"] = {
        name: {**description["magnetometers"][name], "q_bl": quarter}
        for name in ("m1", "m0", "m2", "m3", "m4")
    }
    board.write_text(json.dumps(description))
    _table(folder / "magnet.csv", B[:40], np.random.default_rng(2))
    out = _located(folder, board)
    assert out["found"].mean() > 0.9
    assert (
        np.median(np.linalg.norm(np.column_stack([out[a] for a in "xyz"]) - p[:40], axis=1)) < 0.002
    )


def test_a_first_chip_that_is_the_odd_one_and_one_that_does_not_answer_are_named(
    bench: tuple[Path, Path, Array, Array], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, board, B, p = bench
    description = json.loads(board.read_text())
    description["magnetometers"] = {
        name: description["magnetometers"][name] for name in ("m3", "m0", "m1", "m2", "m4")
    }
    board.write_text(json.dumps(description))
    _table(folder / "magnet.csv", B[:40], np.random.default_rng(2))
    _located(folder, board)
    assert "m3: an axis points the other way than on most" in capsys.readouterr().out
    rows = (folder / "magnet.csv").read_text().splitlines()
    (folder / "magnet.csv").write_text(
        "\n".join([rows[0], *(",".join([*row.split(",")[:-1], "0.25"]) for row in rows[1:])])
    )
    out = _located(folder, _board(board))
    assert (
        "m4: an axis always reads the same, it does not answer; its readings are left out"
        in capsys.readouterr().out
    )
    assert out["found"].mean() > 0.5
    np.testing.assert_allclose(
        np.column_stack([out[a] for a in "xyz"])[out["found"] > 0.5],
        p[:40][out["found"] > 0.5],
        atol=0.01,
    )


def test_what_disturbs_is_named_and_no_wrong_place_is_told(
    bench: tuple[Path, Path, Array, Array], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, board, B, p = bench
    second = MagneticField(
        np.zeros(3), np.array([[0.0, 0.0, 0.12]]), np.array([[0.0, 0.3, 0.1]])
    ).at(PLACES)
    hum = (
        3e-6
        * np.sin(2 * np.pi * 50.0 * np.arange(len(B)) / RATE)[:, None, None]
        * np.array([1.0, 0.0, 0.0])
    )
    _table(folder / "magnet.csv", B + second, np.random.default_rng(2), hum)
    out = _located(folder, board)
    place = np.column_stack([out[a] for a in "xyz"])
    assert not ((out["found"] > 0.5) & (np.linalg.norm(place - p, axis=1) > 0.05)).any()
    said = capsys.readouterr().out
    assert "mains hum of 3 uT (shows at 10 Hz)" in said
    assert "a second magnet" in said or "too far away" in said


def test_without_calibration_it_is_said(
    bench: tuple[Path, Path, Array, Array], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, board, B, _ = bench
    _table(folder / "magnet.csv", B[:80], np.random.default_rng(2))
    assert (_located(folder, board, turned=False)["found"] > 0.5).mean() < 0.1
    assert "not calibrated" in capsys.readouterr().out


def test_what_differs_without_the_magnet_is_taken_off(
    bench: tuple[Path, Path, Array, Array], capsys: pytest.CaptureFixture[str]
) -> None:
    """Nobody turned the array; where it stands it was recorded alone."""
    folder, board, B, p = bench
    rng = np.random.default_rng(2)
    for name, fields in (
        ("magnet", B[::3]),
        ("alone", np.broadcast_to(homogeneous().earth, (60, 5, 3))),
    ):
        table = 1e4 * (fields + HARD + NOISE * rng.normal(size=fields.shape))
        rows = np.column_stack([np.arange(len(table)) / RATE, table.reshape(len(table), -1)])
        np.savetxt(
            folder / f"{name}.csv", rows, delimiter=",", header=HEADER, comments="", fmt="%.7f"
        )
    assert not (_located(folder, board, turned=False)["found"] > 0.5).any()
    words = [
        "locate",
        str(folder / "magnet.csv"),
        "--array",
        str(board),
        "--out",
        str(folder / "out.tsv"),
        "--without",
    ]
    assert main([*words, str(folder / "alone.csv")]) == 0
    out = np.genfromtxt(folder / "out.tsv", names=True, delimiter="\t")
    place, sd = (np.column_stack([out[a + end] for a in "xyz"]) for end in ("", "_sd"))
    found = out["found"] > 0.5
    assert found.mean() > 0.95 and np.median(np.linalg.norm(place - p[::3], axis=1)) < 0.003
    assert (((place - p[::3]) / sd)[found] ** 2).mean() < 1.5
    capsys.readouterr()
    assert main([*words, str(folder / "magnet.csv")]) == 2
    assert "the magnet was there" in capsys.readouterr().err


def test_what_is_told_of_calibration_and_of_the_field_is_counted(
    bench: tuple[Path, Path, Array, Array], capsys: pytest.CaptureFixture[str]
) -> None:
    """Readings without iron in the board's axes."""
    folder, board, B, _ = bench
    table = 1e4 * (B[:20] + NOISE * np.random.default_rng(2).normal(size=B[:20].shape))
    rows = np.column_stack([np.arange(20) / RATE, table.reshape(20, -1)])
    np.savetxt(folder / "magnet.csv", rows, delimiter=",", header=HEADER, comments="", fmt="%.7f")
    assert (_located(folder, board, turned=False)["found"] > 0.5).mean() < 1.0
    assert (
        "with the 2 uT an axis that are counted because nobody says how the array is calibrated"
        in capsys.readouterr().out
    )
    description, sds = board.read_text(), []
    for more in ("", ', "gradient": 2e-5'):
        board.write_text(description.replace('"G"', f'"G", "calibration_sd": 2e-7{more}'))
        sds.append(np.median(_located(folder, board, turned=False)["z_sd"]))
        said = capsys.readouterr().out
        assert (
            "the array has too few magnetometers (5) to show a field that changes across the array: 5 uT a metre would draw places by"
            in said
        ) is not more
    assert sds[1] > 1.1 * sds[0]


def test_a_wrong_unit_and_a_wrong_moment_are_named(
    bench: tuple[Path, Path, Array, Array], capsys: pytest.CaptureFixture[str]
) -> None:
    """Gauss told as mT: ten times as much, the place the same, the moment ten times too large."""
    folder, board, B, _ = bench
    _table(folder / "magnet.csv", B[:20], np.random.default_rng(2))
    description = board.read_text()
    board.write_text(description.replace("0.32", "0.032"))
    assert _located(folder, board)["found"].max() < 0.5
    assert (
        "the readings contradict the declared moment, 0.032 A m^2: without it they are those of a magnet of 0.3"
        in capsys.readouterr().out
    )
    board.write_text(description.replace('"G", "moment": 0.32', '"mT"'))
    words = [
        "locate",
        str(folder / "magnet.csv"),
        "--array",
        str(board),
        "--out",
        str(folder / "no.tsv"),
    ]
    assert main([*words, "--turned", str(folder / "turned.csv")]) == 2
    assert (
        "The unit is declared as mT: is it G?" in capsys.readouterr().err
        and not (folder / "no.tsv").exists()
    )
    assert main(words) == 0
    assert "The unit is declared as mT: is it G?" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "header", "row"),
    [
        ("first line must name the columns", "a,b", "1,2"),
        ("line 2: wrong number of columns, 15", HEADER, ",".join(15 * ["0"])),
        ("could not convert", HEADER, "x" + 15 * ",0"),
        ("increase; 0 comes after 0.", HEADER, "0" + 15 * ",1" + "\n0" + 15 * ",1"),
        ("no magnetometer 'm1'", "t,m0_x,m0_y,m0_z", "0,1,2,3\n1,1,2,3"),
    ],
)
def test_a_table_that_is_none_is_refused(
    words: str, header: str, row: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.csv").write_text(f"{header}\n{row}\n")
    assert (
        main(
            [
                "locate",
                str(tmp_path / "a.csv"),
                "--array",
                str(_board(tmp_path / "b.json")),
                "--out",
                str(tmp_path / "o.tsv"),
            ]
        )
        == 2
    )
    assert words in capsys.readouterr().err
    assert not (tmp_path / "o.tsv").exists()


def test_tables_of_other_benches_are_read(tmp_path: Path) -> None:
    """Decimal commas, a comment, names of one's own, text beside; and none of that: no header, no time, all x before all y."""
    each = {
        f"m{k}": {"place": [0.1 * k, 0, 0], "columns": [f"B{axis}{k}" for axis in "xyz"]}
        for k in range(2)
    }
    (tmp_path / "a.json").write_text(
        json.dumps({"unit": "µT", "time": {"column": "clock", "unit": "us"}, "magnetometers": each})
    )
    names = "note;clock;Bx0;By0;Bz0;Bx1;By1;Bz1"
    (tmp_path / "a.TXT").write_text(
        f"# bench\n{names}\nrun;5000;1,5;2;3;4;5;6;\nrun;7500;7;8;;10;11;12;\n"
    )
    table = array_table.read_table(tmp_path / "a.TXT", read_description(tmp_path / "a.json"))
    np.testing.assert_allclose(table.t, [0, 2.5e-3])
    np.testing.assert_array_equal(table.readings["m0"], [[1.5, 2, 3], [7, 8, np.nan]])
    each = {f"m{k}": {"place": [0.1 * k, 0, 0], "columns": [1 + k, 3 + k, 5 + k]} for k in range(2)}
    (tmp_path / "b.json").write_text(json.dumps({"unit": 6e-9, "rate": 50, "magnetometers": each}))
    (tmp_path / "b.dat").write_text("1 2  3 4 5 6\n7 8 9 10 11 12\n")
    description = read_description(tmp_path / "b.json")
    table = array_table.read_table(tmp_path / "b.dat", description)
    np.testing.assert_allclose(table.t, [0, 0.02])
    np.testing.assert_array_equal(table.readings["m1"], [[2, 4, 6], [8, 10, 12]])
    np.testing.assert_allclose(
        bench_readings.convert_to_tesla(table.readings["m1"], description.unit, None)[0, 0], 1.2e-8
    )


def test_a_cell_may_hold_three_numbers_and_a_row_one_magnetometer(tmp_path: Path) -> None:
    """As loggers of wearable arrays and data frames write them."""
    each = {f"Sensor {k}": {"place": [0.1 * k, 0, 0]} for k in (1, 2)}
    (tmp_path / "a.json").write_text(
        json.dumps(
            {"unit": "uT", "time": {"column": "Time Stamp", "unit": "iso"}, "magnetometers": each}
        )
    )
    start = "2023-08-01 13:03:"
    rows = [f'0,{start}20.50,"(1.5, 2.0, -3)","[4 5 6]"', f'1,{start}21.00,"(7, 8, 9)",']
    (tmp_path / "a.csv").write_text("\n".join([",Time Stamp,Sensor 1,Sensor 2", *rows]))
    table = array_table.read_table(tmp_path / "a.csv", read_description(tmp_path / "a.json"))
    np.testing.assert_allclose(table.t, [0, 0.5])
    np.testing.assert_array_equal(table.readings["Sensor 1"], [[1.5, 2, -3], [7, 8, 9]])
    np.testing.assert_array_equal(table.readings["Sensor 2"], [[4, 5, 6], [np.nan] * 3])
    description: dict[str, Any] = {
        "unit": "uT",
        "sensor": "id",
        "columns": ["Bx", "By", "Bz"],
        "magnetometers": {k: {"place": [int(k), 0, 0]} for k in "12"},
    }
    (tmp_path / "b.json").write_text(json.dumps(description))
    (tmp_path / "b.csv").write_text(
        "id,Bx,By,Bz,t,note\n1.0,1,2,3,10,a\n2.0,4,5,6,10.1,a\n3.0,0,0,0,9,a\n1.0,7,8,9,11,b\n2.0,1,1,1,11.1,b\n"
    )
    table = array_table.read_table(tmp_path / "b.csv", read_description(tmp_path / "b.json"))
    np.testing.assert_allclose(
        [table.t, table.times["1"], table.times["2"]], [[0, 1], [0, 1], [0.1, 1.1]]
    )
    np.testing.assert_array_equal(
        [table.readings["1"][1], table.readings["2"][0]], [[7, 8, 9], [4, 5, 6]]
    )
    for words, rows in (
        ("no magnetometer '2' in its column", "1,1,2,3,10"),
        ("b.csv, 1: the times must", "1,1,2,3,10\n1,1,2,3,9\n2,1,2,3,4\n2,1,2,3,5"),
    ):
        (tmp_path / "b.csv").write_text(f"id,Bx,By,Bz,t\n{rows}\n")
        with pytest.raises(InputError, match=words):
            array_table.read_table(tmp_path / "b.csv", read_description(tmp_path / "b.json"))
    description["magnetometers"]["2"]["columns"] = ["Bx", "By", "Bz"]
    (tmp_path / "b.json").write_text(json.dumps(description))
    with pytest.raises(InputError, match=r"'2' has `columns` of its own.*tell `columns` once"):
        read_description(tmp_path / "b.json")


def test_rows_of_one_magnetometer_after_the_other_need_no_name(tmp_path: Path) -> None:
    """As a bench writes them that prints x, y and z of all chips in turn, and an empty line."""
    each = {name: {"place": [k, 0, 0]} for k, name in enumerate("ab")}
    description = {
        "unit": "mG",
        "rate": 10,
        "sensor": "in turn",
        "columns": [1, 2, 3],
        "magnetometers": each,
    }
    (tmp_path / "a.json").write_text(json.dumps(description))
    (tmp_path / "a.txt").write_text("1.0 2.0 3.0 \n4 5 6 \n\n7 8 9 \n10 11 12 \n\n")
    table = array_table.read_table(tmp_path / "a.txt", read_description(tmp_path / "a.json"))
    np.testing.assert_allclose(table.t, [0, 0.1])
    np.testing.assert_array_equal(table.readings["b"], [[4, 5, 6], [10, 11, 12]])
    (tmp_path / "a.txt").write_text("1 2 3\n4 5 6\n7 8 9\n")
    with pytest.raises(
        InputError, match=r"rows \(3\) is no multiple of that of the array's magnetometers \(2\)"
    ):
        array_table.read_table(tmp_path / "a.txt", read_description(tmp_path / "a.json"))


def test_magnetometers_alone_are_a_motion_bids_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """No inertial sensor, no hand, in gauss."""
    stem = tmp_path / "sub-01" / "motion" / "sub-01_task-reach_tracksys-mag"
    stem.parent.mkdir(parents=True)
    names = [f"trunk_mag_{k}" for k in range(1, 6)]
    field = 0.45 + 1e-4 * np.random.default_rng(5).normal(size=(30, 15))
    np.savetxt(f"{stem}_motion.tsv", field, delimiter="\t")
    rows = [f"{name}_{axis}\t{axis}\tMAGN\t{name}\tG" for name in names for axis in "xyz"]
    Path(f"{stem}_channels.tsv").write_text(
        "\n".join(["name\tcomponent\ttype\ttracked_point\tunits", *rows])
    )
    Path(f"{stem}_motion.json").write_text(
        json.dumps({"TaskName": "reach", "SamplingFrequency": 50})
    )
    each = {name: {"place": p.tolist()} for name, p in zip(names, PLACES)}
    (tmp_path / "a.json").write_text(
        json.dumps({"unit": "T", "calibration_sd": 1e-7, "magnetometers": each})
    )
    assert (
        main(
            [
                "locate",
                str(tmp_path),
                "--array",
                str(tmp_path / "a.json"),
                "--out",
                str(tmp_path / "o.tsv"),
            ]
        )
        == 0
    )
    assert "readings: 30, magnetometers: 5, in 0.6 s" in capsys.readouterr().out


def test_units_and_clocks() -> None:
    one = np.full((1, 1, 3), 0.5)
    np.testing.assert_allclose(bench_readings.convert_to_tesla(one, "G", None), 5e-5)
    np.testing.assert_allclose(bench_readings.convert_to_tesla(one, "normalised", 4e-5), 2e-5)
    with pytest.raises(InputError, match="earth"):
        bench_readings.convert_to_tesla(one, "normalised", None)
    with pytest.raises(InputError, match="units are"):
        bench_readings.convert_to_tesla(one, "tesla", None)
    t = np.arange(10.0)
    own = np.delete(np.arange(0.5, 10.5), [4, 5, 6])
    brought = bench_readings.resample_readings(t, own, np.column_stack([own, 2 * own, -own]))
    np.testing.assert_allclose(brought[[1, 2, 9]], [[1, 2, -1], [2, 4, -2], [9, 18, -9]])
    assert np.isnan(brought[[0, 4, 5, 6, 7]]).all()


def test_a_limit_that_nobody_told_is_seen() -> None:
    rng = np.random.default_rng(3)
    t = np.arange(600) / RATE
    mag = 60e-6 * np.sin(t)[:, None, None] * np.ones((1, 2, 3)) + NOISE * rng.normal(
        size=(600, 2, 3)
    )
    mag[:, 1, 2] = np.clip(mag[:, 1, 2], -50e-6, 50e-6)
    statistics = bench_readings.compute_statistics(t, mag, None)
    assert statistics.is_saturated[:, 1].mean() > 0.2 and not statistics.is_saturated[:, 0].any()
    np.testing.assert_allclose(statistics.noise[0], NOISE, rtol=0.3)
