"""`handscope calibrate-force`: from a table of loads to forces of a recording with raw channels, and what is refused on the way."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.estimators.data.samples import FORCE
from handscope.estimators.force import fingertip_forces
from handscope.estimators.numerics import quaternions as quat
from handscope.sessions import motion_bids
from tests.bids import BASE, Files, dataset, folder, with_sidecar, with_text

GAINS = np.array(
    [[0.11, 0.004, -0.003], [0.002, 0.095, 0.005], [-0.004, 0.003, 0.21]]
)  # V a newton that a fingertip exerts
OFFSET = np.array([1.2, 1.3, 0.9])  # V
DOWN = {
    "+x": (1, 0, 0),
    "-x": (-1, 0, 0),
    "+y": (0, 1, 0),
    "-y": (0, -1, 0),
    "+z": (0, 0, 1),
    "-z": (0, 0, -1),
}


def table(mark: str = ",") -> str:
    """Nothing, then 200 g and 500 g hung from the sensor in six positions."""
    rng, lines = (
        np.random.default_rng(1),
        [mark.join(["f1 [V]", "f2 [V]", "f3 [V]", "mass [g]", "down", "note"])],
    )
    for grams, way in [(0, "none"), *((g, w) for g in (200, 500) for w in DOWN)]:
        exerted = -9.80665e-3 * grams * np.array(DOWN.get(way, (0, 0, 0)))
        read = [f"{v:.5f}" for v in GAINS @ exerted + OFFSET + 2e-3 * rng.normal(size=3)]
        lines.append(
            mark.join(
                [
                    *(r.replace(".", ",") if mark == ";" else r for r in read),
                    str(grams),
                    way,
                    "by hand",
                ]
            )
        )
    return "\n".join(lines) + "\n"


def run(folder: Path, text: str, finger: str = "thumb", *more: str) -> int:
    (folder / "loads.csv").write_text(text)
    return main(
        [
            "calibrate-force",
            str(folder / "loads.csv"),
            "--finger",
            finger,
            "--out",
            str(folder / "setup.json"),
            *more,
        ]
    )


def test_raw_channels_become_forces_that_are_as_sure_as_their_calibration(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "setup.json").write_text(
        '{"MeasuredHand": "left", "ForceSetup": {"index_tip_force": {"scale_sd": 0.01}}}'
    )
    assert run(tmp_path, table(), "thumb") == 0
    said = capsys.readouterr().out
    assert "13 loads up to 4.9 N by 3 channels" in said
    assert "a force is known to 0." in said
    written = json.loads((tmp_path / "setup.json").read_text())
    assert written["MeasuredHand"] == "left"  # what was there stays
    setup = written["ForceSetup"]
    assert set(setup) == {"index_tip_force", "thumb_tip_force"}
    del setup["index_tip_force"]
    loaded = motion_bids.load(folder(raw_dataset(setup), tmp_path / "raw"))
    force = loaded.samples["force"]
    np.testing.assert_allclose(force.of(FORCE)[:, 0], TRUE, atol=0.2)
    assert force.stream.scale_sd == {"thumb_tip_force": setup["thumb_tip_force"]["scale_sd"]}
    assert len(TRUE) < fingertip_forces.LEAST, (
        "too few samples to be followed; how sure they are is tested with a lift"
    )
    motion_bids.write(loaded, tmp_path / "again")
    again = motion_bids.load(tmp_path / "again").samples["force"]
    assert again.stream.scale_sd == force.stream.scale_sd
    np.testing.assert_array_equal(again.of(FORCE), force.of(FORCE))


TRUE = np.array(
    [[0.0, 0.0, 0.0], [1.0, -2.0, 3.0], [0.5, 0.5, 4.0], [-1.0, 0.0, 2.0], [0.0, 3.0, 1.0]]
)  # N


def raw_dataset(setup: dict[str, object], unit: str = "V") -> Files:
    """A recording whose force sensor tells volts on three channels."""
    files = with_sidecar(dataset(), "force", ForceSetup=setup)
    raw = TRUE @ GAINS.T + OFFSET
    files[f"{BASE}_tracksys-force_motion.tsv"] = "".join(
        "\t".join([repr(k / 12), *map(repr, map(float, row))]) + "\n" for k, row in enumerate(raw)
    ).encode()
    lines = ["name\tcomponent\ttype\ttracked_point\tunits", "time\tn/a\tLATENCY\tn/a\ts"]
    lines += [f"f{k}\tn/a\tMISC\tthumb_tip_force\t{unit}" for k in (1, 2, 3)]
    files[f"{BASE}_tracksys-force_channels.tsv"] = ("\n".join(lines) + "\n").encode()
    return files


def test_a_row_in_which_something_is_missing_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(tmp_path, table().replace(",500,-z,", ",,-z,")) == 0
    said = capsys.readouterr().out
    assert "12 loads" in said
    assert "line 14 was passed over: a reading or the load is missing in it" in said


def test_a_table_with_decimal_commas_and_one_with_forces_tell_the_same(tmp_path: Path) -> None:
    found = []
    as_forces = [line.split(",") for line in table().splitlines()[1:]]
    exerted = [
        [f"{-9.80665e-3 * float(c[3]) * part:.6f}" for part in DOWN.get(c[4], (0, 0, 0))]
        for c in as_forces
    ]
    header = "f1 [V],f2 [V],f3 [V],force_x [N],force_y [N],force_z [N]"
    for text in (
        table(),
        table(";"),
        "\n".join([header, *(",".join([*c[:3], *e]) for c, e in zip(as_forces, exerted))]),
    ):
        assert run(tmp_path, text) == 0
        found.append(
            json.loads((tmp_path / "setup.json").read_text())["ForceSetup"]["thumb_tip_force"][
                "matrix"
            ]
        )
    np.testing.assert_allclose(found[1], found[0])
    np.testing.assert_allclose(found[2], found[0], atol=1e-4)


def test_weights_at_known_places_tell_torques_too_and_a_row_that_is_wrong_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(3)
    gains = 0.1 * np.diag([1, 1, 1, 50, 50, 50]) + 5e-3 * rng.normal(size=(6, 6))
    lines = [
        "a[mV];b[mV];c[mV];d[mV];e[mV];f[mV];mass [kg];down_x;down_y;down_z;at_x [mm];at_y [mm];at_z [mm]"
    ]
    for way in [*DOWN.values(), *DOWN.values(), *DOWN.values(), (0, 0, 0)]:
        mass, at = 0.4 * any(way), rng.uniform(-15, 15, 3)
        force = -9.80665 * mass * np.array(way)
        read = gains @ np.concatenate([force, np.cross(1e-3 * at, force)]) + 1e-3 * rng.normal(
            size=6
        )
        read[1] += 0.05 * (len(lines) == 5)
        lines.append(";".join(f"{v:.6f}" for v in [*read, mass, *way, *at]))
    assert run(tmp_path, "\n".join(lines)) == 0
    entry = json.loads((tmp_path / "setup.json").read_text())["ForceSetup"]["thumb_tip_force"]
    np.testing.assert_allclose(entry["matrix"], np.linalg.inv(gains), atol=0.2)
    assert entry["left_out_lines"] == [6]
    assert "line 6 was left out" in capsys.readouterr().out


def test_directions_told_by_the_accelerometer_on_the_cuff_put_the_forces_into_its_axes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rng, q_IF = (
        np.random.default_rng(4),
        quat.exp(np.radians([2.0, -1.0, 1.5])),
    )  # how the cuff holds its force sensor askew
    lines = ["f1 [V],f2 [V],f3 [V],mass [g],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2]"]
    for grams, way in [(0, DOWN["+z"]), *((g, w) for g in (200, 500) for w in DOWN.values())]:
        acc = -9.81 * quat.rotate(
            quat.exp(np.radians(rng.uniform(-5, 5, 3))), np.array(way, float)
        )  # not just so
        exerted = 1e-3 * grams * acc
        read = (
            GAINS @ quat.rotate(quat.conjugate(q_IF), exerted) + OFFSET + 2e-3 * rng.normal(size=3)
        )
        lines.append(
            ",".join(f"{v:.5f}" for v in [*read, grams, *(acc + 0.03 * rng.normal(size=3))])
        )
    assert run(tmp_path, "\n".join(lines)) == 0
    assert "its axes are those of the inertial sensor on the cuff, to 0." in capsys.readouterr().out
    setup = json.loads((tmp_path / "setup.json").read_text())["ForceSetup"]
    loaded = motion_bids.load(folder(raw_dataset(setup), tmp_path / "raw"))
    force = loaded.samples["force"]
    np.testing.assert_allclose(force.of(FORCE)[:, 0], quat.rotate(q_IF, TRUE), atol=0.06)
    assert 0.003 < force.stream.turn_sd["thumb_tip_force"] < 0.02
    motion_bids.write(loaded, tmp_path / "again")
    assert (
        motion_bids.load(tmp_path / "again").samples["force"].stream.turn_sd == force.stream.turn_sd
    )
    assert (
        run(tmp_path, "\n".join([f"{lines[0]},down", *(f"{line},+x" for line in lines[1:])])) == 2
    )
    assert "tells where down was twice" in capsys.readouterr().err


def _swapped(old: str, new: str) -> Callable[[str], str]:
    return lambda text: text.replace(old, new)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: "", "loads.csv holds no loads"),
        (lambda text: text.split("500,")[0].rsplit("\n", 1)[0], ""),
        (lambda text: "\n".join(text.splitlines()[:6]), "5 known loads are too few"),
        (
            _swapped("mass [g]", "mass [stone]"),
            "mass has the unknown unit 'stone'; write it as mass [kg] or mass [g]",
        ),
        (_swapped("mass [g]", "mass"), "mass has no unit"),
        (_swapped("mass [g],down", "grams,up"), "tells no loads; tell loads as mass"),
        (_swapped("down", "place"), "does not say where down was"),
        (_swapped("+y", "left"), "line 5: down is 'left'; it is +x"),
        (_swapped("f2 [V]", "f1 [V]"), "two columns have the same name"),
        (_swapped("f2 [V]", "f2"), "if f2 is a channel, write its unit behind it, such as f2 [V]"),
        (_swapped(",-", ",\N{MINUS SIGN}"), ""),
        (_swapped(" [V]", ""), "has no channels of the sensor"),
        (
            _swapped("200,+x", "200"),
            "line 3: wrong number of columns, 5; the header names 6; leave a cell empty",
        ),
        (
            _swapped("500,-z", "heavy,-z"),
            "line 14: mass is 'heavy', which is no number; write the number alone",
        ),
        (
            _swapped("-z", "+z"),
            "line 13 and line 14 of the table contradict each other; look at both",
        ),
    ],
)
def test_what_is_wrong_with_a_table_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], change: Callable[[str], str], said: str
) -> None:
    code = run(tmp_path, change(table()))
    errors = capsys.readouterr().err
    assert code == (2 if said else 0)
    assert not said or said in errors, errors
    assert "Traceback" not in errors
    assert (tmp_path / "setup.json").exists() == (not said)


@pytest.mark.parametrize(
    ("files", "said"),
    [
        (lambda setup: raw_dataset(setup, "mV"), "channel f1 is in 'mV', its calibration in 'V'"),
        (
            lambda setup: with_text(
                raw_dataset(setup), "_tracksys-force_channels.tsv", lambda t: t.replace("f2", "g2")
            ),
            "thumb_tip_force has no channel f2",
        ),
        (
            lambda setup: with_sidecar(dataset(), "force", ForceSetup=setup),
            "no channels.tsv has them",
        ),
        (
            lambda setup: with_sidecar(dataset(), "force", ForceSetup={"elbow": {}}),
            "ForceSetup names elbow",
        ),
        (
            lambda setup: with_sidecar(dataset(), "force", ForceSetup={"thumb_tip_force": 3}),
            "ForceSetup of thumb_tip_force is no object",
        ),
        (lambda setup: _broken(setup, scale_sd=-1), "scale_sd is -1"),
        (lambda setup: _broken(setup, scale_sd="much"), "scale_sd has to be finite numbers (one)"),
        (lambda setup: _broken(setup, turn_sd=20), "turn_sd is 20; it is an angle"),
        (
            lambda setup: _broken(setup, matrix=[[1, 0], [0, 1]]),
            "matrix has to be finite numbers (3 by 3)",
        ),
        (lambda setup: _broken(setup, offset=None), "offset has to be finite numbers (3)"),
        (lambda setup: _broken(setup, channels=["f1"]), "channels are objects with name and units"),
    ],
)
def test_a_setup_that_does_not_belong_to_the_recording_is_refused(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    files: Callable[[dict[str, object]], Files],
    said: str,
) -> None:
    assert run(tmp_path, table()) == 0
    setup = json.loads((tmp_path / "setup.json").read_text())["ForceSetup"]
    path = folder(files(setup), tmp_path / "raw")
    assert main(["info", str(path)]) == 2
    assert said in capsys.readouterr().err


def _broken(setup: dict[str, object], **changes: object) -> Files:
    entry = setup["thumb_tip_force"]
    assert isinstance(entry, dict)
    return raw_dataset({"thumb_tip_force": {**entry, **changes}})


def test_a_file_that_cannot_take_the_setup_in_is_left_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "setup.json").write_text("notes")
    assert run(tmp_path, table()) == 2
    assert "is no JSON" in capsys.readouterr().err
    assert (tmp_path / "setup.json").read_text() == "notes"
