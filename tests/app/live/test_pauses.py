"""Trials that are paused: what goes on, where, and what never does."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handscope.app.live.wizard import machine as wizard_machine
from handscope.app.live.wizard.machine import Act, State
from tests.app.live.wizard.test_machine import READY, at, kinds, later

PAUSED = st.lists(
    st.tuples(st.floats(0.0, 40.0), st.floats(0.0, 60.0)), max_size=4
)  # s that the trial runs, and that it is paused


@settings(max_examples=40, deadline=None)
@given(
    task=st.sampled_from(["rom_fist", "rom_mcp", "reach", "kapandji", "finger_independence"]),
    stretches=PAUSED,
)
def test_a_trial_goes_on_after_any_pauses_and_every_phase_is_done_whole_and_once(
    task: str, stretches: list[tuple[float, float]]
) -> None:
    w, _ = wizard_machine.act(at(State.TASK_READY, task=task), Act.START, READY)
    facts = later(READY, 3.0)
    w, _ = wizard_machine.tick(w, facts)
    protocol = w.protocol
    assert protocol is not None and protocol.length is not None
    for runs, rests in stretches:
        if wizard_machine.tick(w, later(facts, runs))[0].state is not State.TASK_RUN:
            break
        facts = later(facts, runs)
        w, orders = wizard_machine.act(w, Act.PAUSE, facts)
        assert (w.state, kinds(orders)) == (State.TASK_PAUSED, [("cue", "rest")])
        facts = later(facts, rests)
        assert wizard_machine.tick(w, facts)[0] == w  # a rest takes as long as it takes
        w, orders = wizard_machine.act(w, Act.RESUME, facts)
        assert (w.state, kinds(orders)) == (State.RESUME_COUNTDOWN, [("cue", task)])
        facts = later(facts, 3.0)
        w, _ = wizard_machine.tick(w, facts)
        assert w.state is State.TASK_RUN
    left = wizard_machine.remaining(w, facts)
    assert left is not None
    facts = later(facts, left + 1e-6)
    w, _ = wizard_machine.tick(w, facts)
    assert w.state is State.TASK_REVIEW and wizard_machine.done(w, w.end) == pytest.approx(
        protocol.length, abs=1e-4
    )
    w, (order,) = wizard_machine.act(w, Act.ACCEPT, facts)
    assert order.end - order.onset - sum(to - start for start, to in order.pauses) == pytest.approx(
        protocol.length, abs=1e-4
    )
    marks = protocol.marks(order.onset, order.end, order.pauses)
    assert [(phase.mark, k) for _, phase, k in marks] == [
        (phase.mark, k + 1)
        for k in range((protocol.repetitions or 0) * bool(protocol.cycle))
        for phase in protocol.cycle
    ]
    assert all(
        not (t < to - 1e-6 and t + phase.seconds > start + 1e-6)
        for t, phase, _ in marks
        for start, to in order.pauses
    )


@pytest.mark.parametrize(
    ("task", "paused", "goes_on"),
    [("rom_mcp", 8.0, 5.0), ("kapandji", 8.0, 6.0), ("rom_fist", 8.0, 8.0)],
)
def test_what_a_pause_broke_off_is_done_once_more(task: str, paused: float, goes_on: float) -> None:
    w, _ = wizard_machine.act(
        at(State.TASK_RUN, task=task, onset=READY.t), Act.PAUSE, later(READY, paused)
    )
    assert wizard_machine.resumed_at(w) == goes_on
    w, _ = wizard_machine.act(w, Act.RESUME, later(READY, 20.0))
    back, _ = wizard_machine.act(w, Act.STOP, later(READY, 21.0))
    assert back == replace(w, state=State.TASK_PAUSED, since=back.since)
    w, _ = wizard_machine.tick(w, later(READY, 23.0))
    assert (w.onset, w.pauses) == (READY.t, ((READY.t + goes_on, READY.t + 23.0),))


def test_a_trial_of_rhythm_or_length_ends_with_a_pause_and_is_begun_again_or_kept_as_far_as_it_went() -> (
    None
):
    for task in ("tapping", "open_close", "tremor_rest", "selfcheck_p1", "powerglove_01_index_mcp"):
        w, _ = wizard_machine.act(
            at(State.TASK_RUN, task=task, onset=READY.t), Act.PAUSE, later(READY, 6.0)
        )
        assert Act.RESUME not in w.allowed(READY) and Act.START in w.allowed(READY)
    w, orders = wizard_machine.act(
        at(State.TASK_RUN, task="rom_fist", onset=READY.t), Act.PAUSE, later(READY, 6.0)
    )
    assert (w.state, w.end, kinds(orders)) == (State.TASK_PAUSED, READY.t + 6.0, [("cue", "rest")])
    late = later(READY, 90.0)
    assert wizard_machine.tick(w, late)[0] == w  # a rest takes as long as it takes
    again, orders = wizard_machine.act(w, Act.START, late)
    assert (again.state, kinds(orders)) == (
        State.COUNTDOWN,
        [("keep_attempt", "rom_fist"), ("cue", "rom_fist")],
    )
    assert (orders[0].reason, orders[0].end, again.outcome("rom_fist")) == (
        "paused",
        READY.t + 6.0,
        "",
    )
    kept, orders = wizard_machine.act(w, Act.STOP, late)
    assert (kept.state, kept.end, list(orders)) == (State.TASK_REVIEW, READY.t + 6.0, [])
    kept, orders = wizard_machine.act(kept, Act.ACCEPT, late)
    assert (orders[0].onset, orders[0].end, orders[0].reason) == (
        READY.t,
        READY.t + 6.0,
        "accepted",
    )
