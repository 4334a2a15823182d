"""`handscope compare` as a person uses it: known offsets and lags come back, every kind of input is taken, mistakes are one line."""

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.app.report.sections import agreement_plot
from handscope.estimators.data.samples import Event
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import ANGLES, FINGERS, JOINTS, SEGMENT, SEGMENTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.formats.qualisys import read_markers
from handscope.sessions.motion_bids import kinematics
from tests.app.commands.test_commands import refused
from tests.estimators.measures.movements import movement
from tests.sessions.formats.test_c3d import written
from tests.sessions.formats.test_landmarks import as_json, drawn
from tests.sessions.motion_bids.test_kinematics import Column, table
from tests.simulated import DEG

PILLOW = Path(__file__).parents[2] / "estimators" / "simulation" / "pillow_grasp.tsv.gz"
DOFS = [(joint.name, ANGLES[a]) for joint in JOINTS for a in joint.dofs]


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("simulated") / "tapping.zip"
    assert (
        main(
            ["simulate", "tapping", "--out", str(path), "--seed", "4", "--hand", "right", "--ideal"]
        )
        == 0
    )
    return path


@pytest.fixture(scope="module")
def truth(simulated: Path) -> Path:
    with zipfile.ZipFile(simulated) as archive:
        archive.extractall(simulated.parent / "unpacked")
    return simulated.parent / "unpacked" / "derivatives" / "truth"


def angles(
    folder: Path, t: np.ndarray, values: np.ndarray, events: tuple[Event, ...] = (), **sidecar: Any
) -> Path:
    """A table of all joint angles (n, 23) rad."""
    columns: list[Column] = [("time", "n/a", "LATENCY", "n/a", "s", t)]
    columns += [(f"{j}_{a}", "n/a", "JNTANG", j, "rad", v) for (j, a), v in zip(DOFS, values.T)]
    table(folder, columns, **({"MeasuredHand": "left"} | sidecar))
    if events:
        rows = [
            f"{e.onset}\t{e.duration}\t{e.trial_type}\t{e.details['task_name']}" for e in events
        ]
        (folder / "sub-01" / "motion" / "sub-01_task-x_events.tsv").write_text(
            "\n".join(["onset\tduration\ttrial_type\ttask_name", *rows]) + "\n"
        )
    return folder


def compared(
    words: list[str], out: Path, draws: bool = False
) -> tuple[dict[str, Any], dict[tuple[str, str], dict[str, Any]]]:
    """What comparison.json says, and its agreements by task and name; a plot of all joints takes as long as all the rest."""
    with pytest.MonkeyPatch.context() as patch:
        if not draws:
            patch.setattr(agreement_plot, "agreement_chart", lambda *given: b"")
        assert main(["compare", *words, "--out", str(out)]) == 0
    told = json.loads((out / "comparison.json").read_text())
    return told, {(g["task"], g["name"]): g for g in told["agreements"]}


def test_a_known_lag_and_known_offsets_come_back(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    move, offsets = movement(1, len(DOFS)), np.linspace(-10, 10, len(DOFS)) * DEG
    t_a, t_b = np.arange(0, 30, 0.01), np.arange(0, 31, 1 / 64)
    events = (
        Event(5.0, 4.0, "task", {"task_name": "one"}),
        Event(12.0, 4.0, "task", {"task_name": "two"}),
    )
    a = angles(tmp_path / "a", t_a, move(t_a), events)
    b = angles(tmp_path / "b", t_b + 100.0, move(t_b - 1.234) + offsets)
    told, found = compared([str(a), str(b)], tmp_path / "out")
    assert told["lag"]["seconds"] == pytest.approx(-101.234, abs=1e-4)
    assert told["lag"]["how"] == "cross-correlation"
    assert told["lag"]["rival"] is None
    for task in ("whole recording", "one", "two"):
        for (joint, angle), offset in zip(DOFS, offsets):
            g = found[task, f"{joint}_{angle}"]
            assert g["offset"] == pytest.approx(offset, abs=1e-3 * DEG)
            assert g["drms"] == pytest.approx(abs(offset), abs=0.05 * DEG)
            assert g["drms_minus_offset"] < 0.05 * DEG
            assert abs(g["drom"]) < 0.2 * DEG
    printed = capsys.readouterr().out
    assert "A's time = B's time - 101.2340 s; correlation 1.000" in printed
    assert "two, 12.0 to 16.0 s" in printed
    lines = [
        line.split(",")
        for line in (tmp_path / "out" / "comparison.csv").read_text().splitlines()
        if not line.startswith("#")
    ]
    row = dict(zip(lines[0], next(line for line in lines if line[3] == "index_pip_flexion")))
    assert row["unit"] == "deg"
    assert float(row["offset"]) == pytest.approx(
        offsets[DOFS.index(("index_pip", "flexion"))] / DEG, abs=1e-3
    )


def test_a_clock_that_drifts_is_told_and_corrected(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A at 50 Hz, B at 64 Hz 250 ppm fast; either order of the files."""
    move = movement(1, len(DOFS))
    t_a, t_b = np.arange(0, 40, 0.02), np.arange(0, 40, 1 / 64)
    a = angles(tmp_path / "a", t_a, move(t_a))
    event = Event(20.0 * 1.00025, 10.0 * 1.00025, "task", {"task_name": "one"})
    b = angles(tmp_path / "b", t_b * 1.00025, move(t_b), (event,))
    for words, drift in (([str(a), str(b)], 250e-6), ([str(b), str(a)], -250e-6)):
        told, found = compared(words, tmp_path / "out")
        assert told["lag"]["seconds"] == pytest.approx(0.0, abs=2e-4)
        assert told["lag"]["drift"]["value"] == pytest.approx(drift, abs=5e-6)
        assert max(g["drms"] for g in found.values()) < 0.2 * DEG
    printed = capsys.readouterr().out
    assert "ppm fast; corrected, at A's 40.0 s the lag is - 0.0100 s" in printed
    assert "ppm slow; corrected, at A's 40.0 s the lag is + 0.0100 s" in printed
    assert (
        printed.count("one, 20.0 to 30.0 s") == 2
    )  # by the clock that is right, and 20.005 to 30.005 s by the other one


def test_method_against_method_on_one_recording(simulated: Path, tmp_path: Path) -> None:
    told, found = compared(
        [str(simulated), str(simulated), "--method-a", "m2", "--method-b", "b"],
        tmp_path,
        draws=True,
    )
    assert (told["lag"]["seconds"], told["lag"]["how"]) == (0.0, "one recording, one clock")
    assert (told["a"]["source"], told["b"]["source"]) == ("by m2", "by b")
    assert {"index_mcp_flexion", "wrist_deviation", "thumb_index_distance"} <= {
        name for task, name in found if task == "tapping"
    }
    assert {c["segment"] for c in told["a"]["gyroscope_consistency"]} == set(SEGMENTS)
    assert (tmp_path / "bland_altman.svg").read_text().count("index pip flexion, deg") == 1


def test_a_recording_against_its_derivative_and_against_the_truth(
    simulated: Path, truth: Path, tmp_path: Path
) -> None:
    assert (
        main(
            [
                "process",
                str(simulated),
                "--method",
                "m2",
                "--option",
                "gyr_reading=instant",
                "--out",
                str(tmp_path / "m2"),
            ]
        )
        == 0
    )
    told, found = compared(
        [
            str(simulated),
            str(tmp_path / "m2"),
            *("--method-a", "m2", "--option-a", "gyr_reading=instant"),
        ],
        tmp_path / "x",
    )
    assert (told["lag"]["seconds"], told["lag"]["correlation"]) == pytest.approx(
        (0.0, 1.0), abs=1e-5
    )
    assert max(g["drms"] for g in found.values()) < 1e-4
    told, found = compared([str(truth), str(tmp_path / "m2")], tmp_path / "y")
    assert told["lag"]["seconds"] == pytest.approx(0.0, abs=1e-3)
    assert max(g["drms"] for g in found.values() if g["unit"] == "rad") < 1 * DEG
    assert found["whole recording", "thumb_index_distance"]["drms"] < 0.002
    assert told["tips"]["frame"] == "wrist"
    whole = [e for e in told["tips"]["errors"] if e["task"] == "whole recording"]
    assert [e["finger"] for e in whole] == list(FINGERS)
    assert all(0 < e["mean"] <= e["rmse"] <= e["largest"] < 0.005 for e in whole)


def test_markers_of_a_c3d_file_against_the_recording(
    simulated: Path, truth: Path, tmp_path: Path
) -> None:
    """Clusters that turn as the true segments do; the system's clock starts 1.5 s later and it runs at 80 Hz."""
    files, tables, _ = kinematics.tables_at(truth)
    moved = kinematics.load(files, tables[0]).trajectory
    assert moved is not None
    markers, names = clusters(moved, 1.5, 80.0)
    optical = written(tmp_path / "optical.c3d", 1e3 * markers, names, "mm", 80.0)
    pose = formats_recordings.load(simulated).of_type("initial_pose")[0]
    still = f"{pose.onset - 1.5}:{pose.end - 1.5}"  # by the system's clock
    told, found = compared(
        [str(simulated), str(optical), "--static-b", still, "--option-a", "gyr_reading=instant"],
        tmp_path / "out",
    )
    assert told["lag"]["seconds"] == pytest.approx(1.5, abs=2e-3)
    angles_found = [g for (task, name), g in found.items() if task == "tapping"]
    assert len(angles_found) == len(DOFS)
    assert max(g["drms"] for g in angles_found) < 1 * DEG
    assert {r["segment"] for r in told["b"]["marker_rigidity"]} == set(SEGMENTS)
    assert max(r["movement_max"] for r in told["b"]["marker_rigidity"]) < 1e-5


def clusters(moved: Trajectory, start: float, rate: float) -> tuple[np.ndarray, tuple[str, ...]]:
    t = np.arange(start, moved.t[-1], 1 / rate)
    rng, places = np.random.default_rng(0), []
    after = np.clip(np.searchsorted(moved.t, t), 1, len(moved.t) - 1)
    weight = (t - moved.t[after - 1]) / (moved.t[after] - moved.t[after - 1])
    for k in range(len(SEGMENTS)):
        q = quat.slerp(moved.q_GS[after - 1, k], moved.q_GS[after, k], weight)
        centre = np.array(
            [0, -0.03 * ((k - 2) % 3) if k > 1 else 0.1 * (2 - k), 0]
        )  # y is proximal on the right hand
        root = quat.rotate(moved.q_GS[100, SEGMENT["hand"]], centre)
        around = rng.normal(scale=0.02, size=(3, 3))
        places += [
            root + quat.rotate(q, at) for at in around - around.mean(axis=0)
        ]  # the clusters' centres tell where the fingers point
    return np.stack(places, axis=1), tuple(f"{s}_{m}" for s in SEGMENTS for m in (1, 2, 3))


def test_real_fingertips_of_an_optical_system_against_a_glove_that_moves_likewise(
    tmp_path: Path,
) -> None:
    """A hand grasps a pillow (Fabisch et al. 2022); the model hand follows its markers, 7.0 s later by the clock of its recording."""
    zipped, real = tmp_path / "glove.zip", read_markers(PILLOW)
    assert (
        main(
            [
                "simulate",
                "captured",
                "--markers",
                str(PILLOW),
                "--hand",
                "right",
                "--out",
                str(zipped),
                "--ideal",
            ]
        )
        == 0
    )
    columns: list[Column] = [("time", "n/a", "LATENCY", "n/a", "s", real.t)]
    for finger in ("thumb", "index"):
        place = 1e3 * real.fingers[:, FINGERS.index(finger), 1]
        columns += [
            (f"{finger}_{c}", c, "POS", f"{finger}_tip", "mm", place[:, k])
            for k, c in enumerate("xyz")
        ]
    told, found = compared(
        [str(zipped), str(table(tmp_path / "optical", columns))], tmp_path / "out"
    )
    assert told["lag"]["seconds"] == pytest.approx(
        7.0, abs=0.02
    )  # the movement was smoothed to 6 Hz
    assert told["lag"]["correlation"] > 0.99
    (g,) = (g for (task, _), g in found.items() if task == "whole recording")
    assert (g["name"], g["unit"]) == ("thumb_index_distance", "m")
    assert told["tips"]["frame"] == "best fit"  # nobody says where the wrist is
    assert (
        g["drms_minus_offset"] < 0.004
    )  # the offset is where the markers sit: on nails, not at the ends of bones


@pytest.mark.parametrize("name", ["p.png", "p.pdf"])
def test_the_plot_is_written_in_the_form_that_its_name_says(name: str, tmp_path: Path) -> None:
    t = np.arange(0, 10, 0.02)
    a = angles(tmp_path / "a", t, movement(3, 2)(t))  # of two joint angles: each is a plot
    assert main(["compare", str(a), str(a), "--plot", str(tmp_path / name)]) == 0
    begins = {"p.png": b"\x89PNG", "p.pdf": b"%PDF"}[name]
    assert (tmp_path / name).read_bytes().startswith(begins)


def test_mistakes_are_one_line_and_nothing_is_written(
    simulated: Path, truth: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    t = np.arange(0, 20, 0.01)
    one, two = (
        str(angles(tmp_path / name, t, movement(seed, len(DOFS))(t)))
        for name, seed in (("one", 1), ("two", 2))
    )
    still = str(angles(tmp_path / "still", t, np.zeros((len(t), len(DOFS)))))
    none = str(table(tmp_path / "none", [("x", "x", "POS", "elbow", "m", t)], MeasuredHand="left"))
    few = str(
        table(
            tmp_path / "few",
            [("thumb_ip_flexion", "n/a", "JNTANG", "thumb_ip", "rad", t)],
            MeasuredHand="left",
        )
    )
    other = str(
        table(
            tmp_path / "other",
            [("index_pip_flexion", "n/a", "JNTANG", "index_pip", "rad", t)],
            MeasuredHand="left",
        )
    )
    sideless = str(
        table(
            tmp_path / "sideless", [("index_pip_flexion", "n/a", "JNTANG", "index_pip", "rad", t)]
        )
    )
    nameless = str(
        written(
            tmp_path / "nameless.c3d",
            np.random.default_rng(0).normal(size=(400, 3, 3)),
            ("a", "b", "c"),
        )
    )
    before = set(tmp_path.rglob("*"))
    capsys.readouterr()
    for words, sentence in (
        ([one, two], "do not fit each other at any lag"),
        ([one, still], "nothing moves in the channels that both recordings hold in B"),
        ([one, one, "--lag", "50"], "do not overlap at a lag of 50 s"),
        ([one, one, "--lag", "nan"], "--lag is a number of seconds"),
        ([one, str(simulated)], "A is of the left hand, B of the right one"),
        ([one, none], "holds nothing of a hand"),
        ([few, other], "have no joint in common"),
        ([sideless, sideless], "neither recording says which hand was measured"),
        ([one, nameless], "the markers give no joint"),
        ([one, "nothere"], "nothere does not exist"),
        ([one, "nothere.c3d"], "nothere.c3d does not exist"),
        ([one, two, "--method-b", "m2"], "is no raw recording"),
        (
            [one, one, "--static-a", "0:1"],
            "tells joint angles; --static-a is for markers and orientations",
        ),
        ([one, nameless, "--static-b", "3"], "--static-b '3' is not of the form START:STOP"),
        ([str(truth), str(truth), "--wrist-a", "0:3"], "tells its fingertips in the wrist's frame"),
        ([one, one, "--wrist-b", "0:3"], "no fingertip is seen while the wrist moves"),
        ([str(simulated), str(simulated), "--method-b", "zz"], "there is no method 'zz'"),
        ([str(simulated), str(simulated), "--option-b", "speed=3"], "there is no option 'speed'"),
        ([one, one, "--plot", "p.doc"], "does not end in .svg or .png or .pdf"),
        ([one, one, "--out", str(simulated)], "is a file; --out names a folder"),
        ([one], "the following arguments are required: B"),
    ):
        assert sentence in refused(
            ["compare", *words, *([] if "--out" in words else ["--out", str(tmp_path / "made")])],
            capsys,
        ), words
        assert set(tmp_path.rglob("*")) == before


def test_camera_landmarks_are_a_reference_whose_limits_are_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The camera's clock reads 2.4 s more, and it sees the joints to about 1 mm."""
    t, angles_a, places = drawn("left", 600, 2)
    dofs = [(k, a) for k, joint in enumerate(JOINTS) for a in joint.dofs]
    a = angles(tmp_path / "a", t, angles_a[:, [k for k, _ in dofs], [a for _, a in dofs]])
    seen = places + np.random.default_rng(3).normal(0, 0.001, places.shape)
    (tmp_path / "camera.json").write_text(as_json(t + 2.4, seen))
    told, found = compared([str(a), str(tmp_path / "camera.json")], tmp_path / "out")
    assert told["lag"]["seconds"] == pytest.approx(-2.4, abs=0.005)
    assert told["b"]["source"] == "camera landmarks"
    lengths = sized("left").lengths
    for finger in FINGERS[1:]:
        g = found["whole recording", f"{finger}_pip_flexion"]
        a_, b_ = (1 / lengths[f"{finger}_{phalanx}"] for phalanx in ("proximal", "middle"))
        sd = 0.001 * np.sqrt(a_**2 + b_**2 + (a_ + b_) ** 2)  # three points, two bones
        assert g["drms"] == pytest.approx(sd, rel=0.1)
        assert abs(g["offset"]) < 4 * sd / np.sqrt(600)
    assert "warning: B: camera landmarks are a coarse reference" in capsys.readouterr().out
    words = ["compare", str(a), str(tmp_path / "camera.json")]
    assert "nothing to align" in refused([*words, "--static-b", "0:1"], capsys)
    assert "no raw recording" in refused([*words, "--method-b", "m2"], capsys)
