"""The wizard that leads a session: a state machine without a GUI, clock or device. Pages only draw it.

Everything about states is the table in wizard_table.py: `TRANSITIONS[state][event]` is the next state; what is not there is refused.
Facts about glove and patient come in with every tick; what the station has to do comes out as orders.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

from app.live.wizard_table import BY_PERSON as BY_PERSON
from app.live.wizard_table import COUNTING as COUNTING
from app.live.wizard_table import OUTCOMES as OUTCOMES
from app.live.wizard_table import PASSING as PASSING
from app.live.wizard_table import RUNNING as RUNNING
from app.live.wizard_table import STEPPING as STEPPING
from app.live.wizard_table import TRANSITIONS as TRANSITIONS
from app.live.wizard_table import Act as Act
from app.live.wizard_table import State as State
from app.protocols import Protocol, groups
from estimators.functional_steps import BENT
from estimators.hand_anatomy import CHAINS, FINGERS

ROUTINE = "routine"  # the group of the usual assessment
LATE = 0.3  # s after a calibration step until it is measured: by then the last strip's samples have come
CALM = 0.3  # rad/s below which nothing bends: between two fingers of the check
SETTLE = 1.2  # s after a finger was asked for until a calm counts: movement is told over a second
PATIENT = 15.0  # s of a pose that does not become still until another way is proposed
STILL_RATE = 0.07  # rad/s (4 deg/s) of every sensor's wander within a second: the bar fills only while it is below


@dataclass(frozen=True)
class Facts:
    """What the station knows at a tick."""

    now: float  # s, host's clock
    t: float  # s, the recording's newest sample
    flowing: bool  # samples are arriving
    wander: float  # rad/s, of the sensor that moves most
    restless: str  # its segment
    measured: frozenset[str]  # segments with samples
    bends: str = ""  # the finger that moves while the others hardly do


@dataclass(frozen=True)
class Attempt:
    """A stretch of the recording in which a task was done, or why it was not."""

    task: str
    onset: float  # s in the recording; NaN for a skipped task
    end: float
    outcome: str  # accepted, redone, paused (and begun again), skipped, unable
    reason: str = ""
    score: float | None = None  # the clinician's own


@dataclass(frozen=True)
class Judged:
    """A step of the calibration that was done, and what was wrong with it."""

    step: str
    problems: tuple[str, ...] = ()


@dataclass(frozen=True)
class Wizard:
    """Everything that a page needs to draw where the session stands."""

    protocols: tuple[Protocol, ...]
    pose_duration: float
    steps: tuple[Protocol, ...] = ()  # of a functional calibration; empty where the method makes nothing of it
    state: State = State.CONNECT
    since: float = 0.0  # host's clock when the state began
    group: str = ROUTINE  # of the tasks that are listed
    seen: tuple[tuple[str, str], ...] = ()  # of the sensor check: the finger asked for, and whose strip moved ("" for none)
    calm: bool = False  # since the last finger of the check
    swapped: tuple[str, str] | None = None  # two fingers whose strips the pose shows on each other's
    task: str | None = None  # or step
    onset: float = 0.0  # recording time at which the pose, task or step began
    end: float = 0.0
    still_since: float | None = None  # recording time
    passive: bool = False  # the therapist lays the hand into the pose
    calibrated: bool = False  # or somebody decided to go on without
    refusals: int = 0  # poses that could not be used, since the last one that could
    poor: int = 0  # joints of which the newest calibration is poor
    attempts: tuple[Attempt, ...] = ()
    judged: tuple[Judged, ...] = ()  # steps of the calibration that goes on, the newest attempt of each
    used: frozenset[str] = frozenset()  # steps that are in force, or will be from the next initial pose on
    closing: bool = False  # the next initial pose brings the steps into force
    rested_since: float = -inf  # host's clock when the newest trial ended
    message: str = ""  # the last thing that went wrong, for the person

    @property
    def protocol(self) -> Protocol | None:
        return next((p for p in (*self.protocols, *self.steps) if p.name == self.task), None)

    def allowed(self, facts: Facts) -> list[Act]:
        """What a person can do now, in the order of the table."""
        acts = [a for a in TRANSITIONS[self.state] if a in BY_PERSON]
        barred = {
            Act.CONTINUE: not ready(facts),
            Act.CHECK: not ready(facts) or len(self.checkable(facts)) < 2,
            Act.EXCHANGE: self.exchangeable() is None,
            Act.WITHOUT: self.calibrated or not ready(facts),
            Act.STOP: self.state is State.POSE_READY and not self.calibrated,
            Act.AGAIN: not self._trials_left(),
            Act.CALIBRATE: not self.steps_offered(facts),
            Act.NEXT: self.state is not State.CHECK and self.next_step(facts) is None,
            Act.USE: not self._usable(),
        }
        return [a for a in acts if not barred.get(a, False)]

    def offered(self, facts: Facts) -> list[Protocol]:
        """Tasks that can be done with what is measured."""
        return [p for p in self.protocols if set(p.needs) <= facts.measured]

    def steps_offered(self, facts: Facts) -> list[Protocol]:
        """Steps of a functional calibration that can be done with what is measured."""
        return [p for p in self.steps if set(p.needs) <= facts.measured]

    def next_step(self, facts: Facts) -> str | None:
        """The step after this one."""
        names = [p.name for p in self.steps_offered(facts)]
        return next(iter(names[names.index(self.task) + 1 :]), None) if self.task in names else None

    def checkable(self, facts: Facts) -> list[str]:
        """Fingers of which a strip gives samples."""
        return [f for f in FINGERS if CHAINS[f][-1] in facts.measured]

    def asked(self, facts: Facts) -> str | None:
        """The finger that is to bend now in the sensor check."""
        return next((f for f in self.checkable(facts) if f not in dict(self.seen)), None) if self.state is State.CHECK else None

    def exchangeable(self) -> tuple[str, str] | None:
        """Two fingers whose strips are on each other's, as check or pose found."""
        if self.state is State.POSE_REVIEW:
            return self.swapped
        moved = dict(self.seen) if self.state is State.CHECKED else {}
        return next(((f, g) for f, g in moved.items() if f != g and moved.get(g) == f), None)

    def proposal(self, facts: Facts) -> Act | None:
        """The next rung of the ladder, where this one does not do: pose, pose given by the therapist, movements; at last none."""
        waited = self.state is State.POSE_HOLD and facts.now - self.since > PATIENT
        if waited or (self.state is State.POSE_READY and self.refusals):
            wish = Act.ASSIST if not self.passive else Act.WITHOUT
        elif self.state is State.POSE_REVIEW and self.swapped:
            wish = Act.EXCHANGE
        elif self.state is State.POSE_REVIEW and self.poor:
            wish = Act.REDO if self.used or not self.steps_offered(facts) else Act.CALIBRATE
        else:
            return None
        return wish if wish in self.allowed(facts) else None

    def judgement(self, step: str | None) -> Judged | None:
        """What became of a step in this calibration."""
        return next((j for j in self.judged if j.step == step), None)

    def groups(self, facts: Facts) -> dict[str, list[Protocol]]:
        """Tasks that can be done by group, the usual assessment first."""
        offered = self.offered(facts)
        every = {ROUTINE: [p for p in offered if p.routine]} | {g: [p for p in offered if p.group == g] for g in groups(offered)}
        return {name: tasks for name, tasks in every.items() if tasks}

    def listed(self, facts: Facts) -> list[Protocol]:
        """Tasks of the group; all that can be done where the group has none."""
        return self.groups(facts).get(self.group) or self.offered(facts)

    def accepted(self, task: str) -> int:
        """Trials of a task that were accepted."""
        return sum(a.task == task and a.outcome == "accepted" for a in self.attempts)

    def outcome(self, task: str) -> str:
        """The newest outcome of a task, empty before it was tried and while trials of it are to come."""
        newest = next((a.outcome for a in reversed(self.attempts) if a.task == task and a.outcome not in PASSING), "")
        trials = next((p.trials for p in self.protocols if p.name == task), 1)
        return "" if newest == "accepted" and self.accepted(task) < trials else newest

    def _usable(self) -> bool:
        """Whether a step was done well and some step tells about which axes the joints bend."""
        good = _good(self)
        return bool(good) and bool((good | self.used) & set(BENT))

    def _trials_left(self) -> bool:
        """Whether another trial of the task follows the one under review."""
        return self.protocol is not None and self.accepted(self.protocol.name) + 1 < self.protocol.trials


@dataclass(frozen=True)
class Order:
    """What the station has to do after a step: calibrate, cue, keep_attempt, drop_pose, finish; measure_step, drop_step, drop_steps, use_steps."""

    kind: str
    task: str = ""
    onset: float = 0.0
    end: float = 0.0
    reason: str = ""
    score: float | None = None


class NotNowError(Exception):
    """A person asked for something that this state does not offer."""


def ready(facts: Facts) -> bool:
    """Samples flow and the hand's sensor is among them."""
    return facts.flowing and "hand" in facts.measured


def act(
    wizard: Wizard, what: Act, facts: Facts, task: str = "", reason: str = "", group: str = "", score: float | None = None
) -> tuple[Wizard, Sequence[Order]]:
    """A person's wish; NotNowError where the state does not offer it."""
    if what not in wizard.allowed(facts):
        raise NotNowError(f"{what} is not possible now ({wizard.state})")
    if score is not None:
        _require_score(wizard, what, score)
    if what is Act.CHOOSE:
        stepping = wizard.state in STEPPING
        if task not in {p.name for p in (wizard.steps_offered(facts) if stepping else wizard.offered(facts))}:
            raise NotNowError(f"there is no {'step' if stepping else 'task'} {task!r} to choose")
        wizard = replace(wizard, task=task)
    if what is Act.CALIBRATE:
        wizard = replace(wizard, task=wizard.steps_offered(facts)[0].name)
    if what is Act.NEXT and wizard.state is State.CHECK:
        return _asked(wizard, facts, "")
    if what is Act.NEXT:
        wizard = replace(wizard, task=wizard.next_step(facts))
    if what is Act.GROUP:
        if group not in wizard.groups(facts):
            raise NotNowError(f"there is no group of tasks {group!r}; groups are {', '.join(wizard.groups(facts))}")
        wizard = replace(wizard, group=group)
    return _enter(wizard, what, facts, reason, score)


def tick(wizard: Wizard, facts: Facts) -> tuple[Wizard, Sequence[Order]]:
    """Time passed: pose held long enough, countdown over, task or step over."""
    if wizard.state is State.POSE_HOLD:
        return _hold(wizard, facts)
    if wizard.state is State.CHECK:
        return _check(wizard, facts)
    protocol = wizard.protocol
    if wizard.state in COUNTING and protocol and facts.now - wizard.since >= protocol.countdown:
        return _enter(wizard, Act.STARTED, facts)
    late = LATE if wizard.state is State.STEP_RUN else 0.0
    if wizard.state in RUNNING and protocol and protocol.length and facts.t - wizard.onset >= protocol.length + late:
        return _enter(wizard, Act.ENDED, facts)
    return wizard, ()


def refused(wizard: Wizard, facts: Facts, message: str) -> Wizard:
    """The pose just held cannot be used: back to the pose with the reason."""
    return replace(wizard, state=State.POSE_READY, since=facts.now, still_since=None, message=message, refusals=wizard.refusals + 1)


def posed(wizard: Wizard, facts: Facts, poor: int, swapped: tuple[str, str] | None = None) -> tuple[Wizard, Sequence[Order]]:
    """The pose gave a calibration that is poor for so many joints, and may show that two strips are on each other's finger."""
    return _enter(replace(wizard, refusals=0, poor=poor, swapped=swapped), Act.POSED, facts)


def judge(wizard: Wizard, problems: Sequence[str]) -> Wizard:
    """The step just done was measured: whether it can be used, and if not, why."""
    others = tuple(j for j in wizard.judged if j.step != wizard.task)
    said = " ".join(f"{p[:1].upper()}{p[1:]}." for p in problems)
    return replace(wizard, judged=(*others, Judged(wizard.task or "", tuple(problems))), message=said)


def progress(wizard: Wizard, facts: Facts) -> float:
    """Share of the pose, task or step done, 0 to 1."""
    if wizard.state is State.POSE_HOLD:
        return 0.0 if wizard.still_since is None else min(1.0, (facts.t - wizard.still_since) / wizard.pose_duration)
    if wizard.state in RUNNING and wizard.protocol and wizard.protocol.length:
        return min(1.0, max(0.0, facts.t - wizard.onset) / wizard.protocol.length)
    return 0.0


def remaining(wizard: Wizard, facts: Facts) -> float | None:
    """Seconds left of the rest between two trials, the countdown or the task; None where nothing is timed."""
    protocol = wizard.protocol
    if wizard.state is State.TASK_READY and protocol and protocol.pause and wizard.accepted(protocol.name):
        left = protocol.pause - (facts.now - wizard.rested_since)
        return left if left > 0 else None
    if wizard.state in COUNTING and protocol:
        return max(0.0, protocol.countdown - (facts.now - wizard.since))
    if wizard.state in RUNNING and protocol and protocol.length:
        return max(0.0, protocol.length - (facts.t - wizard.onset))
    return None


def _check(wizard: Wizard, facts: Facts) -> tuple[Wizard, Sequence[Order]]:
    """The strip that moves alone, after a calm, is that of the finger that was asked for, or should be."""
    asked = wizard.asked(facts)
    if asked is None:
        return _enter(wizard, Act.SEEN, facts)
    if not wizard.calm:
        return replace(wizard, calm=facts.flowing and facts.wander < CALM and facts.now - wizard.since > SETTLE), ()
    return _asked(wizard, facts, facts.bends) if facts.bends else (wizard, ())


def _asked(wizard: Wizard, facts: Facts, moved: str) -> tuple[Wizard, Sequence[Order]]:
    """Note whose strip moved, and ask for the next finger."""
    wizard = replace(wizard, seen=(*wizard.seen, (wizard.asked(facts) or "", moved)), calm=False, since=facts.now)
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
        raise NotNowError("a score is given with a trial that is accepted, of a task that asks for one")
    if score not in range(asked.least, asked.most + 1):
        raise NotNowError(f"the {asked.title} is {score:g}; it is a whole number from {asked.least} to {asked.most}")


def _enter(wizard: Wizard, what: Act, facts: Facts, reason: str = "", score: float | None = None) -> tuple[Wizard, Sequence[Order]]:
    """Follow the table and say what is to be done."""
    before, after = wizard.state, TRANSITIONS[wizard.state][what]
    orders: list[Order] = []
    if what is Act.EXCHANGE and (pair := wizard.exchangeable()):
        orders += [Order("drop_pose")] if before is State.POSE_REVIEW else []
        orders.append(Order("exchange", " ".join(pair)))
        wizard = replace(wizard, swapped=None, calibrated=False, used=frozenset())
    if after is State.CHECKED:
        orders.append(Order("look"))
    if after is State.CHECK:
        wizard = replace(wizard, seen=(), calm=False)
        orders.append(Order("cue_finger", wizard.checkable(facts)[0] if wizard.checkable(facts) else ""))
    if after is State.POSE_READY:
        orders.append(Order("cue", "initial_pose"))
    elif after is State.POSE_WORK:
        orders.append(Order("calibrate", onset=wizard.onset, end=wizard.end))
    elif after in COUNTING and wizard.task:
        orders.append(Order("cue", wizard.task))
    elif after in RUNNING:
        late = facts.now - wizard.since - (wizard.protocol.countdown if wizard.protocol else 0.0)  # a tick finds out a little afterwards
        wizard = replace(wizard, onset=facts.t - late)
    elif after in (State.TASK_REVIEW, State.TASK_PAUSED) and before is State.TASK_RUN:
        wizard = replace(wizard, end=facts.t, rested_since=facts.now)
        orders.append(Order("cue", "rest"))
    elif after is State.FINISHED:
        orders.append(Order("finish"))
    elif after is State.STEP_REVIEW and wizard.protocol:
        wizard = replace(wizard, end=wizard.onset + (wizard.protocol.length or 0.0))
        orders.append(Order("measure_step", wizard.task or "", wizard.onset, wizard.end))
    if before in STEPPING:
        wizard, more = _stepped(wizard, what, before)
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
    tried = before is State.TASK_REVIEW or (before is State.TASK_PAUSED and what is not Act.STOP)
    if tried or (before is State.TASK_READY and what in (Act.SKIP, Act.UNABLE)):
        wizard, order = _attempted(wizard, what, tried, reason, score)
        orders.insert(0, order)
    return replace(wizard, state=after, since=facts.now, still_since=None, message=""), orders


def _stepped(wizard: Wizard, what: Act, before: State) -> tuple[Wizard, list[Order]]:
    """What becomes of the calibration's steps: one is done again, all are used, or left with what was measured of them."""
    if what is Act.REDO:
        return replace(wizard, judged=tuple(j for j in wizard.judged if j.step != wizard.task)), [Order("drop_step", wizard.task or "")]
    if what is Act.USE:
        return replace(wizard, judged=(), used=wizard.used | _good(wizard), closing=True), [Order("use_steps")]
    if TRANSITIONS[before][what] is State.TASKS:
        return replace(wizard, judged=()), [Order("drop_steps")]
    if before in (State.STEP_COUNTDOWN, State.STEP_RUN) and what is Act.STOP:
        return wizard, [Order("cue", "rest")]
    return wizard, []


def _good(wizard: Wizard) -> frozenset[str]:
    """Steps of this calibration that can be used."""
    return frozenset(j.step for j in wizard.judged if not j.problems)


def _attempted(wizard: Wizard, what: Act, done: bool, reason: str, score: float | None) -> tuple[Wizard, Order]:
    outcome = OUTCOMES[what]
    reason = "" if outcome == "accepted" else reason  # what is accepted needs none, and none is read into its outcome
    start, end = (wizard.onset, wizard.end) if done else (float("nan"), float("nan"))
    attempt = Attempt(wizard.task or "", start, end, outcome, reason, score)
    kept = replace(wizard, attempts=(*wizard.attempts, attempt))
    return kept, Order("keep_attempt", attempt.task, start, end, f"{outcome}{': ' + reason if reason else ''}", score)
