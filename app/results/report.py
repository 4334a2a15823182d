"""The report of a kept result: what was computed with it, and what the database knows of the visit now."""

from dataclasses import replace
from typing import Literal, cast

from sqlalchemy.orm import object_session

from handscope.app.report.changes import Changes, changes
from handscope.app.report.content import Content, Visit
from handscope.app.results.make import load_report
from handscope.sessions.clinic import repeatability
from handscope.sessions.clinic.visit_history import Course, course
from handscope.sessions.db.tables import Result
from handscope.sessions.store import records
from handscope.sessions.store.store import Store


def changes_of(result: Result) -> Changes | None:
    """What changed in a kept result since the patient's session before."""
    db = object_session(result)
    assert db is not None
    told = repeatability.comparison(db, result)
    return changes(told) if told else None


def course_of(result: Result) -> Course | None:
    """The patient's sessions until a kept result, and the other hand."""
    db = object_session(result)
    assert db is not None
    return course(db, result)


def report(store: Store, result: Result) -> Content:
    """What the report of a result says."""
    session, patient = result.recording.session, result.recording.session.patient
    visit = Visit(
        patient=patient.pseudonym,
        date=session.started,
        recorded_as=session.recorded_as,
        date_reason=session.date_reason,
        examiner=session.examiner,
        dominant=records.hand_of(patient.dominant_hand) if patient.dominant_hand else None,
        affected=cast(Literal["left", "right", "both"] | None, patient.affected_hand),
        notes=session.notes,
    )
    changed, gone = changes_of(result), course_of(result)
    return replace(
        load_report(store, result), visit=visit, date=session.started, changes=changed, course=gone
    )
