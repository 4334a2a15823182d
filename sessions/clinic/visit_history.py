"""What a result stands among: the patient's figures over the sessions that were processed in the same way, and those of the other hand."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.orm import Session

from handscope.sessions.clinic.repeatability import ProcessedSession, Values, history
from handscope.sessions.db.tables import Result


@dataclass(frozen=True)
class Visit:
    """One session's figures, over its trials (repeatability.values); SI units."""

    started: datetime
    values: Values


@dataclass(frozen=True)
class Course:
    """Sessions processed by the same method with the same options."""

    visits: tuple[Visit, ...]  # of the same hand in order of time, the result's own session last
    other: (
        Visit | None
    )  # the other hand's newest until then; the first one after where there is none before


def course(db: Session, result: Result) -> Course | None:
    """The course until a result; None for one in whose place another counts now."""
    visited = history(db, result.recording.session.patient_id)
    mine = next((v.occasion for v in visited if v.occasion.result == result.id), None)
    if mine is None:
        return None
    matching = [v for v in visited if v.occasion.processing[1:] == mine.processing[1:]]
    same = [
        v for v in matching if v.occasion.hand == mine.hand and v.occasion.started <= mine.started
    ]
    before = [
        v for v in matching if v.occasion.hand != mine.hand and v.occasion.started <= mine.started
    ]
    after = [
        v for v in matching if v.occasion.hand != mine.hand and v.occasion.started > mine.started
    ]
    nearest = before[-1:] or after[:1]
    return Course(tuple(map(_visit, same)), _visit(nearest[0]) if nearest else None)


def _visit(v: ProcessedSession) -> Visit:
    return Visit(v.occasion.started, v.values)
