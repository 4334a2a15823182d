"""The report of a stored result, with today's facts of the visit in the database, and with what it is compared with."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, cast

from sqlalchemy.orm import Session, object_session

from handscope.app.report.changes import Changes, changes, read_as
from handscope.app.report.content import ComparedWith, Content, GoalReading, LaterHand, Visit
from handscope.app.report.references import edition_of, newest
from handscope.app.results.hand_history import resembles_other_hand
from handscope.app.results.make import load_report
from handscope.estimators.measures.resting_drift import Drift
from handscope.sessions.clinic import references
from handscope.sessions.clinic.references import Course, References
from handscope.sessions.clinic.repeatability import values
from handscope.sessions.db.tables import PatientSession, Result
from handscope.sessions.store import records
from handscope.sessions.store.store import Store
from handscope.sessions.treatment import goals

Affected = Literal["left", "right", "both"] | None


@dataclass(frozen=True)
class Comparisons:
    """What a finished result is compared with, and what comes of it."""

    stored: References
    changes: Changes | None  # since the session before
    course: Course
    compared: ComparedWith


def comparisons_of(result: Result, number: int | None = None) -> Comparisons:
    """By the newest version of the result's references, or by that of a number."""
    db = object_session(result)
    assert db is not None
    stored = references.current(db, result, newest().data, number)
    edition = edition_of(stored.reference_values)
    compared = references.comparison(stored, result)
    return Comparisons(
        stored,
        changes(compared, edition) if compared else None,
        references.course(stored, result),
        ComparedWith(
            stored.number,
            stored.made,
            stored.author,
            cast(Affected, stored.affected),
            stored.before.started if stored.before else None,
            stored.other.started if stored.other else None,
            edition,
        ),
    )


def report(store: Store, result: Result, number: int | None = None) -> Content:
    """Content of a result's report; `number` chooses a version of its references, None the newest."""
    session, patient = result.recording.session, result.recording.session.patient
    date = session.started if records.is_dated(session) else None
    visit = Visit(
        patient=patient.pseudonym,
        date=date,
        recorded_as=session.recorded_as,
        date_reason=session.date_reason,
        examiner=session.examiner,
        protocol=session.plan,
        dominant=records.hand_of(patient.dominant_hand) if patient.dominant_hand else None,
        affected=cast(Affected, patient.affected_hand),
        notes=session.notes,
        conclusion=session.conclusion,
        pain=_pain(session),
    )
    found = comparisons_of(result, number)
    db, other = object_session(result), found.stored.other
    assert db is not None
    neighbours = records.same_visit(db, session)
    computed = load_report(store, result)
    rows = [(t.result.task, t.result.measure, f) for t in computed.tasks for f in t.result.figures]
    return replace(
        computed,
        visit=visit,
        date=date,
        changes=found.changes,
        course=found.course,
        compared=found.compared,
        goals=goal_readings(result),
        same_visit=other is not None and other.session in {s.id for s in neighbours},
        later_hand=_later_hand(db, result, neighbours),
        drifts=tuple(Drift(**d) for d in result.content.get("drift", ())),
        asks_hand=resembles_other_hand(rows, found.changes, other),
    )


def _later_hand(
    db: Session, result: Result, neighbours: Sequence[PatientSession]
) -> LaterHand | None:
    """The other hand that was measured after this one in the same visit, by its result that counts now; what the result is compared with stays as it was chosen."""
    session = result.recording.session
    later = {s.id for s in neighbours if s.continues_id == session.id}
    found = [c for c in references.candidates(db, result) if c.session in later] if later else []
    if not found:
        return None
    chosen = found[-1]
    made = db.get_one(Result, chosen.result).created
    return LaterHand(chosen.started, chosen.result, made, chosen.values)


def goal_readings(result: Result) -> tuple[GoalReading, ...]:
    """The goals of the hand that the result measured, as they are set now."""
    session, measured = result.recording.session, values(result.figures)
    aims = goals.of_patient(session.patient)
    read = {
        key: read_as(key, *measured[key])
        for hand, key in aims
        if hand == session.hand and key in measured
    }
    return tuple(
        GoalReading(goal.figure, value, unit, goal.low, goal.high)
        for key, (value, unit) in read.items()
        if (goal := goals.fitting(aims, session.hand, key, unit)) is not None
    )


def _pain(session: PatientSession) -> dict[Literal["rest", "movement"], int]:
    pain: dict[Literal["rest", "movement"], int] = {}
    if session.pain_rest is not None:
        pain["rest"] = session.pain_rest
    if session.pain_movement is not None:
        pain["movement"] = session.pain_movement
    return pain
