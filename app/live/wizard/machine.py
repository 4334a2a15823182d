"""The step from one state of the wizard to the next: `act` on a person's action, `tick` ten times a second.

Both return the next wizard and the effects that the station carries out. An action that is not in
`TRANSITIONS` of the state is refused.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import inf

from handscope.app.live.wizard.effects import (
    Calibrate,
    CheckSensors,
    Correct,
    CueFinger,
    CueTask,
    DropPose,
    DropStep,
    DropSteps,
    Effect,
    Exchange,
    Finish,
    Guess,
    KeepAttempt,
    LeaveFree,
    MeasureStep,
    SolveFree,
    UseFree,
    UseSteps,
    WatchFree,
)
from handscope.app.live.wizard.progress_time import elapsed as elapsed
from handscope.app.live.wizard.progress_time import progress_share as progress_share
from handscope.app.live.wizard.progress_time import remaining_time as remaining_time
from handscope.app.live.wizard.progress_time import resumed_at as resumed_at
from handscope.app.live.wizard.state import PATIENT as PATIENT
from handscope.app.live.wizard.state import ROUTINE as ROUTINE
from handscope.app.live.wizard.state import Attempt as Attempt
from handscope.app.live.wizard.state import StationStatus as StationStatus
from handscope.app.live.wizard.state import StepJudgement as StepJudgement
from handscope.app.live.wizard.state import Wizard as Wizard
from handscope.app.live.wizard.state import good_steps
from handscope.app.live.wizard.state import ready as ready
from handscope.app.live.wizard.transition_table import BY_PERSON as BY_PERSON
from handscope.app.live.wizard.transition_table import COUNTING as COUNTING
from handscope.app.live.wizard.transition_table import MOVING_FREELY as MOVING_FREELY
from handscope.app.live.wizard.transition_table import OUTCOMES as OUTCOMES
from handscope.app.live.wizard.transition_table import PASSING as PASSING
from handscope.app.live.wizard.transition_table import POSING as POSING
from handscope.app.live.wizard.transition_table import RUNNING as RUNNING
from handscope.app.live.wizard.transition_table import STEPPING as STEPPING
from handscope.app.live.wizard.transition_table import TRANSITIONS as TRANSITIONS
from handscope.app.live.wizard.transition_table import Action as Action
from handscope.app.live.wizard.transition_table import State as State
from handscope.estimators.messages.sentence import phrase

# s after a calibration step until it is evaluated: the last strip's samples have arrived
LATE = 0.3
CALM = 0.3  # rad/s, no finger bends below: between two fingers of the check
SETTLE = 1.2  # s after a request until calm counts: movement is averaged over a second
SCORED = (Action.ACCEPT, Action.AGAIN, Action.ONWARD, Action.CLOSE)
STILL_RATE = 0.07  # rad/s (4 deg/s) of every sensor within a second: the pose is held below


class NotNowError(Exception):
    """A person's action that this state does not offer."""


def act(
    wizard: Wizard,
    what: Action,
    status: StationStatus,
    task: str = "",
    reason: str = "",
    group: str = "",
    score: float | None = None,
) -> tuple[Wizard, Sequence[Effect]]:
    """Carry out a person's action; NotNowError where the state does not offer it."""
    if what not in wizard.allowed(status):
        if what in wizard.allowed(replace(status, flowing=True)):
            raise NotNowError(phrase("live.no_samples_now"))
        raise NotNowError(phrase("live.not_now"))
    if score is not None:
        _require_score(wizard, what, score)
    if what in (Action.ONWARD, Action.CLOSE):
        return _accept_and_leave(wizard, status, score)
    if what is Action.CHOOSE:
        stepping = wizard.state in STEPPING
        if task not in {
            p.name for p in (wizard.steps_offered(status) if stepping else wizard.offered(status))
        }:
            raise NotNowError(
                phrase("live.no_such_step", name=task)
                if stepping
                else phrase("live.no_such_task", name=task)
            )
        wizard = replace(wizard, task=task)
    if what is Action.CALIBRATE:
        wizard = replace(wizard, task=wizard.steps_offered(status)[0].name)
    if what is Action.FREE and wizard.free:
        wizard = replace(wizard, task=wizard.free.name)
    if what is Action.NEXT and wizard.state is State.CHECK:
        return _record_strip(wizard, status, "")
    if what is Action.NEXT:
        wizard = replace(wizard, task=wizard.next_step(status))
    if what is Action.GROUP:
        if group not in wizard.groups(status):
            raise NotNowError(
                phrase("live.unknown_group", name=group, groups=", ".join(wizard.groups(status)))
            )
        wizard = replace(wizard, group=group)
    return _enter(wizard, what, status, reason, score)


def tick(wizard: Wizard, status: StationStatus) -> tuple[Wizard, Sequence[Effect]]:
    """Advance by time: pose held long enough, countdown, task or step over. Nothing happens without a recording."""
    if not status.is_recording:
        return wizard, ()
    if wizard.state is State.POSE_HOLD:
        return _advance_hold(wizard, status)
    if wizard.state is State.CHECK:
        return _advance_check(wizard, status)
    protocol = wizard.protocol
    if wizard.state in COUNTING and protocol and status.now - wizard.since >= protocol.countdown:
        return _enter(wizard, Action.STARTED, status)
    late = LATE if wizard.state in (State.STEP_RUN, State.FREE_RUN) else 0.0
    if (
        wizard.state in RUNNING
        and protocol
        and protocol.length
        and elapsed(wizard, status.t) >= protocol.length + late
    ):
        return _enter(wizard, Action.ENDED, status)
    return wizard, ()


def reject_pose(wizard: Wizard, status: StationStatus, message: str) -> Wizard:
    """Back to the pose, with the reason why it cannot be used."""
    return replace(
        wizard,
        state=State.POSE_READY,
        since=status.now,
        still_since=None,
        message=message,
        refusals=wizard.refusals + 1,
    )


def accept_pose(
    wizard: Wizard, status: StationStatus, poor: int, swapped: tuple[str, str] | None = None
) -> tuple[Wizard, Sequence[Effect]]:
    """The pose gave a calibration, poor for `poor` joints; `swapped` are two fingers whose strips are exchanged."""
    return _enter(replace(wizard, refusals=0, poor=poor, swapped=swapped), Action.POSED, status)


def propose(wizard: Wizard, swapped: tuple[str, str] | None, mend: str) -> Wizard:
    """Offer what the sensors' readings leave as the only answer, in the first step; elsewhere nothing is offered."""
    return replace(wizard, swapped=swapped, mend=mend) if wizard.state is State.CONNECT else wizard


def accept_free_movement(wizard: Wizard, status: StationStatus) -> Wizard:
    """The free movement gave a self-calibration; ignored where nobody waits for it."""
    return _enter(wizard, Action.SOLVED, status)[0] if wizard.state is State.FREE_WORK else wizard


def reject_free_movement(wizard: Wizard, status: StationStatus, message: str) -> Wizard:
    """The free movement gave no self-calibration: back to it, with the reason."""
    return (
        replace(wizard, state=State.FREE_READY, since=status.now, message=message)
        if wizard.state is State.FREE_WORK
        else wizard
    )


def record_judgement(wizard: Wizard, problems: Sequence[str]) -> Wizard:
    """Store the problems of the calibration step that just ended; none means that it can be used."""
    others = tuple(j for j in wizard.judged if j.step != wizard.task)
    message = " ".join(f"{p[:1].upper()}{p[1:]}." for p in problems)
    return replace(
        wizard, judged=(*others, StepJudgement(wizard.task or "", tuple(problems))), message=message
    )


def _advance_check(wizard: Wizard, status: StationStatus) -> tuple[Wizard, Sequence[Effect]]:
    """The strip that moves alone, after a calm, belongs to the requested finger, or should."""
    asked = wizard.asked(status)
    if asked is None:
        return _enter(wizard, Action.SEEN, status)
    if not wizard.calm:
        return replace(
            wizard,
            calm=status.flowing
            and status.angular_rate_peak < CALM
            and status.now - wizard.since > SETTLE,
        ), ()
    return _record_strip(wizard, status, status.bends) if status.bends else (wizard, ())


def _record_strip(
    wizard: Wizard, status: StationStatus, moved: str
) -> tuple[Wizard, Sequence[Effect]]:
    """Record whose strip moved, and request the next finger."""
    wizard = replace(
        wizard,
        seen=(*wizard.seen, (wizard.asked(status) or "", moved)),
        calm=False,
        since=status.now,
    )
    following = wizard.asked(status)
    return wizard, [CueFinger(following)] if following else []


def _advance_hold(wizard: Wizard, status: StationStatus) -> tuple[Wizard, Sequence[Effect]]:
    """Count how long every sensor has been still; movement restarts the count."""
    if status.angular_rate_peak > STILL_RATE or not status.flowing:
        return replace(wizard, still_since=None), ()
    since = status.t if wizard.still_since is None else wizard.still_since
    wizard = replace(wizard, still_since=since)
    if status.t - since < wizard.pose_duration + 0.1:
        return wizard, ()
    held = replace(wizard, onset=since, end=status.t)
    return _enter(held, Action.HELD, status)


def _accept_and_leave(
    wizard: Wizard, status: StationStatus, score: float | None
) -> tuple[Wizard, Sequence[Effect]]:
    """Accept what is under review, and on to the next task, or finish."""
    following = wizard.following(status)
    accepted, effects = _enter(wizard, Action.ACCEPT, status, score=score)
    if following is None:
        after, more = _enter(accepted, Action.FINISH, status)
    else:
        after, more = _enter(replace(accepted, task=following.name), Action.CHOOSE, status)
    return after, [*effects, *more]


def _require_score(wizard: Wizard, what: Action, score: float) -> None:
    """NotNowError for a score that the task does not ask for, or one outside its range."""
    asked = wizard.protocol.score if wizard.protocol else None
    if asked is None or what not in SCORED:
        raise NotNowError(phrase("live.no_score_here"))
    if score not in range(asked.least, asked.most + 1):
        raise NotNowError(
            phrase(
                "live.score_out_of_range",
                title=asked.title,
                value=score,
                least=asked.least,
                most=asked.most,
            )
        )


def _enter(
    wizard: Wizard,
    what: Action,
    status: StationStatus,
    reason: str = "",
    score: float | None = None,
) -> tuple[Wizard, Sequence[Effect]]:
    """Go to the next state of the table; returns the effects."""
    before, after = wizard.state, TRANSITIONS[wizard.state][what]
    effects: list[Effect] = []
    if what is Action.EXCHANGE and (worn_on := wizard.exchangeable()):
        effects += [DropPose()] if before is State.POSE_REVIEW else []
        effects.append(Exchange(tuple(worn_on.items())))
        wizard = replace(wizard, swapped=None, calibrated=False, used=frozenset())
    if what is Action.CORRECT:
        effects.append(Correct(wizard.mend))
    if before is State.CONNECT:
        wizard = replace(wizard, swapped=None, mend="")
    if after is State.CHECKED:
        effects.append(CheckSensors())
    if after is State.CHECK:
        wizard = replace(wizard, seen=(), calm=False)
        effects.append(CueFinger(wizard.checkable(status)[0] if wizard.checkable(status) else ""))
    if after is State.POSE_READY:
        effects.append(CueTask("initial_pose"))
    elif after is State.POSE_WORK:
        effects.append(Calibrate(wizard.onset, wizard.end))
    elif after in COUNTING and wizard.task:
        effects.append(CueTask(wizard.task))
    elif after in RUNNING:
        # a tick comes a little later
        late = status.now - wizard.since - (wizard.protocol.countdown if wizard.protocol else 0.0)
        begins = status.t - late
        if before is State.RESUME_COUNTDOWN:  # the interrupted part is repeated, and counts once
            broken_off = wizard.end - (elapsed(wizard, wizard.end) - resumed_at(wizard))
            wizard = replace(wizard, pauses=(*wizard.pauses, (broken_off, begins)))
        else:
            wizard = replace(wizard, onset=begins, pauses=())
    elif after in (State.TASK_REVIEW, State.TASK_PAUSED) and before is State.TASK_RUN:
        wizard = replace(wizard, end=status.t, rested_since=status.now)
        effects.append(CueTask("rest"))
    elif before in (State.COUNTDOWN, State.RESUME_COUNTDOWN):
        effects.append(CueTask("rest"))
    elif after is State.FINISHED:
        effects.append(Finish())
    elif after is State.STEP_REVIEW and wizard.protocol:
        wizard = replace(wizard, end=wizard.onset + (wizard.protocol.length or 0.0))
        effects.append(MeasureStep(wizard.task or "", wizard.onset, wizard.end))
    if before in STEPPING:
        wizard, more = _advance_steps(wizard, what, before)
        effects = [*more, *effects]
    if before in MOVING_FREELY or after in MOVING_FREELY:
        wizard, more = _advance_free_movement(wizard, what, before, after, status)
        effects = [*more, *effects]
    if what is Action.ASSIST:
        wizard = replace(wizard, passive=not wizard.passive)
    if what is Action.WITHOUT:
        effects.append(Guess())
    if before is State.POSE_REVIEW and what not in (Action.REDO, Action.EXCHANGE):
        wizard = replace(wizard, closing=False, calibrated=True)
    if what is Action.REPEAT:
        wizard = replace(wizard, repetition=wizard.repetition + 1)
    elif after not in POSING or what is Action.EXCHANGE:
        wizard = replace(wizard, repetition=1)
    if before is State.POSE_REVIEW and what is Action.REDO:
        wizard = replace(wizard, poor=0)
        effects.append(DropPose())
    tried = before is State.TASK_REVIEW or (
        before is State.TASK_PAUSED and what not in (Action.STOP, Action.RESUME)
    )
    if tried or (before is State.TASK_READY and what in (Action.SKIP, Action.UNABLE)):
        wizard, effect = _record_attempt(wizard, what, tried, reason, score)
        effects.insert(0, effect)
    return replace(wizard, state=after, since=status.now, still_since=None, message=""), effects


def _advance_steps(wizard: Wizard, what: Action, before: State) -> tuple[Wizard, list[Effect]]:
    """Effects on the calibration's steps: one is repeated, all are used, or all are dropped."""
    if what is Action.REDO:
        return replace(wizard, judged=tuple(j for j in wizard.judged if j.step != wizard.task)), [
            DropStep(wizard.task or "")
        ]
    if what is Action.USE:
        return replace(wizard, judged=(), used=wizard.used | good_steps(wizard), closing=True), [
            UseSteps()
        ]
    if TRANSITIONS[before][what] is State.TASKS:
        return replace(wizard, judged=()), [DropSteps()]
    if before in (State.STEP_COUNTDOWN, State.STEP_RUN) and what is Action.STOP:
        return wizard, [CueTask("rest")]
    return wizard, []


def _advance_free_movement(
    wizard: Wizard, what: Action, before: State, after: State, status: StationStatus
) -> tuple[Wizard, list[Effect]]:
    """Effects of free movement: start the meter, solve, use or drop the solution."""
    if after is State.FREE_RUN:
        return wizard, [WatchFree(wizard.onset)]
    if after is State.FREE_WORK:
        length = wizard.protocol.length if wizard.protocol and wizard.protocol.length else inf
        wizard = replace(wizard, end=min(status.t, wizard.onset + length))
        return wizard, [
            CueTask("rest"),
            SolveFree(wizard.task or "", wizard.onset, wizard.end),
        ]
    if what is Action.USE and before is State.FREE_REVIEW:
        return replace(wizard, closing=True), [UseFree()]
    if what in (Action.STOP, Action.REDO) and before is not State.FREE_READY:
        return wizard, [
            LeaveFree("redone" if what is Action.REDO else "not used"),
            *([CueTask("rest")] if before in RUNNING + COUNTING else []),
        ]
    return wizard, []


def _record_attempt(
    wizard: Wizard, what: Action, tried: bool, reason: str, score: float | None
) -> tuple[Wizard, Effect]:
    outcome = OUTCOMES[what]
    reason = "" if outcome == "accepted" else reason  # an accepted attempt has no reason
    start, end = (wizard.onset, wizard.end) if tried else (float("nan"), float("nan"))
    attempt = Attempt(
        wizard.task or "", start, end, outcome, reason, score, wizard.pauses if tried else ()
    )
    return replace(wizard, attempts=(*wizard.attempts, attempt)), KeepAttempt(
        attempt.task,
        start,
        end,
        f"{outcome}{': ' + reason if reason else ''}",
        score,
        attempt.pauses,
    )
