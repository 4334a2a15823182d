"""The command line as a person uses it: what it writes, what it says, how it ends."""

import argparse
import ast
import json
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from handscope.app.cli import VERBS, main
from handscope.estimators.data.options import describe
from handscope.estimators.hand.anatomy import DOF_NAMES
from handscope.estimators.methods import METHODS
from handscope.sessions.formats import recordings as formats_recordings


@pytest.fixture(scope="module")
def processed(simulated: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the derivative that m2 made of it."""
    folder = tmp_path_factory.mktemp("processed")
    assert main(["process", str(simulated), "--method", "m2", "--out", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("simulated") / "tapping.zip"
    assert main(["simulate", "tapping", "--out", str(path), "--seed", "4", "--hand", "right"]) == 0
    return path


def table(folder: Path, name: str) -> tuple[list[str], np.ndarray]:
    """Column names and values of a derivative."""
    motion = next(folder.rglob(f"*{name}*_motion.tsv"))
    channels = (
        motion.with_name(motion.name.replace("_motion.tsv", "_channels.tsv"))
        .read_text()
        .splitlines()[1:]
    )
    return [line.split("\t")[0] for line in channels], np.genfromtxt(
        motion, delimiter="\t", missing_values="n/a"
    )


def refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line on standard error of a command that ends with exit code 2."""
    try:
        code = main(words)
    except SystemExit as leaving:
        code = int(leaving.code or 0)
    captured = capsys.readouterr()
    assert code == 2
    assert captured.err.count("\n") == 1
    assert "Traceback" not in captured.err
    return captured.err


def test_a_time_limit_ends_in_a_sentence_and_leaves_nothing(
    simulated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["process", str(simulated), "--out", str(tmp_path), "--time-limit"]
    assert "0.001 s were not enough" in refused([*words, "0.001"], capsys)
    assert "leaves no time" in refused([*words, "0"], capsys)
    assert list(tmp_path.iterdir()) == []


def test_process_writes_the_derivative_of_the_contract(simulated: Path, processed: Path) -> None:
    columns, values = table(processed, "desc-m2")
    assert columns[0] == "time"
    assert columns[1 : 1 + len(DOF_NAMES)] == list(DOF_NAMES)
    assert {"index_tip_x", "thumb_tip_z", "hand_quat_w", "little_distal_quat_z"} <= set(columns)
    assert len(values) == len(formats_recordings.load(simulated).samples["imu"].t)
    sidecar = json.loads(next(processed.rglob("*desc-m2_motion.json")).read_text())
    assert {
        "method",
        "parameters",
        "software_version",
        "input_checksum",
        "calibration_quality",
        "warnings",
    } <= set(sidecar)
    assert sidecar["method"] == "m2"
    calibration = json.loads(next(processed.rglob("*desc-m2_calibration.json")).read_text())
    assert {"segment_lengths", "sensor_to_segment", "gyr_bias", "acc_bias"} <= set(calibration)
    assert calibration["segment_lengths"]["index_middle"]["value"] == pytest.approx(
        0.0237, abs=0.002
    )
    assert np.linalg.norm(
        calibration["sensor_to_segment"]["index_middle"]["q_BS"]
    ) == pytest.approx(1.0)


def test_what_is_processed_is_near_the_truth_that_lies_beside_it(
    simulated: Path, processed: Path, tmp_path: Path
) -> None:
    import zipfile

    with zipfile.ZipFile(simulated) as archive:
        archive.extractall(tmp_path / "in")
    columns, found = table(processed, "desc-m2")
    names, truth = table(tmp_path / "in" / "derivatives", "desc-truth")
    tips = [c for c in columns if "_tip_" in c and not c.endswith("_sd")]
    assert len(tips) == 15
    error = found[:, [columns.index(c) for c in tips]] - truth[:, [names.index(c) for c in tips]]
    assert np.sqrt((error**2).mean()) < 0.006  # m, with sensors 5 deg off and biased


def test_assess_refuses_a_place_that_cannot_be_written_before_it_writes_anything(
    simulated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "folder.pdf").mkdir()
    (tmp_path / "file").touch()
    before = set(tmp_path.rglob("*"))
    for out, report, sentence in (
        ("out", "missing/r.pdf", "there is no folder"),
        ("out", "folder.pdf", "is a folder"),
        ("out", "file/r.pdf", "there is no folder"),
        ("file", "r.pdf", "is a file; --out names a folder"),
        ("file/out", "r.pdf", "cannot be made"),
    ):
        words = [
            "assess",
            str(simulated),
            "--out",
            str(tmp_path / out),
            "--report",
            str(tmp_path / report),
        ]
        assert sentence in refused(words, capsys)
        assert set(tmp_path.rglob("*")) == before


def test_assess_may_put_the_report_into_the_folder_that_it_makes(
    simulated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["assess", str(simulated), "--out", str(out), "--report", str(out / "r.pdf")]) == 0
    assert {p.name for p in out.iterdir()} == {"figures.json", "figures.csv", "r.pdf"}
    assert "figures of 1 measure: " in capsys.readouterr().out


def test_assess_counts_the_taps_that_were_simulated(simulated: Path, tmp_path: Path) -> None:
    assert (
        main(
            ["assess", str(simulated), "--out", str(tmp_path), "--report", str(tmp_path / "r.pdf")]
        )
        == 0
    )
    figures = json.loads((tmp_path / "figures.json").read_text())
    text = json.dumps(figures)
    assert "tapping_count" in text
    assert (tmp_path / "r.pdf").read_bytes().startswith(b"%PDF")
    csv = (tmp_path / "figures.csv").read_text()
    count = next(line for line in csv.splitlines() if "tapping_count" in line)
    assert ",37" in count


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(tmp_path: Path) -> None:
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        assert (
            main(["simulate", "rest", "--out", str(tmp_path / f"{name}.zip"), "--seed", str(seed)])
            == 0
        )
    a, b, c = ((tmp_path / f"{name}.zip").read_bytes() for name in "abc")
    assert a == b != c


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["process", "nothere", "--out", "x"], "nothere does not exist"),
        (
            ["process", "RECORDING", "--out", "x", "--method", "zz"],
            "there is no method 'zz'; methods are b, m1, m2",
        ),
        (
            ["process", "RECORDING", "--out", "x", "--option", "speed=3"],
            "there is no option 'speed'",
        ),
        (
            ["process", "RECORDING", "--out", "x", "--option", "tau_acc"],
            "not of the form key=value",
        ),
        (
            ["process", "RECORDING", "--out", "x", "--option", "tau_acc=fast"],
            "option tau_acc is 'fast'; it is a number in s",
        ),
        (
            ["process", "RECORDING", "--out", "x", "--option", "tau_acc=nan"],
            "it is between 0.01 and",
        ),
        (
            ["process", "RECORDING", "--out", "x", "--option", "rest_bias=perhaps"],
            "it is true or false",
        ),
        (
            ["process", "RECORDING", "--out", "x", "--hand", "left"],
            "recorded on the right hand, not on the left one",
        ),
        (["process", "RECORDING", "--out", "RECORDING"], "is a file; --out names a folder"),
        (["process", "RECORDING"], "the following arguments are required: --out"),
        (["assess", "RECORDING", "--out", "x", "--report", "r.doc"], "does not end in .pdf"),
        (["simulate", "juggle", "--out", "x.zip"], "there is no task 'juggle' to simulate"),
        (["simulate", "rest", "--out", "x"], "does not end in .zip"),
        (["simulate", "rest", "--out", "nowhere/x.zip"], "cannot be written"),
        (
            ["learn-magnet", "RECORDING", "--out", "x.json"],
            "cannot be learnt from this recording: it has no magnetometers on the trunk",
        ),
        (
            ["learn-magnet", "RECORDING", "--out", "x.json", "--moment-error", "5"],
            "option moment is '5.0'; it is between 0.001 and 0.5",
        ),
        (["bench", "everything"], "there is no benchmark 'everything'"),
        (["glove", "--pty", "x", "--strips", "toe"], "unknown strip 'toe'"),
        (["glove", "--pty", "x", "--task", "juggle"], "there is no task 'juggle'"),
        (["glove", "--pty", "x", "--loss", "2"], "not between 0 and 1"),
        (["glove", "--pty", "x", "--rate", "fast"], "not a number of Hz"),
        (["glove", "--pty", "x", "--pull", "index"], "not of the form STRIP@SECONDS"),
        (
            ["glove", "--pty", "x", "--pull", "toe@1"],
            "--pull names the strip 'toe'; this glove has hand, forearm, thumb,",
        ),
        (["glove", "--pty", "x", "--seed", "-1"], "-1 is no whole number from 0 on"),
        (["glove", "--pty", "RECORDING"], "exists already; choose another --pty"),
        (["simulate", "rest", "--out", "x.zip", "--seed", "-1"], "-1 is no whole number from 0 on"),
        (["record", "nothere", "--out", "x.mcap"], "is the glove plugged in?"),
        (["record", "nothere", "--out", "x"], "must be a new file that ends in .mcap"),
        (["login", "--data", "nothere"], "no server has run on the data folder"),
        (["serve", "--port", "99999", "--data", "x"], "outside 0 to 65535"),
        (["serve", "--host", "192.0.2.1", "--data", "x"], "cannot listen on 192.0.2.1"),
        (["juggle"], "invalid choice: 'juggle'"),
        ([], "required: VERB"),
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(
    words: list[str],
    sentence: str,
    simulated: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    told = refused([str(simulated) if w == "RECORDING" else w for w in words], capsys)
    assert sentence in told
    assert not any(tmp_path.rglob("*motion*"))  # nothing half-written stays


@pytest.mark.parametrize("words", ["--method {} --help", "--help --method={}"])
def test_help_of_process_documents_every_option_of_the_method_asked_for(
    words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, method in METHODS.items():
        with pytest.raises(SystemExit):
            main(["process", *words.format(name).split()])
        told = capsys.readouterr().out
        titles, _, options = told.partition(f"options of {name}:")
        assert all(f"{other}: {m.TITLE}" in titles for other, m in METHODS.items())
        listed = [line.split("=")[0].strip() for line in options.strip().splitlines()]
        assert listed == [option.name for option in describe(method.Params)]
        assert all(option.source in options for option in describe(method.Params))


def test_a_reader_that_leaves_ends_a_command_without_a_traceback(simulated: Path) -> None:
    words = [sys.executable, "-m", "handscope.app.cli", "info", str(simulated)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as program:
        assert program.stdout is not None
        assert program.stderr is not None
        program.stdout.close()
        said = program.stderr.read()
    assert (program.returncode, said) == (141, b"")


def test_a_report_has_the_date_of_the_recording_and_never_that_of_processing(
    simulated: Path, tmp_path: Path
) -> None:
    words = ["assess", str(simulated), "--method", "m2", "--out", str(tmp_path)]
    assert main(words) == 0
    assert json.loads((tmp_path / "figures.json").read_text())["session"]["date"] is None


def test_the_demonstration_keeps_its_patient_away_from_those_of_the_clinic(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("HANDSCOPE_DATA", raising=False)

    def folder(verb: str, *words: str) -> Path:
        parser = argparse.ArgumentParser()
        import_module(f"handscope.app.commands.{verb}").add(parser)
        return Path(parser.parse_args(words).data)

    assert (folder("serve"), folder("demo")) == (
        tmp_path / "handscope-data",
        tmp_path / "handscope-demo",
    )
    assert folder("login") == folder("serve")
    monkeypatch.setenv("HANDSCOPE_DATA", "elsewhere")
    assert {folder(verb) for verb in ("serve", "demo", "login")} == {Path("elsewhere")}
    assert folder("demo", "--data", "here") == Path("here")


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as leaving:
        main([verb, "--help"])
    assert leaving.value.code == 0
    assert f"handscope {verb}" in capsys.readouterr().out


def test_the_command_line_starts_as_a_program() -> None:
    done = subprocess.run(
        [sys.executable, "-P", "-m", "handscope.app.cli", "process", "nothere", "--out", "x"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)


def test_a_command_reckons_in_one_thread_unless_told_otherwise() -> None:
    """Matrices are small: a whole hand's self-calibration took more than five minutes by two threads, and two by one."""
    command = "from handscope.app.cli import main; main(['process', 'nothere', '--out', 'x']); import numpy, threadpoolctl; print([p['num_threads'] for p in threadpoolctl.threadpool_info()])"
    alone = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
    done = subprocess.run(
        [sys.executable, "-c", command], capture_output=True, text=True, check=True, env=alone
    )
    assert set(ast.literal_eval(done.stdout)) == {1}


def test_export_writes_the_movement_as_one_page(
    simulated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", str(simulated)]) == 2
    assert "--replay FILE.html" in capsys.readouterr().err
    assert (
        main(
            [
                "export",
                str(simulated),
                "--replay",
                str(tmp_path / "r.html"),
                "--title",
                "Figure <2>",
            ]
        )
        == 0
    )
    assert "<h1>Figure &lt;2&gt;</h1>" in (tmp_path / "r.html").read_text("utf-8")
    assert main(["export", str(simulated), "--replay", str(tmp_path)]) == 2


def test_info_and_export_open_what_was_exported(
    simulated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        main(["export", str(simulated), "--out", str(tmp_path / "again.zip"), "--subject", "A1"])
        == 0
    )
    assert main(["info", str(tmp_path / "again.zip")]) == 0
    told = capsys.readouterr().out
    assert "right hand" in told
    assert "initial_pose" in told
    before, after = (
        formats_recordings.load(simulated),
        formats_recordings.load(tmp_path / "again.zip"),
    )
    np.testing.assert_array_equal(before.samples["imu"].values, after.samples["imu"].values)


def test_ctrl_c_before_a_command_has_begun_ends_it_without_a_traceback(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its modules take seconds to be read on a busy machine."""

    def interrupted(name: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("handscope.app.cli.import_module", interrupted)
    assert main(["info", "nothing"]) == 130
