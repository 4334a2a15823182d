"""Whole live sessions without pages: of a small glove, and of one in the network that is gone for a while."""

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.app.live.station import Station
from handscope.app.live.wizard.machine import State
from handscope.app.protocols import load_all
from handscope.app.workers.turns import Turns
from handscope.estimators.hand.anatomy import FINGERS
from handscope.sessions.formats import recordings as formats_recordings
from tests.app.devices.test_network_ports import glove_behind_tcp
from tests.app.devices.virtual import virtual_glove, wait_for
from tests.app.live.test_live_numbers import numbers, setup_of

WRIST = "rom_wrist_flexion"


@pytest.fixture
def station_at(tmp_path: Path) -> Callable[[str], Station]:
    """A station of the left hand at a port; not entered yet."""
    known = {p.name: p for p in load_all().values()}
    short = replace(known[WRIST], duration=4.0, repetitions=None, cycle=(), countdown=0.5)
    protocols = tuple({**known, WRIST: short}.values())

    def made(port: str) -> Station:
        setup = replace(setup_of(tmp_path), port=port, protocols=protocols)
        return Station("test", setup, lambda _: None, Turns())

    return made


def calibrate(station: Station) -> None:
    wait_for(lambda: "continue" in station.snapshot()["wizard"]["actions"])
    station.act("continue")
    station.act("start")
    wait_for(lambda: station._wizard.state is State.POSE_REVIEW)
    station.act("accept")


@pytest.mark.slow
def test_a_glove_of_hand_and_forearm_measures_the_wrist(
    station_at: Callable[[str], Station], tmp_path: Path
) -> None:
    with (
        virtual_glove(tmp_path / "glove", "--strips", "forearm", "--rate", "50") as port,
        station_at(str(port)) as station,
    ):
        wait_for(lambda: "continue" in station.snapshot()["wizard"]["actions"])
        first = station.snapshot()
        assert first["glove"]["expected"] == ["forearm", "hand"]
        assert "wrist" in first["wizard"]["instruction"]
        calibrate(station)
        offered = {g["name"] for g in station.snapshot()["wizard"]["groups"]}
        assert not offered & {"tapping", "pinch", "powerglove", "repeatability"}
        station.act("choose", WRIST)
        station.act("start")
        wait_for(lambda: station._wizard.state is State.TASK_REVIEW)
        assert station.curve.what == "wrist_flexion" and len(station.curve.attempted()) > 100
        station.act("accept")
    out = tmp_path / "assessed"
    assert main(["assess", str(station.setup.recording), "--out", str(out)]) == 0
    lines = (out / "figures.csv").read_text().splitlines()
    figures = [line for line in lines if not line.startswith("#")]
    assert any("wrist_flexion_range" in line for line in figures)
    assert not any(finger in line for line in figures for finger in FINGERS)


@pytest.mark.slow  # test_live_numbers.py holds the rule, without a glove
def test_taps_counted_at_the_station_are_those_of_the_result(
    station_at: Callable[[str], Station], tmp_path: Path
) -> None:
    with virtual_glove(tmp_path / "glove") as port, station_at(str(port)) as station:
        calibrate(station)
        station.act("choose", "tapping")
        station.act("start")
        wait_for(lambda: station._wizard.state is State.TASK_REVIEW)
        while_it_ran = numbers(station)["taps"]
        wait_for(lambda: station.trial.number > 0)
        shown = numbers(station)["taps"]
        station.act("accept")
    out = tmp_path / "assessed"
    words = ["assess", str(station.setup.recording), "--method", "m2", "--out", str(out)]
    assert main(words) == 0
    lines = (out / "figures.csv").read_text().splitlines()
    table = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    (counted,) = [float(row["value"]) for row in table if row["name"] == "tapping_count"]
    assert shown == counted > 10
    assert 0 <= counted - while_it_ran <= 1  # the last one was not seen to end


@pytest.mark.parametrize("outage", [2.0, pytest.param(30.0, marks=pytest.mark.slow)])
def test_a_network_glove_comes_back_in_the_same_session_with_a_gap_in_the_recording(
    outage: float, station_at: Callable[[str], Station]
) -> None:
    with (
        glove_behind_tcp("--rate", "50", "--unplug", f"12:{outage:g}") as url,
        station_at(url) as station,
    ):
        calibrate(station)
        station.act("choose", WRIST)
        wait_for(lambda: not station.snapshot()["glove"]["flowing"])
        left = station.tracking.newest_sample()
        assert station._wizard.state is State.TASK_READY
        wait_for(lambda: station.snapshot()["glove"]["flowing"])
        wait_for(lambda: station.tracking.newest_sample() > left + outage + 1)
        assert station._wizard.state is State.TASK_READY and not station._problem
        station.act("start")
        wait_for(lambda: station._wizard.state is State.TASK_REVIEW)
        station.act("accept")
    recording = formats_recordings.load(station.setup.recording)
    (task,) = [e for e in recording.events if e.trial_type == "task"]
    assert task.onset > left + outage
    for block in recording.samples.values():
        steps = np.diff(block.t)
        assert np.sum(steps > 0.1) == 1  # one gap, and it is as long as the outage
        assert outage - 0.5 < steps.max() < outage + 6
