"""The wizard's way through a functional calibration, and what a live session keeps of it in the recording."""

from dataclasses import replace

import pytest

from handscope.app.live import ghost
from handscope.app.live.snapshot import told_of
from handscope.app.live.station import THUMB, Station
from handscope.app.live.wizard import machine as wizard_machine
from handscope.app.live.wizard.machine import LATE, Act, Facts, NotNowError, Order, State, Wizard
from handscope.app.protocols import load_steps
from handscope.estimators.alignment.functional_movements import STEPS, Piece
from handscope.estimators.data.samples import Event
from handscope.estimators.simulation.movements import functional_calibration
from tests.app.live.test_live_numbers import station  # noqa: F401  a fixture
from tests.app.live.wizard.test_machine import PROTOCOLS, READY, kinds, later

PROTOCOL = load_steps()
NAMES = list(STEPS)


def calibrating(**changed: object) -> Wizard:
    made = Wizard(PROTOCOLS, 3.0, tuple(PROTOCOL.values()), state=State.TASKS)
    return replace(wizard_machine.act(made, Act.CALIBRATE, READY)[0], **changed)  # type: ignore[arg-type]


def done(w: Wizard, facts: Facts) -> tuple[Wizard, Facts, list[Order]]:
    """The step is started, counted down and done."""
    w, orders = wizard_machine.act(w, Act.START, facts)
    assert (w.state, kinds(orders)) == (State.STEP_COUNTDOWN, [("cue", w.task)])
    assert w.protocol and w.protocol.length
    facts = later(facts, w.protocol.countdown)
    w, _ = wizard_machine.tick(w, facts)
    assert w.state is State.STEP_RUN
    facts = later(facts, w.protocol.length + LATE - 0.01)
    w, _ = wizard_machine.tick(w, facts)
    assert w.state is State.STEP_RUN
    facts = later(facts, 0.02)
    w, orders = wizard_machine.tick(w, facts)
    return w, facts, list(orders)


def test_every_step_of_the_method_has_its_words_and_its_virtual_patient() -> None:
    assert NAMES == list(PROTOCOL) == list(functional_calibration.STEPS)
    for p in PROTOCOL.values():
        assert p.cue == p.name and p.ghost and p.length and p.instruction.endswith(".")
        assert sum(phase.seconds for phase in p.cycle) * (p.repetitions or 0) in (0.0, 9.0)


def test_from_the_tasks_through_all_steps_to_the_pose_that_brings_them_into_force() -> None:
    w, facts = calibrating(), READY
    for k, name in enumerate(NAMES):
        assert (w.state, w.task) == (State.STEP_READY, name)
        w, facts, orders = done(w, facts)
        assert (w.state, kinds(orders)) == (State.STEP_REVIEW, [("measure_step", name)])
        assert orders[0].end - orders[0].onset == pytest.approx(PROTOCOL[name].length)
        w = wizard_machine.judge(w, ())
        if k < len(NAMES) - 1:
            w, _ = wizard_machine.act(w, Act.NEXT, facts)
    assert Act.NEXT not in w.allowed(facts)
    w, orders = wizard_machine.act(w, Act.USE, facts)
    assert (w.state, w.closing, w.used, kinds(orders)) == (
        State.POSE_READY,
        True,
        set(NAMES),
        [("use_steps", ""), ("cue", "initial_pose")],
    )
    assert told_of(w, facts)["title"] == "Initial pose again"
    w = replace(w, state=State.POSE_REVIEW)
    assert not wizard_machine.act(w, Act.ACCEPT, facts)[0].closing


def test_a_spoilt_step_says_why_and_is_not_used() -> None:
    w, facts, _ = done(calibrating(task="flexion_mcp"), READY)
    w = wizard_machine.judge(
        w, ("the hand moved with the MCP flexion: rest the hand and repeat it",)
    )
    assert w.message == "The hand moved with the MCP flexion: rest the hand and repeat it."
    assert Act.USE not in w.allowed(facts)
    told = told_of(w, facts)
    assert [s["outcome"] for s in told["calibration_steps"] if s["name"] == "flexion_mcp"] == [
        "spoilt"
    ]
    assert told["title"] == "This step cannot be used"
    w, orders = wizard_machine.act(w, Act.REDO, facts)
    assert (w.state, w.task, w.judged, w.message, kinds(orders)) == (
        State.STEP_READY,
        "flexion_mcp",
        (),
        "",
        [("drop_step", "flexion_mcp")],
    )
    w, facts, _ = done(w, facts)
    assert Act.USE in wizard_machine.judge(w, ()).allowed(facts)


def test_steps_without_an_axis_are_not_enough_unless_those_in_force_have_one() -> None:
    w, facts, _ = done(calibrating(), READY)
    w = wizard_machine.judge(w, ())
    assert Act.USE not in w.allowed(facts)
    assert Act.USE in replace(w, used=frozenset({"flexion_all"})).allowed(facts)


def test_a_step_can_be_done_alone_and_is_used_with_those_in_force() -> None:
    w = calibrating(used=frozenset(NAMES))
    with pytest.raises(NotNowError, match="no step 'tapping'"):
        wizard_machine.act(w, Act.CHOOSE, READY, "tapping")
    w, _ = wizard_machine.act(w, Act.CHOOSE, READY, "flexion_all")
    w, facts, _ = done(w, READY)
    w, _ = wizard_machine.act(wizard_machine.judge(w, ()), Act.USE, facts)
    assert (w.state, w.used) == (State.POSE_READY, set(NAMES))


def test_leaving_the_calibration_uses_nothing() -> None:
    w, facts, _ = done(calibrating(task="flexion_all"), READY)
    w, orders = wizard_machine.act(wizard_machine.judge(w, ()), Act.STOP, facts)
    assert (w.state, w.judged, w.used, kinds(orders)) == (
        State.TASKS,
        (),
        frozenset(),
        [("drop_steps", "")],
    )


def test_a_step_that_is_cancelled_is_not_measured() -> None:
    w, _ = wizard_machine.act(calibrating(), Act.START, READY)
    w, orders = wizard_machine.act(w, Act.STOP, READY)
    assert (w.state, w.task, kinds(orders)) == (State.STEP_READY, "flat_hand", [("cue", "rest")])


def test_only_steps_whose_segments_are_measured_are_offered_and_none_without_any() -> None:
    facts = replace(READY, measured=READY.measured - {"thumb_distal"})
    assert [p.name for p in calibrating().steps_offered(facts)] == [
        n for n in NAMES if "thumb" not in n
    ]
    assert Act.CALIBRATE not in Wizard(PROTOCOLS, 3.0, state=State.TASKS).allowed(READY)


def test_the_ghost_shows_each_step_before_it_is_done() -> None:
    for name in NAMES:
        w = calibrating(task=name)
        shown = ghost.ghost(w, THUMB, 0.0)
        assert shown is not None
        assert (ghost.ghost(w, THUMB, 1.4) == shown).all() == (len(PROTOCOL[name].ghost) == 1)


@pytest.mark.parametrize(
    ("act", "left"), [(Act.REDO, "redone"), (Act.STOP, "not used"), (Act.USE, "")]
)
def test_a_step_is_kept_under_its_own_name_until_it_is_taken_back(
    station: Station,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
    act: Act,
    left: str,
) -> None:
    kept: dict[str, Event] = {}
    monkeypatch.setattr(station.glove, "keep_event", kept.__setitem__)
    monkeypatch.setattr(station.glove, "send", lambda cue: None)
    piece = Piece("flexion_mcp", 53.0, 62.0)
    monkeypatch.setattr(station.tracking, "measure", lambda step, onset, end: piece)
    station._wizard, facts, orders = done(calibrating(task="flexion_mcp"), READY)
    station._do(orders, facts)
    assert [(e.trial_type, e.onset, e.duration) for e in kept.values()] == [
        ("flexion_mcp", pytest.approx(53.0), 9.0)
    ]
    station.act(act)
    (event,) = kept.values()
    if left:
        assert (event.trial_type, event.details, station.tracking.pieces) == (
            "annotation",
            {"task_name": "flexion_mcp", "outcome": left},
            {},
        )
    else:
        assert (event.trial_type, station.tracking.pieces) == (
            "flexion_mcp",
            {"flexion_mcp": piece},
        )
