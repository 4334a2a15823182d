"""The rung of free movement: the wizard's way through it, the meter, solving beside the session, and what is kept of it."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.app.live import free_movement, ghost
from handscope.app.live.readouts.pose_fit import NOMINAL
from handscope.app.live.station import Station
from handscope.app.live.wizard import machine as wizard_machine
from handscope.app.live.wizard.effects import (
    CueTask,
    Effect,
    LeaveFree,
    SolveFree,
    UseFree,
    WatchFree,
)
from handscope.app.live.wizard.machine import LATE, Action, NotNowError, State, Wizard
from handscope.app.live.wizard.snapshot import wizard_snapshot
from handscope.app.protocols import load_free
from handscope.app.workers import self_calibration
from handscope.app.workers.self_calibration import SelfCalibrationSolver
from handscope.estimators.alignment import inclined_hand
from handscope.estimators.data.calibration import PriorCalibration
from handscope.estimators.data.samples import Event
from handscope.sessions.clinic.self_calibrations import FoundCalibration
from handscope.sessions.files.recording import LoadedRecording
from tests.app.live.test_live_numbers import station  # noqa: F401  a fixture
from tests.app.live.wizard.effect_kinds import kinds
from tests.app.live.wizard.test_machine import PROTOCOLS, READY, later
from tests.sessions.clinic.test_self_calibrations import found
from tests.simulated import in_strips, loaded

POSE = inclined_hand.pose_angles(NOMINAL)

FREE = load_free()


def ready(**changed: object) -> Wizard:
    made = Wizard(PROTOCOLS, 3.0, free=FREE, state=State.TASKS)
    return replace(wizard_machine.act(made, Action.FREE, READY)[0], **changed)  # type: ignore[arg-type]


def moved(w: Wizard) -> tuple[Wizard, wizard_machine.StationStatus, list[Effect]]:
    """Counted down and moved for the whole time."""
    w, effects = wizard_machine.act(w, Action.START, READY)
    assert (w.state, kinds(effects)) == (State.FREE_COUNTDOWN, [(CueTask, "free_movement")])
    status = later(READY, FREE.countdown)
    w, effects = wizard_machine.tick(w, status)
    assert (w.state, kinds(effects)) == (State.FREE_RUN, [(WatchFree, "")])
    status = later(status, 40.0 + LATE + 0.01)
    w, effects = wizard_machine.tick(w, status)
    return w, status, list(effects)


def test_from_the_tasks_through_free_movement_to_the_pose_that_brings_it_into_force() -> None:
    w, status, effects = moved(ready())
    assert (w.state, kinds(effects)) == (
        State.FREE_WORK,
        [(CueTask, "rest"), (SolveFree, "free_movement")],
    )
    assert effects[1].end - effects[1].onset == pytest.approx(40.0)
    w = wizard_machine.accept_free_movement(w, status)
    assert w.state is State.FREE_REVIEW
    assert wizard_snapshot(w, status)["title"] == "Use what was found?"
    w, effects = wizard_machine.act(w, Action.USE, status)
    assert (w.state, w.closing, kinds(effects)) == (
        State.POSE_READY,
        True,
        [(UseFree, ""), (CueTask, "initial_pose")],
    )


def test_what_was_found_may_be_left_or_done_again_and_a_computation_cancelled() -> None:
    w, status, _ = moved(ready())
    left, effects = wizard_machine.act(w, Action.STOP, status)
    assert (left.state, kinds(effects)) == (State.FREE_READY, [(LeaveFree, "")])
    assert wizard_machine.accept_free_movement(left, status) is left, "nobody waits for it any more"
    w = wizard_machine.accept_free_movement(w, status)
    assert wizard_machine.act(w, Action.STOP, status)[0].state is State.TASKS
    again, effects = wizard_machine.act(w, Action.REDO, status)
    assert (again.state, effects[0].outcome) == (State.FREE_READY, "redone")


def test_a_movement_that_told_nothing_goes_back_with_the_reason() -> None:
    w, status, _ = moved(ready())
    w = wizard_machine.reject_free_movement(w, status, "the fingers hardly moved")
    assert (w.state, wizard_snapshot(w, status)["message"]) == (
        State.FREE_READY,
        "the fingers hardly moved",
    )


def test_it_is_enough_when_a_person_says_so() -> None:
    w, _ = wizard_machine.act(ready(), Action.START, READY)
    status = later(READY, FREE.countdown)
    w, _ = wizard_machine.tick(w, status)
    with pytest.raises(NotNowError):
        wizard_machine.act(ready(), Action.ENOUGH, READY)
    w, effects = wizard_machine.act(w, Action.ENOUGH, later(status, 13.0))
    assert w.state is State.FREE_WORK
    assert effects[1].end - effects[1].onset == pytest.approx(13.0)


def test_it_is_offered_where_hand_and_a_first_phalanx_are_measured_and_the_method_uses_it() -> None:
    bare = replace(READY, measured=frozenset({"hand", "index_distal"}))
    made = Wizard(PROTOCOLS, 3.0, free=FREE, state=State.TASKS)
    assert Action.FREE in made.allowed(READY)
    assert Action.FREE not in made.allowed(bare)
    assert Action.FREE not in Wizard(PROTOCOLS, 3.0, state=State.TASKS).allowed(READY)


def test_the_ghost_shows_what_to_do_until_it_is_done() -> None:
    shown = [
        ghost.ghost(ready(state=s), POSE, t)
        for s in (State.FREE_READY, State.FREE_RUN)
        for t in (0.0, 2.5)
    ]
    assert all(angles is not None for angles in shown)
    assert not np.allclose(shown[0], shown[1])  # type: ignore[arg-type]
    assert ghost.ghost(ready(state=State.FREE_WORK), POSE, 0.0) is None


def test_only_lengths_of_another_glove_are_taken_over() -> None:
    known = PriorCalibration(
        "left",
        {"hand": np.array([1.0, 0, 0, 0])},
        {"hand": np.zeros(3)},
        {"index_proximal": 0.04},
        {"hand": np.full(3, 0.02)},
        {"index_proximal": 2e-4},
    )
    assert free_movement.prior_for_glove(known, "g1", "g1") is known
    assert (
        free_movement.prior_for_glove(known, "g1", "") is known
    )  # a glove that does not say its number
    assert free_movement.prior_for_glove(known, "g1", "g2") == PriorCalibration(
        "left", {}, {}, {"index_proximal": 0.04}, {}, {"index_proximal": 2e-4}
    )


@pytest.mark.parametrize(
    ("act", "left"), [(Action.REDO, "redone"), (Action.STOP, "not used"), (Action.USE, "")]
)
def test_the_movement_is_kept_as_such_until_it_is_taken_back(
    station: Station,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
    act: Action,
    left: str,
) -> None:
    kept: dict[str, Event | None] = {}
    given: list[FoundCalibration] = []
    monkeypatch.setattr(station.glove, "keep_event", kept.__setitem__)
    monkeypatch.setattr(station.glove, "send", lambda cue: None)
    monkeypatch.setattr(free_movement, "SelfCalibrationSolver", lambda *given: None)
    monkeypatch.setattr(station.free, "_keep", lambda what, glove: given.append(what))
    w, status, effects = moved(ready())
    station._wizard = w
    station._carry_out(effects, status)
    station.free.solution = found()
    station._wizard = wizard_machine.accept_free_movement(w, status)
    station.act(act)
    (event,) = kept.values()
    assert event is not None
    if left:
        assert (event.trial_type, event.details, given) == (
            "annotation",
            {"task_name": "free_movement", "outcome": left},
            [],
        )
        assert station.free.prior(None, "") is None
    else:
        assert (event.trial_type, len(given)) == ("free_movement", 1)
        known = station.free.prior(None, "")
        assert known is not None and known.lengths == {"index_proximal": 0.043}


def test_a_hand_that_rests_is_refused_in_words_by_a_process_of_its_own() -> None:
    whole = loaded(in_strips("left"))
    rest = {name: block.between(0.0, 4.0) for name, block in whole.samples.items()}
    work = SelfCalibrationSolver(
        LoadedRecording(whole.hand, whole.geometry, whole.mounting, rest, ())
    )
    work._thread.join(120)
    work.poll()
    assert work.is_over
    assert "self-calibration needs 10 s" in work.refusal


def test_a_computation_that_dies_or_lasts_too_long_is_told() -> None:
    whole = loaded(in_strips("left"))
    work = SelfCalibrationSolver(
        LoadedRecording(whole.hand, whole.geometry, whole.mounting, whole.samples, ())
    )
    work._process.kill()
    work._thread.join(120)
    work.poll()
    assert work.refusal == self_calibration.ENDED
