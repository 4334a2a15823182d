"""Everything a report says, gathered from the session's own values: pure, no file, clock or database.

A page, a table or another language is a function of a Content; nothing downstream looks at the recording or the estimator again.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from handscope.app.protocols import Protocol
from handscope.app.report.changes import Changes
from handscope.app.report.references import Edition, newest
from handscope.app.report.sections.self_calibration import stored_form
from handscope.estimators.alignment.quality import of_joints
from handscope.estimators.data.calibration import Calibration, SensorQuality
from handscope.estimators.data.options import Description, changed_options, describe
from handscope.estimators.data.trajectory import FLAG_WORDS, Flag, Trajectory
from handscope.estimators.hand.anatomy import DOF_NAMES, FLEXION, JOINT, SEGMENT, Hand
from handscope.estimators.measures import MEASURES
from handscope.estimators.measures.assessment import TaskResult
from handscope.estimators.measures.range_of_motion import Range
from handscope.estimators.measures.resting_drift import Drift, resting_drift
from handscope.estimators.methods import ALL_METHODS
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import Processed
from handscope.sessions.clinic.references import Course
from handscope.sessions.clinic.repeatability import Values
from handscope.sessions.files.recording import LoadedRecording

# outcomes of an attempt that say nothing about the patient
ATTEMPTED = "accepted", "redone", "paused", "not used"
CURVE_POINTS = 500  # of a curve on the page: finer than the print


@dataclass(frozen=True, kw_only=True)
class Visit:
    """Facts of the visit; all but the pseudonym may be unknown."""

    patient: str  # pseudonym, never a name
    date: datetime | None = None  # aware; None = the recording's own start
    recorded_as: datetime | None = None  # what the clock said, where the date was corrected
    date_reason: str = ""
    examiner: str = ""
    protocol: Mapping[str, Any] = field(default_factory=dict)  # title and version, {}: none
    dominant: Hand | None = None
    affected: Literal["left", "right", "both"] | None = None
    notes: str = ""
    conclusion: str = ""
    pain: Mapping[Literal["rest", "movement"], int] = field(default_factory=dict)  # 0 to 10


@dataclass(frozen=True)
class GoalReading:
    """A figure beside the range that it is to reach, in the unit that people read."""

    name: str  # of the figure
    value: float
    unit: str
    low: float
    high: float


@dataclass(frozen=True)
class Changed:
    """An option that was not left at its default."""

    option: Description
    value: Any


@dataclass(frozen=True)
class Method:
    """How the movement was estimated."""

    name: str  # of ALL_METHODS
    title: str
    changed: tuple[Changed, ...]


@dataclass(frozen=True)
class StreamFacts:
    """One stream of the recording."""

    name: str
    sensors: tuple[str, ...]
    quantities: tuple[str, ...]
    rate: float  # Hz, nominal
    samples: int
    lost: int | None  # None: the recording does not say


@dataclass(frozen=True)
class RecordingFacts:
    """Which raw recording the figures rest on."""

    checksum: str  # sha256, "" where unknown
    start_utc: str  # ISO 8601, "" where unknown
    duration: float  # s
    source: Mapping[str, Any]  # format, device, device_id, firmware, software, as far as known
    streams: tuple[StreamFacts, ...]


@dataclass(frozen=True)
class CalibrationFacts:
    """How one calibration went."""

    source: str
    onset: float  # s
    end: float  # s
    sensors: Mapping[str, SensorQuality]
    joints: tuple[tuple[str, str], ...] = ()  # joint and grade (quality.py), of those not good


@dataclass(frozen=True)
class Flagged:
    """How much of the tasks' samples carries a flag, over all measured segments and in the worst of them."""

    words: str
    share: float
    worst: str  # segment
    worst_share: float


@dataclass(frozen=True)
class Curve:
    """Flexion of a joint during one task."""

    joint: str
    t: Array  # (n,) s from the start of the task
    angle: Array  # (n,) rad, NaN where not measured


@dataclass(frozen=True)
class OtherHand:
    """The session of the other hand that figures are shares of."""

    hand: Hand
    started: datetime  # aware
    motion: Mapping[str, float]  # total active motion by finger, rad


@dataclass(frozen=True)
class Task:
    """What one measure says of one task, with the curves it rests on."""

    result: TaskResult
    title: str  # of the task
    measure_title: str
    # angles (index_mcp_flexion, ...) that the patient was asked to move; None: not known, any
    asked: frozenset[str] | None
    curves: tuple[Curve, ...] = ()
    grading: str = ""  # the scheme that names its figures (gradings.py), where it was chosen
    against: OtherHand | None = None  # of which total active motion is a share; None: the norm

    def asks(self, joint: str, angle: str) -> bool:
        return self.asked is None or f"{joint}_{angle}" in self.asked


@dataclass(frozen=True)
class NotDone:
    """A task of which no attempt was accepted, and why."""

    title: str
    outcome: str  # "skipped", "unable", ... : the word before the reason in the recording's event
    reason: str


@dataclass(frozen=True)
class Scored:
    """The clinician's own score of a trial; never computed."""

    title: str  # of the task
    scale: str
    score: float


@dataclass(frozen=True)
class LeftOut:
    """What a person took out of the figures or moved, with the reason (sessions/clinic/corrections.py)."""

    title: str  # of the task
    kind: str
    onset: float  # s
    end: float
    reason: str


@dataclass(frozen=True)
class LaterHand:
    """The other hand, measured after this one in the same visit: as its result stands when the report is made, in SI units. Nothing is compared with it."""

    started: datetime
    result: int
    made: datetime  # when the result was computed
    values: Values


@dataclass(frozen=True)
class ComparedWith:
    """What the figures are compared with, as it was chosen and stored with the result (sessions/clinic/references.py)."""

    number: int  # of the version
    made: datetime  # aware
    author: str  # account that chose; "": the program when the result was made
    affected: Literal["left", "right", "both"] | None  # as the patient's record said then
    before: datetime | None  # start of the session before
    other: datetime | None  # start of the other hand's session
    edition: Edition


@dataclass(frozen=True)
class Content:
    """A report before it is worded."""

    visit: Visit
    hand: Hand
    date: datetime | None  # aware
    software: str
    method: Method
    recording: RecordingFacts
    calibrations: tuple[CalibrationFacts, ...]
    tasks: tuple[Task, ...]
    measured: tuple[str, ...]  # segments that carry a sensor
    flagged: tuple[Flagged, ...]
    warnings: tuple[str, ...]
    # since the patient's session before; None where there is nothing to compare with
    changes: Changes | None = None
    course: Course | None = None  # the patient's sessions until now, and the other hand
    not_done: tuple[NotDone, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    scores: tuple[Scored, ...] = ()
    # what the method found of hand and sensors (self_calibration.kept_of)
    self_calibration: Mapping[str, Any] | None = None
    compared: ComparedWith | None = None
    goals: tuple[GoalReading, ...] = ()
    same_visit: bool = False  # the other hand of `course` was measured in the same visit
    later_hand: LaterHand | None = None  # where `course` cannot hold it: it was chosen before
    drifts: tuple[Drift, ...] = ()  # at rest
    asks_hand: bool = False  # whether the other hand was measured

    @property
    def edition(self) -> Edition:
        """The reference values that the figures are compared with."""
        return self.compared.edition if self.compared else newest()


def content(  # noqa: PLR0913
    visit: Visit,
    recording: LoadedRecording,
    processed: Processed,
    method: str,
    params: Any,
    results: Sequence[TaskResult],
    software: str,
    protocols: Mapping[str, Protocol],
    changes: Changes | None = None,
    course: Course | None = None,
    corrections: Sequence[Mapping[str, Any]] = (),
) -> Content:
    """Gather a session: its recording, what the method (a name of ALL_METHODS) with its params made of it, what was measured on that.

    `protocols` (by task name) tell what each task was called and which angles it asked for; a task without one may have asked for any.
    """
    measured = tuple(
        s
        for s in SEGMENT
        if any(s in st.sensors for st in recording.streams if st.inertial or st.oriented)
    )
    return Content(
        visit,
        recording.hand,
        visit.date or _moment(recording.start_utc),
        software,
        Method(method, ALL_METHODS[method].TITLE, tuple(_changed_options(params))),
        _recording(recording),
        tuple(
            CalibrationFacts(c.description, *c.span, c.quality, joints_to_name(c))
            for c in processed.calibrations
        ),
        tuple(_task(r, protocols.get(r.task), processed.trajectory) for r in results),
        measured,
        tuple(_flag_shares(processed.trajectory, results, measured)),
        processed.warnings,
        changes,
        course,
        tuple(
            list_not_done(
                [{"trial_type": e.trial_type, **e.details} for e in recording.events], protocols
            )
        ),
        tuple(_left_out(recording, protocols, corrections)),
        tuple(_scores(recording, protocols)),
        stored_form(processed),
        drifts=drifts_of(processed),
    )


def drifts_of(processed: Processed) -> tuple[Drift, ...]:
    """What seems to drift at rest, from each calibration to the next."""
    spans = pairwise([*(c.span[1] for c in processed.calibrations), np.inf])
    found = (resting_drift(processed.trajectory.between(start, stop)) for start, stop in spans)
    return tuple(drift for drift in found if drift is not None)


def _moment(start_utc: str | None) -> datetime | None:
    if not start_utc:
        return None
    moment = datetime.fromisoformat(start_utc)
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)


def _changed_options(params: Any) -> list[Changed]:
    changed = changed_options(params)
    return [Changed(o, changed[o.name]) for o in describe(type(params)) if o.name in changed]


def _recording(recording: LoadedRecording) -> RecordingFacts:
    streams = tuple(
        StreamFacts(
            s.name,
            s.sensors,
            s.quantities,
            s.rate,
            len(recording.samples[s.name].t),
            recording.losses.get(s.name),
        )
        for s in recording.streams
    )
    return RecordingFacts(
        recording.checksum, recording.start_utc or "", recording.duration, recording.source, streams
    )


def joints_to_name(calibration: Calibration) -> tuple[tuple[str, str], ...]:
    """Joints of which the calibration is fair or poor, with that grade."""
    return tuple((j.joint, j.grade) for j in of_joints(calibration) if j.grade in ("fair", "poor"))


def list_not_done(
    events: Sequence[Mapping[str, Any]], protocols: Mapping[str, Protocol]
) -> list[NotDone]:
    """What the wizard marked as not done, the last word on each task that no attempt was accepted of; events with their trial_type and details."""
    done = {str(e.get("task_name")) for e in events if e["trial_type"] == "task"}
    skipped: dict[str, NotDone] = {}
    for event in events:
        name, outcome = str(event.get("task_name", "")), str(event.get("outcome", ""))
        if (
            event["trial_type"] == "annotation"
            and name not in done
            and outcome
            and not outcome.startswith(ATTEMPTED)
        ):
            word, _, reason = outcome.partition(":")
            skipped[name] = NotDone(_title(name, protocols), word.strip(), reason.strip())
    return list(skipped.values())


def _scores(recording: LoadedRecording, protocols: Mapping[str, Protocol]) -> list[Scored]:
    scored = [
        e.details
        for e in recording.events
        if e.trial_type == "task" and e.details.get("score") not in (None, "")
    ]
    return [
        Scored(
            _title(str(d.get("task_name")), protocols),
            str(d.get("score_title", "")),
            float(d["score"]),
        )
        for d in scored
    ]


def _left_out(
    recording: LoadedRecording,
    protocols: Mapping[str, Protocol],
    corrections: Sequence[Mapping[str, Any]],
) -> list[LeftOut]:
    names = [str(e.details.get("task_name", "")) for e in recording.events]
    return [
        LeftOut(_title(names[c["event"]], protocols), c["kind"], c["onset"], c["end"], c["reason"])
        for c in corrections
    ]


def _title(name: str, protocols: Mapping[str, Protocol]) -> str:
    return protocols[name].title if name in protocols else name.replace("_", " ")


def _task(result: TaskResult, protocol: Protocol | None, trajectory: Trajectory) -> Task:
    title = protocol.title if protocol else result.task.replace("_", " ")
    return Task(
        result,
        title,
        MEASURES[result.measure].TITLE,
        asked(protocol),
        tuple(_curves(trajectory, result)),
    )


def asked(protocol: Protocol | None) -> frozenset[str] | None:
    """The angles that differ between the postures that the protocol shows."""
    if protocol is None or len(protocol.ghost) < 2:
        return None
    return frozenset(
        angle
        for angle in DOF_NAMES
        if len({posture.get(angle, 0.0) for posture in protocol.ghost}) > 1
    )


def _curves(trajectory: Trajectory, result: TaskResult) -> list[Curve]:
    """Flexion of the joints that the result's ranges name, thinned to CURVE_POINTS."""
    if not isinstance(result.details, list):
        return []
    joints = [r.joint for r in result.details if isinstance(r, Range) and r.angle == "flexion"]
    part = trajectory.between(result.onset, float(np.nextafter(result.end, np.inf)))
    every = max(1, -(-len(part) // CURVE_POINTS))
    t = part.t[::every] - result.onset
    return [Curve(joint, t, part.angles[::every, JOINT[joint], FLEXION]) for joint in joints]


def _flag_shares(
    trajectory: Trajectory, results: Sequence[TaskResult], measured: Sequence[str]
) -> list[Flagged]:
    """Shares of flags within the tasks (the whole recording where there is none)."""
    inside = np.zeros(len(trajectory), bool) if results else np.ones(len(trajectory), bool)
    for r in results:
        inside |= (trajectory.t >= r.onset) & (trajectory.t <= r.end)
    flags = trajectory.flags[inside][:, [SEGMENT[s] for s in measured]]
    return [
        found
        for flag, words in FLAG_WORDS.items()
        if flags.size and (found := _share(flags, flag, words, measured)).share > 0
    ]


def _share(flags: np.ndarray, flag: Flag, words: str, measured: Sequence[str]) -> Flagged:
    shares = ((flags & flag) != 0).mean(axis=0)
    worst = int(np.argmax(shares))
    return Flagged(words, float(shares.mean()), measured[worst], float(shares[worst]))
