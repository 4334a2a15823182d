"""The wizard that leads a session: a state machine without a GUI, clock or device. Pages only draw it.

wizard_table.py  everything about states: `TRANSITIONS[state][event]` is the next state; what is not there is refused
wizard_state.py  where the session stands and what can be done there, by facts about glove and patient that come in with every tick
wizard_time.py   how far a pose or a trial has come
Here             from one state to the next; what the station has to do comes out as orders
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

from handscope.app.live.wizard.progress_time import done as done
from handscope.app.live.wizard.progress_time import progress as progress
from handscope.app.live.wizard.progress_time import remaining as remaining
from handscope.app.live.wizard.progress_time import resumed_at as resumed_at
from handscope.app.live.wizard.state import PATIENT as PATIENT
from handscope.app.live.wizard.state import ROUTINE as ROUTINE
from handscope.app.live.wizard.state import Attempt as Attempt
from handscope.app.live.wizard.state import Facts as Facts
from handscope.app.live.wizard.state import Judged as Judged
from handscope.app.live.wizard.state import Wizard as Wizard
from handscope.app.live.wizard.state import good_steps
from handscope.app.live.wizard.state import ready as ready
from handscope.app.live.wizard.transition_table import BY_PERSON as BY_PERSON
from handscope.app.live.wizard.transition_table import COUNTING as COUNTING
from handscope.app.live.wizard.transition_table import MOVING_FREELY as MOVING_FREELY
from handscope.app.live.wizard.transition_table import OUTCOMES as OUTCOMES
from handscope.app.live.wizard.transition_table import PASSING as PASSING
from handscope.app.live.wizard.transition_table import RUNNING as RUNNING
from handscope.app.live.wizard.transition_table import STEPPING as STEPPING
from handscope.app.live.wizard.transition_table import TRANSITIONS as TRANSITIONS
from handscope.app.live.wizard.transition_table import Act as Act
from handscope.app.live.wizard.transition_table import State as State

LATE = 0.3  # s after a calibration step until it is measured: by then the last strip's samples have come
CALM = 0.3  # rad/s below which nothing bends: between two fingers of the check
SETTLE = 1.2  # s after a finger was asked for until a calm counts: movement is told over a second
STILL_RATE = 0.07  # rad/s (4 deg/s) of every sensor's wander within a second: the bar fills only while it is below


@dataclass(frozen=True)
class Order:
    """What the station has to do after a step: calibrate, cue, exchange, keep_attempt, drop_pose, finish; measure_step, drop_step, drop_steps, use_steps;
    watch_free, solve_free, leave_free, use_free."""

    kind: str
    task: str = ""
    onset: float = 0.0
    end: float = 0.0
    reason: str = ""
    score: float | None = None
    pauses: tuple[tuple[float, float], ...] = ()
    worn_on: tuple[
        tuple[str, str], ...
    ] = ()  # by the finger that a strip is read for, the one that it is worn on


class NotNowError(Exception):
    """A person asked for something that this state does not offer."""


def act(
    wizard: Wizard,
    what: Act,
    facts: Facts,
    task: str = "",
    reason: str = "",
    group: str = "",
    score: float | None = None,
) -> tuple[Wizard, Sequence[Order]]:
    """A person's wish; NotNowError where the state does not offer it."""
    if what not in wizard.allowed(facts):
        raise NotNowError(f"{what} is not possible now ({wizard.state})")
    if score is not None:
        _require_score(wizard, what, score)
    if what is Act.CHOOSE:
        stepping = wizard.state in STEPPING
        if task not in {
            p.name for p in (wizard.steps_offered(facts) if stepping else wizard.offered(facts))
        }:
            raise NotNowError(f"there is no {'step' if stepping else 'task'} {task!r} to choose")
        wizard = replace(wizard, task=task)
    if what is Act.CALIBRATE:
        wizard = replace(wizard, task=wizard.steps_offered(facts)[0].name)
    if what is Act.FREE and wizard.free:
        wizard = replace(wizard, task=wizard.free.name)
    if what is Act.NEXT and wizard.state is State.CHECK:
        return _asked(wizard, facts, "")
    if what is Act.NEXT:
        wizard = replace(wizard, task=wizard.next_step(facts))
    if what is Act.GROUP:
        if group not in wizard.groups(facts):
            raise NotNowError(
                f"there is no group of tasks {group!r}; groups are {', '.join(wizard.groups(facts))}"
            )
        wizard = replace(wizard, group=group)
    return _enter(wizard, what, facts, reason, score)


def tick(wizard: Wizard, facts: Facts) -> tuple[Wizard, Sequence[Order]]:
    """Time passed: pose held long enough, countdown over, task or step over. Without a recording nothing goes on."""
    if not facts.kept:
        return wizard, ()
    if wizard.state is State.POSE_HOLD:
        return _hold(wizard, facts)
    if wizard.state is State.CHECK:
        return _check(wizard, facts)
    protocol = wizard.protocol
    if wizard.state in COUNTING and protocol and facts.now - wizard.since >= protocol.countdown:
        return _enter(wizard, Act.STARTED, facts)
    late = LATE if wizard.state in (State.STEP_RUN, State.FREE_RUN) else 0.0
    if (
        wizard.state in RUNNING
        and protocol
        and protocol.length
        and done(wizard, facts.t) >= protocol.length + late
    ):
        return _enter(wizard, Act.ENDED, facts)
    return wizard, ()


def refused(wizard: Wizard, facts: Facts, message: str) -> Wizard:
    """The pose just held cannot be used: back to the pose with the reason."""
    return replace(
        wizard,
        state=State.POSE_READY,
        since=facts.now,
        still_since=None,
        message=message,
        refusals=wizard.refusals + 1,
    )


def posed(
    wizard: Wizard, facts: Facts, poor: int, swapped: tuple[str, str] | None = None
) -> tuple[Wizard, Sequence[Order]]:
    """The pose gave a calibration that is poor for so many joints, and may show that two strips are on each other's finger."""
    return _enter(replace(wizard, refusals=0, poor=poor, swapped=swapped), Act.POSED, facts)


def solved(wizard: Wizard, facts: Facts) -> Wizard:
    """The free movement gave a self-calibration, if somebody waits for one still."""
    return _enter(wizard, Act.SOLVED, facts)[0] if wizard.state is State.FREE_WORK else wizard


def unsolved(wizard: Wizard, facts: Facts, message: str) -> Wizard:
    """The free movement gave none: back to it with the reason."""
    return (
        replace(wizard, state=State.FREE_READY, since=facts.now, message=message)
        if wizard.state is State.FREE_WORK
        else wizard
    )


def judge(wizard: Wizard, problems: Sequence[str]) -> Wizard:
    """The step just done was measured: whether it can be used, and if not, why."""
    others = tuple(j for j in wizard.judged if j.step != wizard.task)
    said = " ".join(f"{p[:1].upper()}{p[1:]}." for p in problems)
    return replace(
        wizard, judged=(*others, Judged(wizard.task or "", tuple(problems))), message=said
    )


def _check(wizard: Wizard, facts: Facts) -> tuple[Wizard, Sequence[Order]]:
    """The strip that moves alone, after a calm, is that of the finger that was asked for, or should be."""
    asked = wizard.asked(facts)
    if asked is None:
        return _enter(wizard, Act.SEEN, facts)
    if not wizard.calm:
        return replace(
            wizard, calm=facts.flowing and facts.wander < CALM and facts.now - wizard.since > SETTLE
        ), ()
    return _asked(wizard, facts, facts.bends) if facts.bends else (wizard, ())


def _asked(wizard: Wizard, facts: Facts, moved: str) -> tuple[Wizard, Sequence[Order]]:
    """Note whose strip moved, and ask for the next finger."""
    wizard = replace(
        wizard, seen=(*wizard.seen, (wizard.asked(facts) or "", moved)), calm=False, since=facts.now
    )
    following = wizard.asked(facts)
    return wizard, [Order("cue_finger", following)] if following else []


def _hold(wizard: Wizard, facts: Facts) -> tuple[Wizard, Sequence[Order]]:
    """Count how long every sensor has been still; movement starts the count again."""
    if facts.wander > STILL_RATE or not facts.flowing:
        return replace(wizard, still_since=None), ()
    since = facts.t if wizard.still_since is None else wizard.still_since
    wizard = replace(wizard, still_since=since)
    if facts.t - since < wizard.pose_duration + 0.1:
        return wizard, ()
    held = replace(wizard, onset=since, end=facts.t)
    return _enter(held, Act.HELD, facts)


def _require_score(wizard: Wizard, what: Act, score: float) -> None:
    """NotNowError where a score is given that nobody asked for, or none that there is."""
    asked = wizard.protocol.score if wizard.protocol else None
    if asked is None or what not in (Act.ACCEPT, Act.AGAIN):
        raise NotNowError(
            "a score is given with a trial that is accepted, of a task that asks for one"
        )
    if score not in range(asked.least, asked.most + 1):
        raise NotNowError(
            f"the {asked.title} is {score:g}; it is a whole number from {asked.least} to {asked.most}"
        )


def _enter(
    wizard: Wizard, what: Act, facts: Facts, reason: str = "", score: float | None = None
) -> tuple[Wizard, Sequence[Order]]:
    """Follow the table and say what is to be done."""
    before, after = wizard.state, TRANSITIONS[wizard.state][what]
    orders: list[Order] = []
    if what is Act.EXCHANGE and (worn_on := wizard.exchangeable()):
        orders += [Order("drop_pose")] if before is State.POSE_REVIEW else []
        orders.append(Order("exchange", worn_on=tuple(worn_on.items())))
        wizard = replace(wizard, swapped=None, calibrated=False, used=frozenset())
    if after is State.CHECKED:
        orders.append(Order("look"))
    if after is State.CHECK:
        wizard = replace(wizard, seen=(), calm=False)
        orders.append(
            Order("cue_finger", wizard.checkable(facts)[0] if wizard.checkable(facts) else "")
        )
    if after is State.POSE_READY:
        orders.append(Order("cue", "initial_pose"))
    elif after is State.POSE_WORK:
        orders.append(Order("calibrate", onset=wizard.onset, end=wizard.end))
    elif after in COUNTING and wizard.task:
        orders.append(Order("cue", wizard.task))
    elif after in RUNNING:
        late = (
            facts.now - wizard.since - (wizard.protocol.countdown if wizard.protocol else 0.0)
        )  # a tick finds out a little afterwards
        begins = facts.t - late
        if (
            before is State.RESUME_COUNTDOWN
        ):  # what the pause broke off is done again, and counts once
            broken_off = wizard.end - (done(wizard, wizard.end) - resumed_at(wizard))
            wizard = replace(wizard, pauses=(*wizard.pauses, (broken_off, begins)))
        else:
            wizard = replace(wizard, onset=begins, pauses=())
    elif after in (State.TASK_REVIEW, State.TASK_PAUSED) and before is State.TASK_RUN:
        wizard = replace(wizard, end=facts.t, rested_since=facts.now)
        orders.append(Order("cue", "rest"))
    elif before in (State.COUNTDOWN, State.RESUME_COUNTDOWN):
        orders.append(Order("cue", "rest"))
    elif after is State.FINISHED:
        orders.append(Order("finish"))
    elif after is State.STEP_REVIEW and wizard.protocol:
        wizard = replace(wizard, end=wizard.onset + (wizard.protocol.length or 0.0))
        orders.append(Order("measure_step", wizard.task or "", wizard.onset, wizard.end))
    if before in STEPPING:
        wizard, more = _stepped(wizard, what, before)
        orders = [*more, *orders]
    if before in MOVING_FREELY or after in MOVING_FREELY:
        wizard, more = _freely(wizard, what, before, after, facts)
        orders = [*more, *orders]
    if what is Act.ASSIST:
        wizard = replace(wizard, passive=not wizard.passive)
    if what is Act.WITHOUT:
        orders.append(Order("guess"))
    if before is State.POSE_REVIEW and what not in (Act.REDO, Act.EXCHANGE):
        wizard = replace(wizard, closing=False, calibrated=True)
    if before is State.POSE_REVIEW and what is Act.REDO:
        wizard = replace(wizard, poor=0)
        orders.append(Order("drop_pose"))
    tried = before is State.TASK_REVIEW or (
        before is State.TASK_PAUSED and what not in (Act.STOP, Act.RESUME)
    )
    if tried or (before is State.TASK_READY and what in (Act.SKIP, Act.UNABLE)):
        wizard, order = _attempted(wizard, what, tried, reason, score)
        orders.insert(0, order)
    return replace(wizard, state=after, since=facts.now, still_since=None, message=""), orders


def _stepped(wizard: Wizard, what: Act, before: State) -> tuple[Wizard, list[Order]]:
    """What becomes of the calibration's steps: one is done again, all are used, or left with what was measured of them."""
    if what is Act.REDO:
        return replace(wizard, judged=tuple(j for j in wizard.judged if j.step != wizard.task)), [
            Order("drop_step", wizard.task or "")
        ]
    if what is Act.USE:
        return replace(wizard, judged=(), used=wizard.used | good_steps(wizard), closing=True), [
            Order("use_steps")
        ]
    if TRANSITIONS[before][what] is State.TASKS:
        return replace(wizard, judged=()), [Order("drop_steps")]
    if before in (State.STEP_COUNTDOWN, State.STEP_RUN) and what is Act.STOP:
        return wizard, [Order("cue", "rest")]
    return wizard, []


def _freely(
    wizard: Wizard, what: Act, before: State, after: State, facts: Facts
) -> tuple[Wizard, list[Order]]:
    """Free movement is watched, solved for, and what was found used or left."""
    if after is State.FREE_RUN:
        return wizard, [Order("watch_free", onset=wizard.onset)]
    if after is State.FREE_WORK:
        length = wizard.protocol.length if wizard.protocol and wizard.protocol.length else inf
        wizard = replace(wizard, end=min(facts.t, wizard.onset + length))
        return wizard, [
            Order("cue", "rest"),
            Order("solve_free", wizard.task or "", wizard.onset, wizard.end),
        ]
    if what is Act.USE and before is State.FREE_REVIEW:
        return replace(wizard, closing=True), [Order("use_free")]
    if what in (Act.STOP, Act.REDO) and before is not State.FREE_READY:
        return wizard, [
            Order("leave_free", reason="redone" if what is Act.REDO else "not used"),
            *([Order("cue", "rest")] if before in RUNNING + COUNTING else []),
        ]
    return wizard, []


def _attempted(
    wizard: Wizard, what: Act, tried: bool, reason: str, score: float | None
) -> tuple[Wizard, Order]:
    outcome = OUTCOMES[what]
    reason = (
        "" if outcome == "accepted" else reason
    )  # what is accepted needs none, and none is read into its outcome
    start, end = (wizard.onset, wizard.end) if tried else (float("nan"), float("nan"))
    attempt = Attempt(
        wizard.task or "", start, end, outcome, reason, score, wizard.pauses if tried else ()
    )
    kept = replace(wizard, attempts=(*wizard.attempts, attempt))
    return kept, Order(
        "keep_attempt",
        attempt.task,
        start,
        end,
        f"{outcome}{': ' + reason if reason else ''}",
        score,
        attempt.pauses,
    )
