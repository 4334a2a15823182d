"""The numbers of an attempt count over all of it and stay while the clinician decides."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handscope.app.live.setup import Setup
from handscope.app.live.station import Station
from handscope.app.live.wizard.machine import State
from handscope.app.protocols import load_all
from handscope.app.results.quantity_curve import LENGTH
from handscope.app.workers.turns import Turns
from handscope.estimators.data import trajectory
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import FINGERS, JOINTS, SEGMENTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.measures import tapping
from handscope.estimators.methods import METHODS
from tests.app.live.wizard.test_machine import READY

RATE = 100.0  # Hz
TAPS = 2.5  # Hz
WIDEST, NARROWEST = 80.0, 10.0  # mm


def setup_of(folder: Path) -> Setup:
    """What a station of the left hand is opened with."""
    m2 = METHODS["m2"]
    return Setup(
        session=1,
        hand="left",
        geometry=sized("left"),
        port="none",
        recording=folder / "r.mcap",
        method_name="m2",
        method=m2,
        params=m2.Params(),
        protocols=tuple(load_all().values()),
        about={},
    )


@pytest.fixture
def station(tmp_path: Path) -> Station:
    """A station whose glove was never opened, in its tasks."""
    setup = setup_of(tmp_path)
    made = Station("test", setup, lambda _: None, Turns())
    made.curve.follow("aperture")
    return made


def moved(
    station: Station, start: float, stop: float, wide: float = WIDEST, narrow: float = NARROWEST
) -> Trajectory:
    """The hand taps from start to stop, told in pieces as the tracker does."""
    t = np.arange(start, stop, 1 / RATE)
    aperture = narrow + 0.5 * (wide - narrow) * (1 - np.cos(2 * np.pi * TAPS * t))
    tips = np.zeros((len(t), len(FINGERS), 3))
    tips[:, FINGERS.index("index"), 0] = 1e-3 * aperture
    shape = (len(t), len(SEGMENTS))
    whole = Trajectory(
        "left",
        t,
        np.zeros((len(t), len(JOINTS), 3)),
        np.zeros((*shape, 4)),
        tips,
        np.zeros(shape, np.uint8),
    )
    for piece in np.array_split(np.arange(len(t)), max(1, len(t) // 10)):
        station.curve.add(whole.between(t[piece[0]], t[piece[-1]]))
    return whole


def enters(station: Station, state: State, **changed: float) -> None:
    """The wizard is in a state of the tapping task, as after any act or tick."""
    station._wizard = replace(station._wizard, state=state, task="tapping", **changed)  # type: ignore[arg-type]
    station._carry_out((), READY)


def numbers(station: Station) -> dict[str, float]:
    return {n["name"]: n["value"] for n in station.snapshot()["numbers"]}


def test_the_numbers_stay_as_they_were_while_the_clinician_decides(station: Station) -> None:
    moved(station, 0.0, 5.0)
    enters(station, State.TASK_RUN, onset=5.0)
    moved(station, 5.0, 20.0)
    enters(station, State.TASK_REVIEW, end=20.0 - 0.5 / RATE)
    at_once = numbers(station)
    assert at_once == pytest.approx(
        {"taps": TAPS * 15, "largest": WIDEST, "smallest": NARROWEST}, abs=2.0
    )  # taps, mm
    moved(station, 20.0, 25.0, wide=140.0, narrow=2.0)
    assert numbers(station) == at_once
    moved(station, 25.0, 120.0)
    assert numbers(station) == at_once


def test_the_curve_shows_what_is_marked_on_the_drawn_hand_before_the_task_begins(
    station: Station,
) -> None:
    for task in ("rom_fist", "tapping", "rom_spread"):
        station._wizard = replace(station._wizard, state=State.TASK_READY, task=task)
        station._tick()
        shown = station.snapshot()
        assert shown["measured"] and shown["curve"]["what"] == shown["measured"], task


def test_a_task_longer_than_the_curve_is_counted_whole(station: Station) -> None:
    enters(station, State.TASK_RUN, onset=2.0)
    moved(station, 2.0, 4.0, wide=100.0)
    moved(station, 4.0, 3 * LENGTH)
    told = numbers(station)
    assert told["taps"] == pytest.approx(TAPS * (3 * LENGTH - 2.0), abs=2)
    assert told["largest"] == pytest.approx(100.0, abs=1.0)
    assert (
        station.pulse(-np.inf)["points"][0][0] >= 2 * LENGTH - 1.0
    )  # what viewers are told stays short


@pytest.mark.parametrize("onset", [5.0, 5.15, 5.2, 5.25, 5.35])
def test_taps_are_counted_live_as_in_the_result(station: Station, onset: float) -> None:
    whole = moved(station, 0.0, onset)
    enters(station, State.TASK_RUN, onset=onset)
    for end in np.arange(onset + 0.9, 12.0, 0.35):
        whole = trajectory.join([whole, moved(station, float(whole.t[-1]) + 1 / RATE, end)], "left")
        counted = tapping.measure(tapping.Params(), whole, onset, float(whole.t[-1])).count
        assert numbers(station)["taps"] == counted


def test_an_attempt_done_again_is_counted_anew(station: Station) -> None:
    enters(station, State.TASK_RUN, onset=0.0)
    moved(station, 0.0, 4.0, wide=120.0)
    enters(station, State.TASK_REVIEW, end=4.0)
    enters(station, State.TASK_READY)
    assert numbers(station) == {}
    enters(station, State.TASK_RUN, onset=4.0)
    moved(station, 4.0, 8.0)
    assert numbers(station)["largest"] == pytest.approx(WIDEST, abs=1.0)
