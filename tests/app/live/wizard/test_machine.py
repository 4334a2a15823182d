"""The wizard's table and its timed steps, with facts and time passed in."""

from dataclasses import replace
from math import isnan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.app.language import ENGLISH
from handscope.app.live.wizard import machine as wizard_machine
from handscope.app.live.wizard.effects import (
    Calibrate,
    Correct,
    CueFinger,
    CueTask,
    DropPose,
    Effect,
    Exchange,
    Finish,
    Guess,
    KeepAttempt,
    MeasureStep,
)
from handscope.app.live.wizard.machine import (
    BY_PERSON,
    OUTCOMES,
    PASSING,
    PATIENT,
    SETTLE,
    STEPPING,
    TRANSITIONS,
    Action,
    NotNowError,
    State,
    StationStatus,
    Wizard,
)
from handscope.app.live.wizard.snapshot import wizard_snapshot
from handscope.app.protocols import groups, load_all, load_steps
from handscope.estimators.alignment.quality import GRADES, LIMITS
from handscope.estimators.hand.anatomy import FINGERS, SEGMENTS
from tests.app.live.wizard.effect_kinds import kinds

PROTOCOLS = tuple(load_all().values())
READY = StationStatus(
    now=100.0,
    t=50.0,
    flowing=True,
    angular_rate_peak=0.01,
    fastest_segment="hand",
    measured=frozenset(SEGMENTS),
)


def later(status: StationStatus, seconds: float, **changed: object) -> StationStatus:
    return replace(status, now=status.now + seconds, t=status.t + seconds, **changed)  # type: ignore[arg-type]


def at(state: State, **changed: object) -> Wizard:
    return replace(Wizard(PROTOCOLS, 3.0), state=state, since=READY.now, **changed)  # type: ignore[arg-type]


@pytest.mark.parametrize("state", [s for s in State if s is not State.FINISHED])
def test_when_the_recording_has_stopped_nothing_goes_on_and_only_finishing_is_offered(
    state: State,
) -> None:
    stopped = later(READY, 60.0, is_recording=False)
    w = at(state, task="rom_fist", onset=READY.t)
    assert wizard_machine.tick(w, stopped) == (w, ())
    assert set(w.allowed(stopped)) <= {Action.FINISH}
    assert wizard_machine.remaining_time(w, stopped) is None
    with pytest.raises(NotNowError):
        wizard_machine.act(w, Action.ACCEPT, stopped)


def test_every_state_can_be_reached_and_left_except_the_last() -> None:
    reached = {after for row in TRANSITIONS.values() for after in row.values()} | {State.CONNECT}
    assert reached == set(State) == set(TRANSITIONS)
    assert [s for s in State if not TRANSITIONS[s]] == [State.FINISHED]


def test_the_straight_way_from_connect_to_finish() -> None:
    w, status = Wizard(PROTOCOLS, 3.0), READY
    w, effects = wizard_machine.act(w, Action.CONTINUE, status)
    assert (w.state, kinds(effects)) == (State.POSE_READY, [(CueTask, "initial_pose")])
    w, _ = wizard_machine.act(w, Action.START, status)
    w, effects = wizard_machine.tick(w, status)
    assert (w.state, list(effects)) == (State.POSE_HOLD, [])
    status = later(status, 3.2)
    w, effects = wizard_machine.tick(w, status)
    assert (w.state, kinds(effects)) == (State.POSE_WORK, [(Calibrate, "")])
    assert (
        wizard_machine.tick(w, later(status, 5.0))[0] is w
    )  # until the station says that it is computed
    assert (effects[0].onset, effects[0].end) == (50.0, pytest.approx(53.2))
    w, _ = wizard_machine.accept_pose(w, status, poor=0)
    assert w.state is State.POSE_REVIEW
    w, _ = wizard_machine.act(w, Action.ACCEPT, status)
    w, _ = wizard_machine.act(w, Action.CHOOSE, status, "tapping")
    w, effects = wizard_machine.act(w, Action.START, status)
    assert (w.state, kinds(effects)) == (State.COUNTDOWN, [(CueTask, "tapping")])
    w, _ = wizard_machine.tick(w, later(status, 2.9))
    assert w.state is State.COUNTDOWN
    status = later(status, 3.0)
    w, _ = wizard_machine.tick(w, status)
    assert (w.state, w.onset) == (State.TASK_RUN, status.t)
    w, _ = wizard_machine.tick(w, later(status, 14.9))
    assert w.state is State.TASK_RUN
    status = later(status, 15.0)
    w, effects = wizard_machine.tick(w, status)
    assert (w.state, kinds(effects)) == (State.TASK_REVIEW, [(CueTask, "rest")])
    w, effects = wizard_machine.act(w, Action.ACCEPT, status)
    assert [(type(o), o.task, o.end - o.onset, o.outcome) for o in effects] == [
        (KeepAttempt, "tapping", pytest.approx(15.0), "accepted")
    ]
    assert (w.outcome("tapping"), w.accepted("tapping")) == ("", 1)  # of three trials
    w, effects = wizard_machine.act(w, Action.FINISH, status)
    assert (w.state, kinds(effects)) == (State.FINISHED, [(Finish, "")])


def test_movement_in_the_pose_starts_the_count_again() -> None:
    w, _ = wizard_machine.tick(at(State.POSE_HOLD), READY)
    w, _ = wizard_machine.tick(w, later(READY, 2.0))
    assert wizard_machine.progress_share(w, later(READY, 2.0)) == pytest.approx(2 / 3)
    w, _ = wizard_machine.tick(w, later(READY, 2.1, angular_rate_peak=0.5))
    assert wizard_machine.progress_share(w, later(READY, 2.1)) == 0.0
    w, _ = wizard_machine.tick(w, later(READY, 2.2))
    w, _ = wizard_machine.tick(w, later(READY, 5.0))
    assert w.state is State.POSE_HOLD
    w, effects = wizard_machine.tick(w, later(READY, 5.4))
    assert (w.state, effects[0].onset) == (State.POSE_WORK, pytest.approx(READY.t + 2.2))


def test_a_glove_that_falls_silent_in_the_pose_starts_the_count_again() -> None:
    w, _ = wizard_machine.tick(at(State.POSE_HOLD), READY)
    w, _ = wizard_machine.tick(w, later(READY, 2.0, flowing=False))
    assert w.still_since is None


def test_a_refused_pose_goes_back_with_its_reason() -> None:
    w = wizard_machine.reject_pose(at(State.POSE_WORK), READY, "the hand was not still")
    assert (w.state, w.message) == (State.POSE_READY, "the hand was not still")
    w, _ = wizard_machine.act(w, Action.START, READY)
    assert w.message == ""


def test_the_ladder_is_proposed_rung_by_rung() -> None:
    w = at(State.POSE_READY)
    assert w.proposal(READY) is None
    w, _ = wizard_machine.act(w, Action.START, READY)
    assert w.proposal(later(READY, PATIENT - 0.1)) is None
    assert (
        w.proposal(later(READY, PATIENT + 0.1)) is Action.ASSIST
    )  # the hand does not become still
    w, effects = wizard_machine.act(w, Action.ASSIST, READY)
    assert (w.state, w.passive, kinds(effects)) == (
        State.POSE_READY,
        True,
        [(CueTask, "initial_pose")],
    )
    w = wizard_machine.reject_pose(
        replace(w, state=State.POSE_WORK), READY, "the hand was not still"
    )
    assert w.proposal(READY) is Action.WITHOUT
    w, effects = wizard_machine.act(w, Action.WITHOUT, READY)
    assert (w.state, w.calibrated, kinds(effects)) == (State.TASKS, False, [(Guess, "")])


def test_a_poor_calibration_proposes_movements_and_then_the_pose_again() -> None:
    w = replace(at(State.POSE_WORK), steps=tuple(load_steps().values()))
    good, _ = wizard_machine.accept_pose(w, READY, poor=0)
    assert good.proposal(READY) is None
    poor, _ = wizard_machine.accept_pose(w, READY, poor=3)
    assert poor.proposal(READY) is Action.CALIBRATE
    moving, _ = wizard_machine.act(poor, Action.CALIBRATE, READY)
    assert (moving.state, moving.task, moving.calibrated) == (State.STEP_READY, "flat_hand", True)
    assert replace(poor, used=frozenset({"flexion_all"})).proposal(READY) is Action.REDO
    assert replace(poor, steps=()).proposal(READY) is Action.REDO


def test_a_calibration_in_the_middle_of_a_session_can_be_left_and_the_one_before_stays() -> None:
    assert Action.STOP not in at(State.POSE_READY).allowed(READY)
    w = at(State.POSE_READY, calibrated=True)
    assert Action.WITHOUT not in w.allowed(READY)
    w, effects = wizard_machine.act(w, Action.STOP, READY)
    assert (w.state, list(effects)) == (State.TASKS, [])


def test_a_redone_task_is_kept_as_redone_and_is_not_done() -> None:
    w, effects = wizard_machine.act(
        at(State.TASK_REVIEW, task="tapping", onset=1.0, end=16.0), Action.REDO, READY
    )
    assert (w.state, w.outcome("tapping"), effects[0].outcome) == (State.TASK_READY, "", "redone")


def test_a_skipped_task_keeps_its_reason() -> None:
    w, effects = wizard_machine.act(
        at(State.TASK_READY, task="tapping"), Action.SKIP, READY, reason="pain"
    )
    assert (w.state, w.outcome("tapping"), effects[0].outcome) == (
        State.TASKS,
        "skipped",
        "skipped: pain",
    )
    routine = wizard_snapshot(w, READY)["groups"][0]
    assert (routine["name"], routine["done"]) == ("routine", 0)


@pytest.mark.parametrize("state", [State.TASK_READY, State.TASK_PAUSED, State.TASK_REVIEW])
def test_what_the_patient_could_not_do_is_kept_as_that_and_the_task_is_done_with(
    state: State,
) -> None:
    w, effects = wizard_machine.act(
        at(state, task="tapping", onset=1.0, end=9.0), Action.UNABLE, READY, reason="weakness"
    )
    assert (w.state, w.outcome("tapping"), kinds(effects)) == (
        State.TASKS,
        "unable",
        [(KeepAttempt, "tapping")],
    )
    assert effects[0].outcome == "unable: weakness"
    assert (
        isnan(effects[0].onset)
        if state is State.TASK_READY
        else (effects[0].onset, effects[0].end) == (1.0, 9.0)
    )


def test_the_clinicians_score_goes_with_an_accepted_trial_of_a_task_that_asks_for_one() -> None:
    w = at(State.TASK_REVIEW, task="kapandji", onset=1.0, end=31.0)
    assert wizard_machine.act(w, Action.ACCEPT, READY, score=7)[1][0].score == 7
    assert wizard_machine.act(w, Action.ACCEPT, READY)[1][0].score is None  # it may be left out
    with pytest.raises(
        NotNowError, match="the Kapandji score is 11; it is a whole number from 0 to 10"
    ):
        wizard_machine.act(w, Action.ACCEPT, READY, score=11)
    with pytest.raises(NotNowError, match="of a task that asks for one"):
        wizard_machine.act(w, Action.SKIP, READY, reason="pain", score=3)
    with pytest.raises(NotNowError, match="of a task that asks for one"):
        wizard_machine.act(at(State.TASK_REVIEW, task="rom_fist"), Action.ACCEPT, READY, score=3)


def test_continue_waits_for_samples_of_the_hand() -> None:
    for status in (
        replace(READY, flowing=False),
        replace(READY, measured=frozenset({"index_distal"})),
    ):
        assert Action.CONTINUE not in Wizard(PROTOCOLS, 3.0).allowed(status)
        with pytest.raises(NotNowError):
            wizard_machine.act(Wizard(PROTOCOLS, 3.0), Action.CONTINUE, status)


def test_only_tasks_whose_segments_are_measured_are_offered() -> None:
    status = replace(READY, measured=READY.measured - {"forearm", "index_distal"})
    offered = {p.name for p in at(State.TASKS).offered(status)}
    assert offered == {p.name for p in PROTOCOLS if not {"forearm", "index_distal"} & set(p.needs)}
    assert {"rom_fist", "repeatability_flat"} <= offered
    assert not {"rom_wrist", "tapping", "powerglove_01_index_mcp"} & offered
    with pytest.raises(NotNowError, match="rom_wrist"):
        wizard_machine.act(at(State.TASKS), Action.CHOOSE, status, "rom_wrist")


def test_the_usual_assessment_is_listed_until_another_group_is_chosen() -> None:
    w = at(State.TASKS)
    assert [p.name for p in w.listed(READY)] == [
        "rom_fist",
        "rom_spread",
        "rom_thumb",
        "rom_wrist",
        "tapping",
    ]
    assert list(w.groups(READY)) == [
        "routine",
        *(g for g in groups(PROTOCOLS) if g != "force"),
    ]  # this glove has no force sensors
    felt = replace(READY, measured=READY.measured | {"thumb_tip_force", "index_tip_force"})
    assert list(w.groups(felt)) == ["routine", *groups(PROTOCOLS)]
    w, effects = wizard_machine.act(w, Action.GROUP, READY, group="powerglove")
    assert (w.state, list(effects), len(w.listed(READY))) == (State.TASKS, [], 15)
    with pytest.raises(
        NotNowError, match="no group of tasks 'knee'; groups are routine, range_of_motion"
    ):
        wizard_machine.act(w, Action.GROUP, READY, group="knee")


def test_a_group_of_which_nothing_is_measured_is_not_offered() -> None:
    status = replace(
        READY, measured=frozenset(s for s in SEGMENTS if not s.startswith(("index", "middle")))
    )
    assert not {"powerglove", "tapping", "pinch"} & set(at(State.TASKS).groups(status))
    assert {"routine", "range_of_motion", "opposition", "repeatability"} <= set(
        at(State.TASKS).groups(status)
    )
    assert at(State.TASKS, group="powerglove").listed(status) == at(State.TASKS).offered(status)


def test_a_task_of_three_trials_goes_from_one_to_the_next_and_is_done_after_the_third() -> None:
    w, task = (
        at(State.TASK_REVIEW, task="powerglove_03_index_all", onset=1.0, end=21.0),
        "powerglove_03_index_all",
    )
    for trial in (1, 2):
        w, effects = wizard_machine.act(replace(w, state=State.TASK_REVIEW), Action.AGAIN, READY)
        assert (w.state, w.task, w.accepted(task), w.outcome(task)) == (
            State.TASK_READY,
            task,
            trial,
            "",
        )
        assert [(type(o), o.outcome) for o in effects] == [(KeepAttempt, "accepted")]
    w = replace(w, state=State.TASK_REVIEW)
    assert Action.AGAIN not in w.allowed(READY)
    w, _ = wizard_machine.act(w, Action.ACCEPT, READY)
    assert (w.state, w.accepted(task), w.outcome(task)) == (State.TASKS, 3, "accepted")


def test_trials_that_were_accepted_stay_when_the_rest_is_skipped() -> None:
    w, _ = wizard_machine.act(
        at(State.TASK_REVIEW, task="powerglove_03_index_all", onset=1.0, end=21.0),
        Action.AGAIN,
        READY,
    )
    w, _ = wizard_machine.act(w, Action.SKIP, READY, reason="tired")
    assert (
        w.state,
        w.accepted("powerglove_03_index_all"),
        w.outcome("powerglove_03_index_all"),
    ) == (State.TASKS, 1, "skipped")


def test_a_task_of_one_trial_offers_no_next_one() -> None:
    assert Action.AGAIN not in at(State.TASK_REVIEW, task="rom_fist").allowed(READY)


def test_the_rest_between_trials_is_counted_from_the_end_of_the_last_and_holds_nobody_up() -> None:
    w, status = at(State.TASK_RUN, task="repeatability_flat", onset=READY.t), later(READY, 120.0)
    w, _ = wizard_machine.tick(w, status)
    assert w.state is State.TASK_REVIEW
    w, _ = wizard_machine.act(w, Action.AGAIN, later(status, 10.0))
    assert wizard_machine.remaining_time(w, later(status, 10.0)) == pytest.approx(50.0)
    assert wizard_machine.remaining_time(w, later(status, 60.5)) is None
    assert Action.START in w.allowed(later(status, 10.0))
    assert (
        wizard_machine.remaining_time(at(State.TASK_READY, task="repeatability_flat"), READY)
        is None
    )  # before the first


def test_a_paced_task_ends_with_its_last_repetition() -> None:
    w = at(State.TASK_RUN, task="powerglove_01_index_mcp", onset=READY.t)
    assert wizard_machine.tick(w, later(READY, 19.9))[0].state is State.TASK_RUN
    assert wizard_machine.progress_share(w, later(READY, 5.0)) == pytest.approx(0.25)
    assert wizard_machine.tick(w, later(READY, 20.0))[0].state is State.TASK_REVIEW


def test_a_task_without_a_time_runs_until_somebody_ends_it() -> None:
    w = at(State.TASK_RUN, task="powerglove_15_index_circles", onset=READY.t)
    late = later(READY, 300.0)
    assert (wizard_machine.tick(w, late)[0].state, wizard_machine.remaining_time(w, late)) == (
        State.TASK_RUN,
        None,
    )
    assert wizard_machine.act(w, Action.STOP, late)[0].state is State.TASK_REVIEW


def test_a_task_begins_where_its_countdown_ended_not_where_that_was_noticed() -> None:
    w, _ = wizard_machine.tick(
        at(State.COUNTDOWN, task="powerglove_01_index_mcp"), later(READY, 3.08)
    )
    assert (w.state, w.onset) == (State.TASK_RUN, pytest.approx(READY.t + 3.0))


PRESSES = st.tuples(
    st.sampled_from(list(Action)),
    st.floats(0, 4),
    st.floats(0, 0.2),
    st.booleans(),
    st.sampled_from(
        ["tapping", "powerglove_03_index_all", "powerglove_15_index_circles", "repeatability_flat"]
    ),
    st.sampled_from(["routine", "powerglove"]),
    st.sampled_from(["flat_hand", "flexion_mcp", "figure_eight"]),
    st.lists(st.just("the hand moved"), max_size=1),
)


@given(st.lists(PRESSES, max_size=60))
def test_whatever_people_press_the_wizard_stays_on_its_table(
    presses: list[tuple[Action, float, float, bool, str, str, str, list[str]]],
) -> None:
    w, status = Wizard(PROTOCOLS, 3.0, tuple(load_steps().values())), READY
    for what, wait, angular_rate_peak, flowing, task, group, step, problems in presses:
        status = later(status, wait, angular_rate_peak=angular_rate_peak, flowing=flowing)
        before = w.state
        w, effects = wizard_machine.tick(w, status)
        assert w.state is before or w.state in TRANSITIONS[before].values()
        if w.state is State.POSE_WORK:
            w = (
                wizard_machine.reject_pose(w, status, "moved")
                if problems
                else wizard_machine.accept_pose(w, status, 1)[0]
            )
        if any(isinstance(o, MeasureStep) for o in effects):
            w = wizard_machine.record_judgement(w, problems)
        allowed = w.allowed(status)
        assert set(allowed) <= BY_PERSON
        if what in allowed:
            before = w.state
            w, _ = wizard_machine.act(
                w, what, status, step if before in STEPPING else task, "reason", group
            )
            assert w.state is TRANSITIONS[before][what]
        else:
            with pytest.raises(NotNowError):
                wizard_machine.act(w, what, status, task)
        assert 0.0 <= wizard_machine.progress_share(w, status) <= 1.0
        assert (wizard_machine.remaining_time(w, status) or 0.0) >= 0.0


def checked(moves: dict[str, str]) -> tuple[Wizard, list[Effect]]:
    """The sensor check gone through; by finger asked for, whose strip moves."""
    w, effects = wizard_machine.act(Wizard(PROTOCOLS, 3.0), Action.CHECK, READY)
    cued, status = [*effects], READY
    while (asked := w.asked(status)) is not None:
        moving = replace(
            status, angular_rate_peak=1.5, bends="thumb"
        )  # still, from the finger before
        assert wizard_machine.tick(w, moving)[0] == w
        status = later(status, SETTLE + 0.1)
        w, _ = wizard_machine.tick(w, status)
        assert w.calm
        assert (
            wizard_machine.tick(w, replace(status, angular_rate_peak=1.5))[0] == w
        )  # something moves, but none alone
        w, effects = (
            wizard_machine.tick(w, replace(status, angular_rate_peak=1.5, bends=moves[asked]))
            if moves[asked]
            else wizard_machine.act(w, Action.NEXT, status)
        )
        cued += effects
    return wizard_machine.tick(w, status)[0], cued


def test_the_sensor_check_asks_for_every_finger_and_sees_whose_strip_moves() -> None:
    w, cued = checked({f: f for f in FINGERS})
    assert kinds(cued) == [(CueFinger, f) for f in FINGERS]
    assert (w.state, w.seen, w.exchangeable()) == (
        State.CHECKED,
        tuple((f, f) for f in FINGERS),
        {},
    )
    assert Action.EXCHANGE not in w.allowed(READY)


def test_two_strips_on_each_others_finger_are_exchanged_by_one_press_and_checked_again() -> None:
    w, _ = checked({**{f: f for f in FINGERS}, "index": "ring", "ring": "index"})
    assert w.exchangeable() == {"index": "ring", "ring": "index"}
    w, effects = wizard_machine.act(w, Action.EXCHANGE, READY)
    assert (w.state, w.seen, kinds(effects)) == (
        State.CHECK,
        (),
        [(Exchange, ""), (CueFinger, "thumb")],
    )
    assert dict(effects[0].worn_on) == {"index": "ring", "ring": "index"}


@given(worn=st.permutations(FINGERS), dead=st.sampled_from(["", *FINGERS]))
def test_strips_mixed_up_in_any_way_are_read_as_worn_after_one_press(
    worn: list[str], dead: str
) -> None:
    strip_on = dict(zip(FINGERS, worn))  # the strip of which finger sits on each
    w, _ = checked({f: "" if f == dead else strip for f, strip in strip_on.items()})
    put_right = w.exchangeable()
    assert all(strip_on[finger] == strip != finger for strip, finger in put_right.items())
    assert set(put_right) == set(
        put_right.values()
    )  # no strip is read for a finger that another is read for, too
    if not dead:
        assert {f: put_right.get(strip, strip) for f, strip in strip_on.items()} == {
            f: f for f in FINGERS
        }
    elif strip_on[dead] == dead:
        assert len(put_right) == sum(f != strip for f, strip in strip_on.items())


def test_a_strip_that_does_not_move_and_one_that_moves_for_another_are_no_exchange() -> None:
    w, _ = checked({**{f: f for f in FINGERS}, "index": "", "ring": "little"})
    assert (dict(w.seen)["index"], dict(w.seen)["ring"], w.exchangeable()) == ("", "little", {})


def test_a_pose_that_shows_two_strips_exchanged_is_taken_again_after_the_exchange() -> None:
    w, _ = wizard_machine.accept_pose(at(State.POSE_WORK), READY, 0, ("thumb", "index"))
    assert w.proposal(READY) is Action.EXCHANGE
    w, effects = wizard_machine.act(w, Action.EXCHANGE, READY)
    assert (w.state, w.swapped, w.calibrated) == (State.POSE_READY, None, False)
    assert kinds(effects) == [(DropPose, ""), (Exchange, ""), (CueTask, "initial_pose")]
    assert dict(effects[1].worn_on) == {"thumb": "index", "index": "thumb"}


def test_everything_that_is_proposed_or_can_come_of_a_task_has_words() -> None:
    proposed = [
        *(
            (state, act)
            for state in (State.POSE_READY, State.POSE_HOLD)
            for act in (Action.ASSIST, Action.WITHOUT)
        ),
        *((State.POSE_REVIEW, act) for act in (Action.CALIBRATE, Action.REDO, Action.EXCHANGE)),
    ]
    keys = [f"proposal.{state}.{act}" for state, act in proposed] + [
        f"outcome.{o}" for o in set(OUTCOMES.values()) - set(PASSING)
    ]
    keys += [f"joints.{grade}" for grade in GRADES] + [
        f"joints.why.{reason}" for reason in (*LIMITS, "fault", "uncalibrated")
    ]
    keys += [f"group.{group}" for group in groups(PROTOCOLS)]
    assert [key for key in keys if key not in ENGLISH.pages] == []


def test_a_correction_that_the_readings_leave_is_offered_while_the_glove_is_put_on() -> None:
    mend = "gyroscope index_middle 1 0 0 0 1 0 0 0 -1"
    w = wizard_machine.propose(at(State.CONNECT), None, mend)
    assert w.proposal(READY) is Action.CORRECT
    after, effects = wizard_machine.act(w, Action.CORRECT, READY)
    assert [*effects] == [Correct(mend)]
    assert after.state is State.CONNECT and Action.CORRECT not in after.allowed(READY)
    assert wizard_machine.propose(at(State.TASKS), None, mend).mend == ""


def test_strips_that_movement_shows_on_each_others_finger_can_be_exchanged_at_once() -> None:
    w = wizard_machine.propose(at(State.CONNECT), ("index", "ring"), "")
    assert w.proposal(READY) is Action.EXCHANGE
    after, effects = wizard_machine.act(w, Action.EXCHANGE, READY)
    assert dict(effects[0].worn_on) == {"index": "ring", "ring": "index"}
    assert after.state is State.CONNECT and after.swapped is None


def test_a_pose_is_repeated_at_most_twice_and_a_task_ends_the_row() -> None:
    w = at(State.POSE_REVIEW)
    for number in (2, 3):
        w, effects = wizard_machine.act(w, Action.REPEAT, READY)
        assert (w.state, w.repetition) == (State.POSE_READY, number)
        assert kinds(effects) == [(CueTask, "initial_pose")]  # the pose before stays
        w, _ = wizard_machine.act(replace(w, state=State.POSE_REVIEW), Action.REDO, READY)
        assert w.repetition == number  # this one is taken again
        w = replace(w, state=State.POSE_REVIEW)
    assert Action.REPEAT not in w.allowed(READY)
    w, _ = wizard_machine.act(w, Action.ACCEPT, READY)
    assert (w.state, w.repetition) == (State.TASKS, 1)


def test_a_press_keeps_the_trial_and_goes_on_to_the_next_open_task() -> None:
    plan = tuple(p for p in PROTOCOLS if p.name in ("rom_fist", "rom_spread", "rom_thumb"))
    w = replace(at(State.POSE_REVIEW), protocols=plan)
    w, _ = wizard_machine.act(w, Action.ONWARD, READY)
    assert (w.state, w.task, w.calibrated) == (State.TASK_READY, "rom_fist", True)
    skipped = replace(w, state=State.TASK_READY, task="rom_spread")
    w, _ = wizard_machine.act(skipped, Action.SKIP, READY, reason="pain")
    review = replace(w, state=State.TASK_REVIEW, task="rom_fist", onset=50.0, end=65.0)
    assert Action.CLOSE not in review.allowed(READY)
    w, effects = wizard_machine.act(review, Action.ONWARD, READY)
    assert (w.state, w.task, w.outcome("rom_fist")) == (State.TASK_READY, "rom_thumb", "accepted")
    assert kinds(effects)[0] == (KeepAttempt, "rom_fist")
    last = replace(w, state=State.TASK_REVIEW, onset=50.0, end=65.0)
    assert Action.ONWARD not in last.allowed(READY)
    w, effects = wizard_machine.act(last, Action.CLOSE, READY)
    assert w.state is State.FINISHED
    assert [type(e) for e in effects] == [KeepAttempt, Finish]


def test_while_trials_are_left_no_other_task_is_gone_on_to() -> None:
    w = at(State.TASK_REVIEW, task="tapping", onset=50.0, end=65.0)
    assert {Action.ONWARD, Action.CLOSE}.isdisjoint(w.allowed(READY))
    assert Action.AGAIN in w.allowed(READY)
