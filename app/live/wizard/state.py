"""Everything that a page needs to draw where the session stands, and what can be done there; facts about glove and patient come in with every tick."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

from handscope.app.live.wizard.transition_table import BY_PERSON, PASSING, TRANSITIONS, Act, State
from handscope.app.protocols import Protocol, groups
from handscope.estimators.alignment.functional_movements import BENT
from handscope.estimators.hand.anatomy import CHAINS, FINGERS

ROUTINE = "routine"  # the group of the usual assessment
PATIENT = 15.0  # s of a pose that does not become still until another way is proposed


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
    kept: bool = True  # the recording takes what is measured; with a full disk it does not, and nothing but finishing makes sense


@dataclass(frozen=True)
class Attempt:
    """A stretch of the recording in which a task was done, or why it was not."""

    task: str
    onset: float  # s in the recording; NaN for a skipped task
    end: float
    outcome: str  # accepted, redone, paused (and begun again), skipped, unable
    reason: str = ""
    score: float | None = None  # the clinician's own
    pauses: tuple[
        tuple[float, float], ...
    ] = ()  # stretches (from, to) s within it that do not count


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
    steps: tuple[
        Protocol, ...
    ] = ()  # of a functional calibration; empty where the method makes nothing of it
    free: Protocol | None = (
        None  # the free movement that the hand is calibrated from; None where the method makes nothing of it
    )
    state: State = State.CONNECT
    since: float = 0.0  # host's clock when the state began
    group: str = ROUTINE  # of the tasks that are listed
    seen: tuple[
        tuple[str, str], ...
    ] = ()  # of the sensor check: the finger asked for, and whose strip moved ("" for none)
    calm: bool = False  # since the last finger of the check
    swapped: tuple[str, str] | None = (
        None  # two fingers whose strips the pose shows on each other's
    )
    task: str | None = None  # or step
    onset: float = 0.0  # recording time at which the pose, task or step began
    end: float = 0.0
    pauses: tuple[
        tuple[float, float], ...
    ] = ()  # recording time (from, to) s within the trial that does not count
    still_since: float | None = None  # recording time
    passive: bool = False  # the therapist lays the hand into the pose
    calibrated: bool = False  # or somebody decided to go on without
    refusals: int = 0  # poses that could not be used, since the last one that could
    poor: int = 0  # joints of which the newest calibration is poor
    attempts: tuple[Attempt, ...] = ()
    judged: tuple[
        Judged, ...
    ] = ()  # steps of the calibration that goes on, the newest attempt of each
    used: frozenset[str] = (
        frozenset()
    )  # steps that are in force, or will be from the next initial pose on
    closing: bool = False  # the next initial pose brings the steps into force
    rested_since: float = -inf  # host's clock when the newest trial ended
    message: str = ""  # the last thing that went wrong, for the person

    @property
    def protocol(self) -> Protocol | None:
        every = (*self.protocols, *self.steps, *((self.free,) if self.free else ()))
        return next((p for p in every if p.name == self.task), None)

    def allowed(self, facts: Facts) -> list[Act]:
        """What a person can do now, in the order of the table."""
        acts = [
            a for a in TRANSITIONS[self.state] if a in BY_PERSON and (facts.kept or a is Act.FINISH)
        ]
        barred = {
            Act.CONTINUE: not ready(facts),
            Act.CHECK: not ready(facts) or len(self.checkable(facts)) < 2,
            Act.EXCHANGE: not self.exchangeable(),
            Act.WITHOUT: self.calibrated or not ready(facts),
            Act.STOP: self.state is State.POSE_READY and not self.calibrated,
            Act.AGAIN: not self._trials_left(),
            Act.RESUME: self.protocol is None or self.protocol.resumes is None,
            Act.CALIBRATE: not self.steps_offered(facts),
            Act.NEXT: self.state is not State.CHECK and self.next_step(facts) is None,
            Act.USE: self.state is not State.FREE_REVIEW and not self._usable(),
            Act.FREE: self.free is None or not self._free_fingers(facts),
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
        return (
            next((f for f in self.checkable(facts) if f not in dict(self.seen)), None)
            if self.state is State.CHECK
            else None
        )

    def exchangeable(self) -> dict[str, str]:
        """By the finger that a strip is read for, the one that it is worn on: where check or pose found strips among themselves on other fingers."""
        if self.state is State.POSE_REVIEW and self.swapped:
            one, other = self.swapped
            return {one: other, other: one}
        moved = dict(self.seen) if self.state is State.CHECKED else {}
        return {
            strip: finger
            for finger, strip in moved.items()
            if strip != finger and _round(finger, moved)
        }

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
        every = {ROUTINE: [p for p in offered if p.routine]} | {
            g: [p for p in offered if p.group == g] for g in groups(offered)
        }
        return {name: tasks for name, tasks in every.items() if tasks}

    def listed(self, facts: Facts) -> list[Protocol]:
        """Tasks of the group; all that can be done where the group has none."""
        return self.groups(facts).get(self.group) or self.offered(facts)

    def accepted(self, task: str) -> int:
        """Trials of a task that were accepted."""
        return sum(a.task == task and a.outcome == "accepted" for a in self.attempts)

    def outcome(self, task: str) -> str:
        """The newest outcome of a task, empty before it was tried and while trials of it are to come."""
        newest = next(
            (
                a.outcome
                for a in reversed(self.attempts)
                if a.task == task and a.outcome not in PASSING
            ),
            "",
        )
        trials = next((p.trials for p in self.protocols if p.name == task), 1)
        return "" if newest == "accepted" and self.accepted(task) < trials else newest

    def _usable(self) -> bool:
        """Whether a step was done well and some step tells about which axes the joints bend."""
        good = good_steps(self)
        return bool(good) and bool((good | self.used) & set(BENT))

    def _free_fingers(self, facts: Facts) -> list[str]:
        """Fingers that hang together with the hand's sensor."""
        return [f for f in FINGERS if {"hand", CHAINS[f][0]} <= facts.measured]

    def _trials_left(self) -> bool:
        """Whether another trial of the task follows the one under review."""
        return (
            self.protocol is not None
            and self.accepted(self.protocol.name) + 1 < self.protocol.trials
        )


def _round(finger: str, moved: Mapping[str, str]) -> bool:
    """Whether going from a finger to the one whose strip moved for it, and on, leads back: then each of them is known to be worn by another."""
    at = moved[finger]
    for _ in moved:
        if at == finger or at not in moved:
            break
        at = moved[at]
    return at == finger


def ready(facts: Facts) -> bool:
    """Samples flow and the hand's sensor is among them."""
    return facts.flowing and "hand" in facts.measured


def good_steps(wizard: Wizard) -> frozenset[str]:
    """Steps of this calibration that can be used."""
    return frozenset(j.step for j in wizard.judged if not j.problems)
