"""What a live session writes into the recording of a task with trials and phases, and what it tells a virtual patient."""

import threading
from dataclasses import replace
from math import radians
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handscope.app.devices.glove import Glove
from handscope.app.live import trial_events
from handscope.app.live.readouts import worn_glove
from handscope.app.live.station import Station
from handscope.app.live.stations import Stations
from handscope.app.live.wizard import machine as wizard_machine
from handscope.app.live.wizard.effects import Calibrate, KeepAttempt
from handscope.app.live.wizard.machine import Action, State
from handscope.app.workers.turns import Turns
from handscope.estimators.alignment import initial_pose
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.held_contact import held_contacts
from handscope.estimators.data.samples import Event
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.hand.geometry import sized
from handscope.sessions.wire.messages import Cue
from tests.app.devices.virtual import wait_for
from tests.app.live.test_live_numbers import station  # noqa: F401  a fixture
from tests.app.live.wizard.test_machine import PROTOCOLS, READY
from tests.simulated import in_strips


def kept(station: Station, monkeypatch: pytest.MonkeyPatch) -> list[Event]:
    """Events from now on, as they are written."""
    events: list[Event] = []
    monkeypatch.setattr(station.glove, "keep_event", lambda event_id, event: events.append(event))
    return events


def reviewed(station: Station, task: str, act: Action, **times: Any) -> None:
    """A trial was done and a person says what becomes of it."""
    station._wizard = replace(station._wizard, state=State.TASK_REVIEW, task=task, **times)
    station._wizard, effects = wizard_machine.act(station._wizard, act, READY, reason="pain")
    station._carry_out(effects, READY)


def test_an_accepted_trial_is_kept_with_its_number_and_its_whole_phases(
    station: Station,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    events = kept(station, monkeypatch)
    reviewed(station, "repeatability_mould", Action.AGAIN, onset=10.0, end=130.0)
    reviewed(station, "repeatability_mould", Action.ACCEPT, onset=200.0, end=215.0)
    trials = [(e.onset, e.duration, e.details["trial"]) for e in events if e.trial_type == "task"]
    assert trials == [(10.0, 120.0, 1), (200.0, 15.0, 2)]
    phases = [
        (e.onset, e.duration, e.details["phase"], e.details["repetition"])
        for e in events
        if e.trial_type == "annotation"
    ]
    assert phases[:3] == [(10.0, 6.0, "grip", 1), (16.0, 6.0, "flat", 1), (22.0, 6.0, "grip", 2)]
    assert phases[20:] == [(200.0, 6.0, "grip", 1), (206.0, 6.0, "flat", 1)]


def test_pauses_of_an_accepted_trial_are_marked_and_its_phases_lie_outside_them(
    station: Station,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    events = kept(station, monkeypatch)
    reviewed(station, "rom_mcp", Action.ACCEPT, onset=10.0, end=45.0, pauses=((15.0, 35.0),))
    reviewed(station, "rom_mcp", Action.REDO, onset=50.0, end=85.0, pauses=((55.0, 75.0),))
    assert [(e.onset, e.duration) for e in events if e.trial_type == "task"] == [(10.0, 35.0)]
    phases = [(e.details["phase"], e.onset, e.duration) for e in events if "phase" in e.details]
    assert phases[0] == ("pause", 15.0, 20.0)
    assert [onset for _, onset, _ in phases[1:]] == [10.0, 12.5, 35.0, 37.5, 40.0, 42.5]


@pytest.mark.parametrize(
    ("act", "outcome"),
    [
        (Action.REDO, "redone: pain"),
        (Action.SKIP, "skipped: pain"),
        (Action.UNABLE, "unable: pain"),
    ],
)
def test_a_trial_that_was_not_accepted_leaves_no_phases(
    station: Station,
    monkeypatch: pytest.MonkeyPatch,
    act: Action,
    outcome: str,
) -> None:
    events = kept(station, monkeypatch)
    reviewed(station, "repeatability_mould", act, onset=10.0, end=130.0)
    assert [(e.trial_type, e.details) for e in events] == [
        ("annotation", {"task_name": "repeatability_mould", "outcome": outcome})
    ]


def test_a_task_of_one_trial_has_no_number(
    station: Station,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    events = kept(station, monkeypatch)
    reviewed(station, "rom_fist", Action.ACCEPT, onset=10.0, end=25.0)
    assert [e.details for e in events] == [{"task_name": "rom_fist", "outcome": "accepted"}]


def test_who_moved_the_hand_and_what_the_protocol_keeps_for_the_measures_stand_in_the_event(
    station: Station,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    events = kept(station, monkeypatch)
    reviewed(station, "prom_fist", Action.ACCEPT, onset=10.0, end=25.0)
    reviewed(station, "selfcheck_p4", Action.ACCEPT, onset=30.0, end=55.0)
    passive, block = (e.details for e in events)
    assert passive == {"task_name": "prom_fist", "outcome": "accepted", "mode": "passive"}
    assert (block["distances_mm"], len(block["contacts"].split())) == ("53 46 25", 3)


def test_how_the_trunks_sensor_is_worn_stands_in_the_event_of_a_reach_alone() -> None:
    effect, worn = (
        KeepAttempt("a task", 1.0, 9.0, "accepted"),
        {"trunk_height": 0.42},
    )
    told = {
        p.name
        for p in PROTOCOLS
        if next(trial_events.events(effect, p, 1, 9.0, worn))[1].details.get("trunk_height") == 0.42
    }
    assert told == {"reach"}


def test_the_clinicians_score_stands_in_the_event_of_the_trial(
    station: Station,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    events = kept(station, monkeypatch)
    station._wizard = replace(
        station._wizard, state=State.TASK_REVIEW, task="kapandji", onset=10.0, end=40.0
    )
    station._status = READY
    with pytest.raises(
        InputError, match="the Kapandji score is 12; it is a whole number from 0 to 10"
    ):
        station.act("accept", value=12.0)
    assert events == []
    station.act("accept", value=9.0)
    task, *positions = events
    assert task.details == {
        "task_name": "kapandji",
        "outcome": "accepted",
        "score": 9.0,
        "score_title": "Kapandji score",
    }
    assert [e.details["phase"] for e in positions] == [f"position_{k}" for k in range(1, 11)]


def test_a_virtual_patient_is_told_how_long_the_countdown_takes(
    station: Station,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sent: list[Cue] = []
    monkeypatch.setattr(station.glove, "send", sent.append)
    for task in ("powerglove_01_index_mcp", "tapping"):
        station._wizard = replace(station._wizard, state=State.TASK_READY, task=task)
        station._wizard, effects = wizard_machine.act(station._wizard, Action.START, READY)
        station._carry_out(effects, READY)
    assert sent == [
        Cue("powerglove_01_index_mcp", {"lead": "3"}),
        Cue("tapping", {"lead": "3", "duration": "18"}),
    ]


def test_a_station_goes_on_while_a_calibration_is_computed(
    station: Station,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    events = kept(station, monkeypatch)
    computing, calibration = (
        threading.Event(),
        initial_pose.uncalibrated("left", sized("left"), {}, SEGMENTS, 0.0),
    )

    def calibrate(pose: initial_pose.Pose) -> Calibration:
        assert computing.wait(5.0)
        return calibration

    monkeypatch.setattr(station.tracking, "calibrate", calibrate)
    station._wizard = replace(station._wizard, state=State.POSE_WORK, passive=True)
    station._carry_out([Calibrate(10.0, 13.0)], READY)
    assert station.snapshot()["wizard"]["state"] == "pose_work"  # at once
    computing.set()
    wait_for(lambda: station.snapshot()["wizard"]["state"] == "pose_review")
    assert [(e.trial_type, e.details["held_by"]) for e in events] == [("initial_pose", "therapist")]
    assert initial_pose.pose_of(events[0]).passive
    assert len(station.snapshot()["calibration"]["joints"]) == 16


def test_the_next_pose_alone_takes_the_angles_of_a_photograph(
    station: Station, monkeypatch: pytest.MonkeyPatch
) -> None:
    events, taken = kept(station, monkeypatch), list[initial_pose.Pose]()
    calibration = initial_pose.uncalibrated("left", sized("left"), {}, SEGMENTS, 0.0)

    def calibrate(pose: initial_pose.Pose) -> Calibration:
        taken.append(pose)
        return calibration

    monkeypatch.setattr(station.tracking, "calibrate", calibrate)
    details = {"index_mcp_deviation_deg": 4.0, "index_mcp_deviation_sd_deg": 0.6}
    station.measured_pose.use_photograph(details)
    for count in (1, 2):
        station._wizard = replace(station._wizard, state=State.POSE_WORK)
        station._carry_out([Calibrate(10.0, 13.0)], READY)
        wait_for(lambda count=count: len(events) == count)
    assert taken[0].measured["index_mcp"] == pytest.approx((0.0, radians(4.0), 0.0))
    assert taken[0].thumb_cmc == taken[1].thumb_cmc != initial_pose.NEUTRAL
    assert events[0].details.items() >= details.items() and taken[1].measured == {}
    assert "index_mcp_deviation_deg" not in events[1].details


def test_a_photograph_that_comes_while_a_pose_is_computed_is_the_next_poses(
    station: Station, monkeypatch: pytest.MonkeyPatch
) -> None:
    events, taken = kept(station, monkeypatch), list[initial_pose.Pose]()
    calibration = initial_pose.uncalibrated("left", sized("left"), {}, SEGMENTS, 0.0)
    details = {"index_mcp_deviation_deg": 4.0, "index_mcp_deviation_sd_deg": 0.6}

    def calibrate(pose: initial_pose.Pose) -> Calibration:
        if not taken:
            station.measured_pose.use_photograph(details)
        taken.append(pose)
        return calibration

    monkeypatch.setattr(station.tracking, "calibrate", calibrate)
    for count in (1, 2):
        station._wizard = replace(station._wizard, state=State.POSE_WORK)
        station._carry_out([Calibrate(10.0, 13.0)], READY)
        wait_for(lambda count=count: len(events) == count)
    assert taken[0].measured == {} and "index_mcp_deviation_deg" not in events[0].details
    assert "index_mcp" in taken[1].measured and events[1].details.items() >= details.items()


def test_a_calibration_that_is_taken_back_is_again_one_of_the_glove_before(
    station: Station, monkeypatch: pytest.MonkeyPatch
) -> None:
    events = kept(station, monkeypatch)
    calibration = initial_pose.uncalibrated("left", sized("left"), {}, SEGMENTS, 0.0)
    monkeypatch.setattr(station.tracking, "calibrate", lambda pose: calibration)
    monkeypatch.setattr(station.tracking, "restore_previous", lambda: calibration)

    def calibrate(count: int) -> None:
        station._wizard = replace(station._wizard, state=State.POSE_WORK)
        station._carry_out([Calibrate(10.0, 13.0)], READY)
        wait_for(lambda: len(events) == count)

    calibrate(1)
    station.glove.assembler.replaced += 1
    assert worn_glove.other_glove_sentence(station.glove, station._calibrated_glove)
    calibrate(2)
    assert not worn_glove.other_glove_sentence(station.glove, station._calibrated_glove)
    station._drop_pose()
    assert worn_glove.other_glove_sentence(station.glove, station._calibrated_glove)


def test_a_station_that_cannot_open_leaves_nothing_running(
    station: Station, monkeypatch: pytest.MonkeyPatch
) -> None:
    another = Station("another", station.setup, lambda s: None, Turns())

    def fail(self: Glove) -> Glove:
        raise InputError("live.glove_in_use", port=another.setup.port)

    monkeypatch.setattr(Glove, "__enter__", fail)
    with pytest.raises(InputError):
        another.__enter__()
    assert not another.tracking._thread.is_alive()
    wait_for(lambda: not another.scene.port)


def test_leaving_the_server_waits_for_a_session_that_is_being_finished() -> None:
    ending, ended, kept = threading.Event(), threading.Event(), []

    class Slow(Station):
        def __init__(self) -> None:
            self.name = "slow"
            self.setup = SimpleNamespace(session=7)  # type: ignore[assignment]

        def __exit__(self, *_: object) -> None:
            ending.set()
            assert ended.wait(5.0)

    stations = Stations(lambda s: kept.append(s.name))
    stations._stations["slow"] = Slow()
    finishing = threading.Thread(target=stations.close, args=("slow",))
    finishing.start()
    assert ending.wait(5.0)
    leaving = threading.Thread(target=stations.__exit__, args=(None, None, None))
    leaving.start()
    leaving.join(0.2)
    assert leaving.is_alive() and kept == [] and stations.saves(7)
    ended.set()
    leaving.join(5.0)
    finishing.join(5.0)
    assert not leaving.is_alive() and kept == ["slow"] and not stations.saves(7)


def test_fingertips_that_were_held_together_are_contacts_of_the_recording(
    station: Station,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """From some seconds after the word on, until just before the next; a trial that is redone tells none."""
    events = kept(station, monkeypatch)
    reviewed(station, "touch_fingertips", Action.REDO, onset=10.0, end=28.0)
    assert not [e for e in events if e.trial_type == "contact"]
    reviewed(station, "touch_fingertips", Action.ACCEPT, onset=30.0, end=48.0)
    held = held_contacts(events)
    assert [h.contacts[0].b[0] for h in held] == ["index", "middle", "ring", "little"]
    assert [round(h.onset, 6) for h in held] == [32.0, 36.5, 41.0, 45.5]
    assert [round(h.end, 6) for h in held] == [34.2, 38.7, 43.2, 47.7]


def test_how_well_the_pose_fits_counts_the_angles_of_a_photograph(station: Station) -> None:
    """A hand that lies flat, of which a photograph shows an index finger bent by 40°, is not in the pose that counts."""
    recording = in_strips("left")
    until = recording.events[0].end
    station.tracking._process([b.between(-np.inf, until) for b in recording.samples.values()])
    station.glove.assembler.mounting |= recording.mounting
    grades = []
    for measured in ({}, {"index_mcp_flexion_deg": 40.0}):
        station.measured_pose.use_photograph(measured)
        station._wizard = replace(station._wizard, state=State.POSE_READY)
        station._tick()
        fitted = {row["part"]: row for row in station.snapshot()["pose_fit"]}
        grades.append((fitted["index"]["grade"], fitted["index"]["deg"], fitted["middle"]["grade"]))
    assert grades == [("good", 0, "good"), ("poor", 40, "good")]
