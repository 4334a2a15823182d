"""The wizard's table and its timed steps, with facts and time passed in."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.live import wizard
from app.live.wizard import BY_PERSON, TRANSITIONS, Act, Facts, NotNowError, Order, State, Wizard
from app.protocols import load_all
from estimators.hand_anatomy import SEGMENTS

PROTOCOLS = tuple(load_all().values())
READY = Facts(now=100.0, t=50.0, flowing=True, wander=0.01, restless="hand", measured=frozenset(SEGMENTS))


def later(facts: Facts, seconds: float, **changed: object) -> Facts:
    return replace(facts, now=facts.now + seconds, t=facts.t + seconds, **changed)  # type: ignore[arg-type]


def at(state: State, **changed: object) -> Wizard:
    return replace(Wizard(PROTOCOLS, 3.0), state=state, since=READY.now, **changed)  # type: ignore[arg-type]


def kinds(orders: "list[Order] | tuple[Order, ...] | object") -> list[tuple[str, str]]:
    return [(o.kind, o.task) for o in orders]  # type: ignore[attr-defined]


def test_every_state_can_be_reached_and_left_except_the_last() -> None:
    reached = {after for row in TRANSITIONS.values() for after in row.values()} | {State.CONNECT}
    assert reached == set(State) == set(TRANSITIONS)
    assert [s for s in State if not TRANSITIONS[s]] == [State.FINISHED]


def test_the_straight_way_from_connect_to_finish() -> None:
    w, facts = Wizard(PROTOCOLS, 3.0), READY
    w, orders = wizard.act(w, Act.CONTINUE, facts)
    assert (w.state, kinds(orders)) == (State.POSE_READY, [("cue", "initial_pose")])
    w, _ = wizard.act(w, Act.START, facts)
    w, orders = wizard.tick(w, facts)
    assert (w.state, list(orders)) == (State.POSE_HOLD, [])
    facts = later(facts, 3.2)
    w, orders = wizard.tick(w, facts)
    assert (w.state, kinds(orders)) == (State.POSE_REVIEW, [("calibrate", "")])
    assert (orders[0].onset, orders[0].end) == (50.0, pytest.approx(53.2))
    w, _ = wizard.act(w, Act.ACCEPT, facts)
    w, _ = wizard.act(w, Act.CHOOSE, facts, "tapping")
    w, orders = wizard.act(w, Act.START, facts)
    assert (w.state, kinds(orders)) == (State.COUNTDOWN, [("cue", "tapping")])
    w, _ = wizard.tick(w, later(facts, 2.9))
    assert w.state is State.COUNTDOWN
    facts = later(facts, 3.0)
    w, _ = wizard.tick(w, facts)
    assert (w.state, w.onset) == (State.TASK_RUN, facts.t)
    w, _ = wizard.tick(w, later(facts, 14.9))
    assert w.state is State.TASK_RUN
    facts = later(facts, 15.0)
    w, orders = wizard.tick(w, facts)
    assert (w.state, kinds(orders)) == (State.TASK_REVIEW, [("cue", "rest")])
    w, orders = wizard.act(w, Act.ACCEPT, facts)
    assert [(o.kind, o.task, o.end - o.onset, o.reason) for o in orders] == [("keep_attempt", "tapping", pytest.approx(15.0), "accepted")]
    assert w.outcome("tapping") == "accepted"
    w, orders = wizard.act(w, Act.FINISH, facts)
    assert (w.state, kinds(orders)) == (State.FINISHED, [("finish", "")])


def test_movement_in_the_pose_starts_the_count_again() -> None:
    w, _ = wizard.tick(at(State.POSE_HOLD), READY)
    w, _ = wizard.tick(w, later(READY, 2.0))
    assert wizard.progress(w, later(READY, 2.0)) == pytest.approx(2 / 3)
    w, _ = wizard.tick(w, later(READY, 2.1, wander=0.5))
    assert wizard.progress(w, later(READY, 2.1)) == 0.0
    w, _ = wizard.tick(w, later(READY, 2.2))
    w, _ = wizard.tick(w, later(READY, 5.0))
    assert w.state is State.POSE_HOLD
    w, orders = wizard.tick(w, later(READY, 5.4))
    assert (w.state, orders[0].onset) == (State.POSE_REVIEW, pytest.approx(READY.t + 2.2))


def test_a_glove_that_falls_silent_in_the_pose_starts_the_count_again() -> None:
    w, _ = wizard.tick(at(State.POSE_HOLD), READY)
    w, _ = wizard.tick(w, later(READY, 2.0, flowing=False))
    assert w.still_since is None


def test_a_refused_pose_goes_back_with_its_reason() -> None:
    w = wizard.refused(at(State.POSE_REVIEW), READY, "the hand was not still")
    assert (w.state, w.message) == (State.POSE_READY, "the hand was not still")
    w, _ = wizard.act(w, Act.START, READY)
    assert w.message == ""


def test_a_redone_task_is_kept_as_redone_and_is_not_done() -> None:
    w, orders = wizard.act(at(State.TASK_REVIEW, task="tapping", onset=1.0, end=16.0), Act.REDO, READY)
    assert (w.state, w.outcome("tapping"), orders[0].reason) == (State.TASK_READY, "", "redone")


def test_a_skipped_task_keeps_its_reason() -> None:
    w, orders = wizard.act(at(State.TASK_READY, task="tapping"), Act.SKIP, READY, reason="pain")
    assert (w.state, w.outcome("tapping"), orders[0].reason) == (State.TASKS, "skipped", "skipped: pain")


def test_continue_waits_for_samples_of_the_hand() -> None:
    for facts in (replace(READY, flowing=False), replace(READY, measured=frozenset({"index_distal"}))):
        assert Act.CONTINUE not in Wizard(PROTOCOLS, 3.0).allowed(facts)
        with pytest.raises(NotNowError):
            wizard.act(Wizard(PROTOCOLS, 3.0), Act.CONTINUE, facts)


def test_only_tasks_whose_segments_are_measured_are_offered() -> None:
    facts = replace(READY, measured=READY.measured - {"forearm", "index_distal"})
    offered = {p.name for p in at(State.TASKS).offered(facts)}
    assert offered == {p.name for p in PROTOCOLS} - {"rom_wrist", "tapping"}
    with pytest.raises(NotNowError, match="rom_wrist"):
        wizard.act(at(State.TASKS), Act.CHOOSE, facts, "rom_wrist")


@given(st.lists(st.tuples(st.sampled_from(list(Act)), st.floats(0, 4), st.floats(0, 0.2), st.booleans()), max_size=60))
def test_whatever_people_press_the_wizard_stays_on_its_table(presses: list[tuple[Act, float, float, bool]]) -> None:
    w, facts = Wizard(PROTOCOLS, 3.0), READY
    for what, wait, wander, flowing in presses:
        facts = later(facts, wait, wander=wander, flowing=flowing)
        before = w.state
        w, _ = wizard.tick(w, facts)
        assert w.state is before or w.state in TRANSITIONS[before].values()
        allowed = w.allowed(facts)
        assert set(allowed) <= BY_PERSON
        if what in allowed:
            before = w.state
            w, _ = wizard.act(w, what, facts, "tapping", "reason")
            assert w.state is TRANSITIONS[before][what]
        else:
            with pytest.raises(NotNowError):
                wizard.act(w, what, facts, "tapping")
        assert 0.0 <= wizard.progress(w, facts) <= 1.0
        assert (wizard.remaining(w, facts) or 0.0) >= 0.0
