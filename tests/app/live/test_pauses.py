"""Trials that are paused: what goes on, where, and what never does."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handscope.app.live.wizard import machine as wizard_machine
from handscope.app.live.wizard.effects import CueTask, KeepAttempt
from handscope.app.live.wizard.machine import Action, State
from tests.app.live.wizard.effect_kinds import kinds
from tests.app.live.wizard.test_machine import READY, at, later

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
    w, _ = wizard_machine.act(at(State.TASK_READY, task=task), Action.START, READY)
    status = later(READY, 3.0)
    w, _ = wizard_machine.tick(w, status)
    protocol = w.protocol
    assert protocol is not None and protocol.length is not None
    for runs, rests in stretches:
        if wizard_machine.tick(w, later(status, runs))[0].state is not State.TASK_RUN:
            break
        status = later(status, runs)
        w, effects = wizard_machine.act(w, Action.PAUSE, status)
        assert (w.state, kinds(effects)) == (State.TASK_PAUSED, [(CueTask, "rest")])
        status = later(status, rests)
        assert wizard_machine.tick(w, status)[0] == w  # a rest takes as long as it takes
        w, effects = wizard_machine.act(w, Action.RESUME, status)
        assert (w.state, kinds(effects)) == (State.RESUME_COUNTDOWN, [(CueTask, task)])
        status = later(status, 3.001)  # a sum of times rounds
        w, _ = wizard_machine.tick(w, status)
        assert w.state is State.TASK_RUN
    left = wizard_machine.remaining_time(w, status)
    assert left is not None
    status = later(status, left + 1e-6)
    w, _ = wizard_machine.tick(w, status)
    assert w.state is State.TASK_REVIEW and wizard_machine.elapsed(w, w.end) == pytest.approx(
        protocol.length, abs=1e-4
    )
    w, (effect,) = wizard_machine.act(w, Action.ACCEPT, status)
    assert effect.end - effect.onset - sum(
        to - start for start, to in effect.pauses
    ) == pytest.approx(protocol.length, abs=1e-4)
    marks = protocol.marks(effect.onset, effect.end, effect.pauses)
    assert [(phase.mark, k) for _, phase, k in marks] == [
        (phase.mark, k + 1)
        for k in range((protocol.repetitions or 0) * bool(protocol.cycle))
        for phase in protocol.cycle
    ]
    assert all(
        not (t < to - 1e-6 and t + phase.seconds > start + 1e-6)
        for t, phase, _ in marks
        for start, to in effect.pauses
    )


@pytest.mark.parametrize(
    ("task", "paused", "goes_on"),
    [("rom_mcp", 8.0, 5.0), ("kapandji", 8.0, 6.0), ("rom_fist", 8.0, 8.0)],
)
def test_what_a_pause_broke_off_is_done_once_more(task: str, paused: float, goes_on: float) -> None:
    w, _ = wizard_machine.act(
        at(State.TASK_RUN, task=task, onset=READY.t), Action.PAUSE, later(READY, paused)
    )
    assert wizard_machine.resumed_at(w) == goes_on
    w, _ = wizard_machine.act(w, Action.RESUME, later(READY, 20.0))
    back, _ = wizard_machine.act(w, Action.STOP, later(READY, 21.0))
    assert back == replace(w, state=State.TASK_PAUSED, since=back.since)
    w, _ = wizard_machine.tick(w, later(READY, 23.0))
    assert (w.onset, w.pauses) == (READY.t, ((READY.t + goes_on, READY.t + 23.0),))


def test_a_trial_of_rhythm_or_length_ends_with_a_pause_and_is_begun_again_or_kept_as_far_as_it_went() -> (
    None
):
    for task in ("tapping", "open_close", "tremor_rest", "selfcheck_p1", "powerglove_01_index_mcp"):
        w, _ = wizard_machine.act(
            at(State.TASK_RUN, task=task, onset=READY.t), Action.PAUSE, later(READY, 6.0)
        )
        assert Action.RESUME not in w.allowed(READY) and Action.START in w.allowed(READY)
    w, effects = wizard_machine.act(
        at(State.TASK_RUN, task="rom_fist", onset=READY.t), Action.PAUSE, later(READY, 6.0)
    )
    assert (w.state, w.end, kinds(effects)) == (
        State.TASK_PAUSED,
        READY.t + 6.0,
        [(CueTask, "rest")],
    )
    late = later(READY, 90.0)
    assert wizard_machine.tick(w, late)[0] == w  # a rest takes as long as it takes
    again, effects = wizard_machine.act(w, Action.START, late)
    assert (again.state, kinds(effects)) == (
        State.COUNTDOWN,
        [(KeepAttempt, "rom_fist"), (CueTask, "rom_fist")],
    )
    assert (effects[0].outcome, effects[0].end, again.outcome("rom_fist")) == (
        "paused",
        READY.t + 6.0,
        "",
    )
    kept, effects = wizard_machine.act(w, Action.STOP, late)
    assert (kept.state, kept.end, list(effects)) == (State.TASK_REVIEW, READY.t + 6.0, [])
    kept, effects = wizard_machine.act(kept, Action.ACCEPT, late)
    assert (effects[0].onset, effects[0].end, effects[0].outcome) == (
        READY.t,
        READY.t + 6.0,
        "accepted",
    )
