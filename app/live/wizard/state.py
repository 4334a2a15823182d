"""The wizard's state and what can be done in it; the status of glove and patient comes with every tick."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

from handscope.app.live.wizard.transition_table import (
    BY_PERSON,
    PASSING,
    TRANSITIONS,
    Action,
    State,
)
from handscope.app.protocols import Protocol, groups
from handscope.estimators.alignment.functional_movements import BENT
from handscope.estimators.hand.anatomy import CHAINS, FINGERS

ROUTINE = "routine"  # the group of the usual assessment
MOST_POSES = 3  # in a row
PATIENT = 15.0  # s of a restless pose until something else is proposed


@dataclass(frozen=True)
class StationStatus:
    """Glove and patient at a tick of the station."""

    now: float  # s, host's clock
    t: float  # s, the recording's newest sample
    flowing: bool  # samples are arriving
    angular_rate_peak: float  # rad/s, of the fastest sensor
    fastest_segment: str  # segment of that sensor
    measured: frozenset[str]  # segments with samples
    bends: str = ""  # the finger that moves while the others hardly do
    is_recording: bool = True  # False with a full disk: then only finishing makes sense


@dataclass(frozen=True)
class Attempt:
    """A part of the recording in which a task was done, or why it was not."""

    task: str
    onset: float  # s in the recording; NaN for a skipped task
    end: float
    outcome: str  # accepted, redone, paused (and begun again), skipped, unable
    reason: str = ""
    score: float | None = None  # the clinician's own
    pauses: tuple[tuple[float, float], ...] = ()  # (start, end) s within it that do not count


@dataclass(frozen=True)
class StepJudgement:
    """A finished step of the calibration, and its problems."""

    step: str
    problems: tuple[str, ...] = ()


@dataclass(frozen=True)
class Wizard:
    """The state of the session, complete for a page."""

    protocols: tuple[Protocol, ...]
    pose_duration: float
    # of a functional calibration; empty where the method makes nothing of it
    steps: tuple[Protocol, ...] = ()
    # the free movement that the hand is calibrated from; None where the method makes nothing of it
    free: Protocol | None = None
    plan_title: str = ""  # of the assessment plan whose tasks come first
    state: State = State.CONNECT
    since: float = 0.0  # host's clock when the state began
    group: str = ROUTINE  # of the tasks that are listed
    # of the sensor check: the finger asked for, and whose strip moved ("" for none)
    seen: tuple[tuple[str, str], ...] = ()
    calm: bool = False  # since the last finger of the check
    # two fingers whose strips pose or movement show on each other's
    swapped: tuple[str, str] | None = None
    mend: str = ""  # a correction of the sensors' readings that the checks propose
    task: str | None = None  # or step
    onset: float = 0.0  # recording time at which the pose, task or step began
    end: float = 0.0
    # recording time (from, to) s within the trial that does not count
    pauses: tuple[tuple[float, float], ...] = ()
    still_since: float | None = None  # recording time
    passive: bool = False  # the therapist lays the hand into the pose
    calibrated: bool = False  # or somebody decided to go on without
    refusals: int = 0  # poses that could not be used, since the last one that could
    poor: int = 0  # joints of which the newest calibration is poor
    attempts: tuple[Attempt, ...] = ()
    # steps of the calibration that goes on, the newest attempt of each
    judged: tuple[StepJudgement, ...] = ()
    # steps that are in force, or will be from the next initial pose on
    used: frozenset[str] = frozenset()
    # of the pose that is taken: from 2 on the hand was lifted since the one before
    repetition: int = 1
    closing: bool = False  # the next initial pose brings the steps into force
    rested_since: float = -inf  # host's clock when the newest trial ended
    message: str = ""  # the last thing that went wrong, for the person

    @property
    def protocol(self) -> Protocol | None:
        every = (*self.protocols, *self.steps, *((self.free,) if self.free else ()))
        return next((p for p in every if p.name == self.task), None)

    def allowed(self, status: StationStatus) -> list[Action]:
        """What a person can do now, in the order of the table."""
        acts = [
            a
            for a in TRANSITIONS[self.state]
            if a in BY_PERSON and (status.is_recording or a is Action.FINISH)
        ]
        following = self.following(status)
        barred = {
            Action.CONTINUE: not ready(status),
            Action.CHECK: not ready(status) or len(self.checkable(status)) < 2,
            Action.EXCHANGE: not self.exchangeable(),
            Action.CORRECT: not self.mend,
            Action.WITHOUT: self.calibrated or not ready(status),
            Action.STOP: self.state is State.POSE_READY and not self.calibrated,
            Action.AGAIN: not self._trials_left(),
            Action.ONWARD: self._trials_left() or following is None,
            Action.CLOSE: self._trials_left() or following is not None,
            Action.REPEAT: self.repetition >= MOST_POSES,
            Action.RESUME: self.protocol is None or self.protocol.resumes is None,
            Action.CALIBRATE: not self.steps_offered(status),
            Action.NEXT: self.state is not State.CHECK and self.next_step(status) is None,
            Action.USE: self.state is not State.FREE_REVIEW and not self._usable(),
            Action.FREE: self.free is None or not self._free_fingers(status),
        }
        return [a for a in acts if not barred.get(a, False)]

    def offered(self, status: StationStatus) -> list[Protocol]:
        """Tasks that can be done with what is measured."""
        return [p for p in self.protocols if p.is_possible(status.measured)]

    def steps_offered(self, status: StationStatus) -> list[Protocol]:
        """Steps of a functional calibration that can be done with what is measured."""
        return [p for p in self.steps if p.is_possible(status.measured)]

    def next_step(self, status: StationStatus) -> str | None:
        """The step after this one."""
        names = [p.name for p in self.steps_offered(status)]
        return next(iter(names[names.index(self.task) + 1 :]), None) if self.task in names else None

    def checkable(self, status: StationStatus) -> list[str]:
        """Fingers of which a strip gives samples."""
        return [f for f in FINGERS if CHAINS[f][-1] in status.measured]

    def asked(self, status: StationStatus) -> str | None:
        """The finger that is to bend now in the sensor check."""
        return (
            next((f for f in self.checkable(status) if f not in dict(self.seen)), None)
            if self.state is State.CHECK
            else None
        )

    def exchangeable(self) -> dict[str, str]:
        """Finger that a strip is read for -> finger that wears it, where check, pose or movement found strips exchanged."""
        if self.state in (State.CONNECT, State.POSE_REVIEW) and self.swapped:
            one, other = self.swapped
            return {one: other, other: one}
        strip_by_finger = dict(self.seen) if self.state is State.CHECKED else {}
        return {
            strip: finger
            for finger, strip in strip_by_finger.items()
            if strip != finger and _is_closed_ring(finger, strip_by_finger)
        }

    def proposal(self, status: StationStatus) -> Action | None:
        """What to try next where the calibration fails: pose, pose given by the therapist, movements, none."""
        waited = self.state is State.POSE_HOLD and status.now - self.since > PATIENT
        if waited or (self.state is State.POSE_READY and self.refusals):
            action = Action.ASSIST if not self.passive else Action.WITHOUT
        elif self.state in (State.CONNECT, State.POSE_REVIEW) and self.swapped:
            action = Action.EXCHANGE
        elif self.state is State.CONNECT and self.mend:
            action = Action.CORRECT
        elif self.state is State.POSE_REVIEW and self.poor:
            action = (
                Action.REDO if self.used or not self.steps_offered(status) else Action.CALIBRATE
            )
        else:
            return None
        return action if action in self.allowed(status) else None

    def judgement(self, step: str | None) -> StepJudgement | None:
        """The judgement of a step in this calibration."""
        return next((j for j in self.judged if j.step == step), None)

    def groups(self, status: StationStatus) -> dict[str, list[Protocol]]:
        """Tasks that can be done by group, the usual assessment first."""
        offered = self.offered(status)
        every = {ROUTINE: [p for p in offered if p.routine]} | {
            g: [p for p in offered if p.group == g] for g in groups(offered)
        }
        return {name: tasks for name, tasks in every.items() if tasks}

    def listed(self, status: StationStatus) -> list[Protocol]:
        """Tasks of the group; all that can be done where the group has none."""
        return self.groups(status).get(self.group) or self.offered(status)

    def following(self, status: StationStatus) -> Protocol | None:
        """The task that is open after the pose or trial under review, in the order of the list."""
        if self.state not in (State.POSE_REVIEW, State.TASK_REVIEW):
            return None
        reviewed = self.task if self.state is State.TASK_REVIEW else None
        rest = [p for p in self.listed(status) if p.name != reviewed]
        return next((p for p in rest if not self.outcome(p.name)), None)

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
        """Whether a step is good and the joint axes are known from some step."""
        good = good_steps(self)
        return bool(good) and bool((good | self.used) & set(BENT))

    def _free_fingers(self, status: StationStatus) -> list[str]:
        """Fingers with a sensor next to the hand's."""
        return [f for f in FINGERS if {"hand", CHAINS[f][0]} <= status.measured]

    def _trials_left(self) -> bool:
        """Whether another trial of the task follows the one under review."""
        return (
            self.state is State.TASK_REVIEW
            and self.protocol is not None
            and self.accepted(self.protocol.name) + 1 < self.protocol.trials
        )


def _is_closed_ring(finger: str, strip_by_finger: Mapping[str, str]) -> bool:
    """Whether the exchange of strips that starts at this finger leads back to it."""
    at = strip_by_finger[finger]
    for _ in strip_by_finger:
        if at == finger or at not in strip_by_finger:
            break
        at = strip_by_finger[at]
    return at == finger


def ready(status: StationStatus) -> bool:
    """Samples flow and the hand's sensor is among them."""
    return status.flowing and "hand" in status.measured


def good_steps(wizard: Wizard) -> frozenset[str]:
    """Steps of this calibration that can be used."""
    return frozenset(j.step for j in wizard.judged if not j.problems)
