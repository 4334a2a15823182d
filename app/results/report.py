"""The report of a stored result, with what the database knows of the visit now."""

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
    """Changes in a result since the patient's previous session."""
    db = object_session(result)
    assert db is not None
    comparison = repeatability.compare_with_previous(db, result)
    return changes(comparison) if comparison else None


def course_of(result: Result) -> Course | None:
    """The patient's sessions until a result, and the other hand."""
    db = object_session(result)
    assert db is not None
    return course(db, result)


def report(store: Store, result: Result) -> Content:
    """Content of a result's report."""
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
    changed, history = changes_of(result), course_of(result)
    return replace(
        load_report(store, result),
        visit=visit,
        date=session.started,
        changes=changed,
        course=history,
    )
