"""The wizard's way through a functional calibration, and what a live session keeps of it in the recording."""

from dataclasses import replace

import pytest

from handscope.app.live import ghost
from handscope.app.live.readouts.pose_fit import NOMINAL
from handscope.app.live.station import Station
from handscope.app.live.wizard import machine as wizard_machine
from handscope.app.live.wizard.effects import (
    CueTask,
    DropStep,
    DropSteps,
    Effect,
    MeasureStep,
    UseSteps,
)
from handscope.app.live.wizard.machine import (
    LATE,
    Action,
    NotNowError,
    State,
    StationStatus,
    Wizard,
)
from handscope.app.live.wizard.snapshot import wizard_snapshot
from handscope.app.protocols import load_steps
from handscope.estimators.alignment import inclined_hand
from handscope.estimators.alignment.functional_movements import STEPS, CalibrationMovement
from handscope.estimators.data.samples import Event
from handscope.estimators.simulation.movements import functional_calibration
from tests.app.live.test_live_numbers import station  # noqa: F401  a fixture
from tests.app.live.wizard.effect_kinds import kinds
from tests.app.live.wizard.test_machine import PROTOCOLS, READY, later

POSE = inclined_hand.pose_angles(NOMINAL)

PROTOCOL = load_steps()
NAMES = list(STEPS)


def calibrating(**changed: object) -> Wizard:
    made = Wizard(PROTOCOLS, 3.0, tuple(PROTOCOL.values()), state=State.TASKS)
    return replace(wizard_machine.act(made, Action.CALIBRATE, READY)[0], **changed)  # type: ignore[arg-type]


def done(w: Wizard, status: StationStatus) -> tuple[Wizard, StationStatus, list[Effect]]:
    """The step is started, counted down and done."""
    w, effects = wizard_machine.act(w, Action.START, status)
    assert (w.state, kinds(effects)) == (State.STEP_COUNTDOWN, [(CueTask, w.task)])
    assert w.protocol and w.protocol.length
    status = later(status, w.protocol.countdown)
    w, _ = wizard_machine.tick(w, status)
    assert w.state is State.STEP_RUN
    status = later(status, w.protocol.length + LATE - 0.01)
    w, _ = wizard_machine.tick(w, status)
    assert w.state is State.STEP_RUN
    status = later(status, 0.02)
    w, effects = wizard_machine.tick(w, status)
    return w, status, list(effects)


def test_every_step_of_the_method_has_its_words_and_its_virtual_patient() -> None:
    assert NAMES == list(PROTOCOL) == list(functional_calibration.STEPS)
    for p in PROTOCOL.values():
        assert p.cue == p.name and p.ghost and p.length and p.instruction.endswith(".")
        assert sum(phase.seconds for phase in p.cycle) * (p.repetitions or 0) in (0.0, 9.0)


def test_from_the_tasks_through_all_steps_to_the_pose_that_brings_them_into_force() -> None:
    w, status = calibrating(), READY
    for k, name in enumerate(NAMES):
        assert (w.state, w.task) == (State.STEP_READY, name)
        w, status, effects = done(w, status)
        assert (w.state, kinds(effects)) == (State.STEP_REVIEW, [(MeasureStep, name)])
        assert effects[0].end - effects[0].onset == pytest.approx(PROTOCOL[name].length)
        w = wizard_machine.record_judgement(w, ())
        if k < len(NAMES) - 1:
            w, _ = wizard_machine.act(w, Action.NEXT, status)
    assert Action.NEXT not in w.allowed(status)
    w, effects = wizard_machine.act(w, Action.USE, status)
    assert (w.state, w.closing, w.used, kinds(effects)) == (
        State.POSE_READY,
        True,
        set(NAMES),
        [(UseSteps, ""), (CueTask, "initial_pose")],
    )
    assert wizard_snapshot(w, status)["title"] == "Initial pose again"
    w = replace(w, state=State.POSE_REVIEW)
    assert not wizard_machine.act(w, Action.ACCEPT, status)[0].closing


def test_a_spoilt_step_says_why_and_is_not_used() -> None:
    w, status, _ = done(calibrating(task="flexion_mcp"), READY)
    w = wizard_machine.record_judgement(
        w, ("the hand moved with the MCP flexion: rest the hand and repeat it",)
    )
    assert w.message == "The hand moved with the MCP flexion: rest the hand and repeat it."
    assert Action.USE not in w.allowed(status)
    told = wizard_snapshot(w, status)
    assert [s["outcome"] for s in told["calibration_steps"] if s["name"] == "flexion_mcp"] == [
        "spoilt"
    ]
    assert told["title"] == "This step cannot be used"
    w, effects = wizard_machine.act(w, Action.REDO, status)
    assert (w.state, w.task, w.judged, w.message, kinds(effects)) == (
        State.STEP_READY,
        "flexion_mcp",
        (),
        "",
        [(DropStep, "flexion_mcp")],
    )
    w, status, _ = done(w, status)
    assert Action.USE in wizard_machine.record_judgement(w, ()).allowed(status)


def test_steps_without_an_axis_are_not_enough_unless_those_in_force_have_one() -> None:
    w, status, _ = done(calibrating(), READY)
    w = wizard_machine.record_judgement(w, ())
    assert Action.USE not in w.allowed(status)
    assert Action.USE in replace(w, used=frozenset({"flexion_all"})).allowed(status)


def test_a_step_can_be_done_alone_and_is_used_with_those_in_force() -> None:
    w = calibrating(used=frozenset(NAMES))
    with pytest.raises(NotNowError, match="no step 'tapping'"):
        wizard_machine.act(w, Action.CHOOSE, READY, "tapping")
    w, _ = wizard_machine.act(w, Action.CHOOSE, READY, "flexion_all")
    w, status, _ = done(w, READY)
    w, _ = wizard_machine.act(wizard_machine.record_judgement(w, ()), Action.USE, status)
    assert (w.state, w.used) == (State.POSE_READY, set(NAMES))


def test_leaving_the_calibration_uses_nothing() -> None:
    w, status, _ = done(calibrating(task="flexion_all"), READY)
    w, effects = wizard_machine.act(wizard_machine.record_judgement(w, ()), Action.STOP, status)
    assert (w.state, w.judged, w.used, kinds(effects)) == (
        State.TASKS,
        (),
        frozenset(),
        [(DropSteps, "")],
    )


def test_a_step_that_is_cancelled_is_not_measured() -> None:
    w, _ = wizard_machine.act(calibrating(), Action.START, READY)
    w, effects = wizard_machine.act(w, Action.STOP, READY)
    assert (w.state, w.task, kinds(effects)) == (State.STEP_READY, "flat_hand", [(CueTask, "rest")])


def test_only_steps_whose_segments_are_measured_are_offered_and_none_without_any() -> None:
    status = replace(READY, measured=READY.measured - {"thumb_distal"})
    assert [p.name for p in calibrating().steps_offered(status)] == [
        n for n in NAMES if "thumb" not in n
    ]
    assert Action.CALIBRATE not in Wizard(PROTOCOLS, 3.0, state=State.TASKS).allowed(READY)


def test_the_ghost_shows_each_step_before_it_is_done() -> None:
    for name in NAMES:
        w = calibrating(task=name)
        shown = ghost.ghost(w, POSE, 0.0)
        assert shown is not None
        assert (ghost.ghost(w, POSE, 1.4) == shown).all() == (len(PROTOCOL[name].ghost) == 1)


@pytest.mark.parametrize(
    ("act", "left"), [(Action.REDO, "redone"), (Action.STOP, "not used"), (Action.USE, "")]
)
def test_a_step_is_kept_under_its_own_name_until_it_is_taken_back(
    station: Station,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
    act: Action,
    left: str,
) -> None:
    kept: dict[str, Event] = {}
    monkeypatch.setattr(station.glove, "keep_event", kept.__setitem__)
    monkeypatch.setattr(station.glove, "send", lambda cue: None)
    piece = CalibrationMovement("flexion_mcp", 53.0, 62.0)
    monkeypatch.setattr(station.tracking, "measure", lambda step, onset, end: piece)
    station._wizard, status, effects = done(calibrating(task="flexion_mcp"), READY)
    station._carry_out(effects, status)
    assert [(e.trial_type, e.onset, e.duration) for e in kept.values()] == [
        ("flexion_mcp", pytest.approx(53.0), 9.0)
    ]
    station.act(act)
    (event,) = kept.values()
    if left:
        assert (event.trial_type, event.details, station.tracking.movements) == (
            "annotation",
            {"task_name": "flexion_mcp", "outcome": left},
            {},
        )
    else:
        assert (event.trial_type, station.tracking.movements) == (
            "flexion_mcp",
            {"flexion_mcp": piece},
        )
