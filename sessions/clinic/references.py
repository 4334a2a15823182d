"""What a result is compared with: the session before, the other hand, the MDCs and the reference values.

Chosen     when the result is first made (of a result from before this table: when it is first read), by what is known then: the newest session before of
           the same hand, and of the other hand, that was processed by the same method with the same options
Frozen     values, MDCs and reference values are stored with the result: no later session, correction, erasure or edition of the norms changes them
Versions   another choice of a person is a new version; the older ones stay and can be read. A result made anew of the same recording keeps a person's choice
Limits     the earlier sessions of a trend are stored by number: one that is erased drops out of the trend
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.sessions.clinic import audit
from handscope.sessions.clinic.audit import AuditEvent
from handscope.sessions.clinic.repeatability import (
    Comparison,
    Key,
    Occasion,
    ProcessedSession,
    Values,
    history,
    is_sufficient,
    occasion_of,
    values,
)
from handscope.sessions.db.tables import (
    ReferenceEdition,
    Repeatability,
    Result,
    ResultReferences,
    now,
)

MDC_COLUMNS = ("measure", "task", "name", "unit", "mdc95", "patient_id", "people", "sessions")
ReferenceData = Mapping[str, Any]  # the content of app/report/reference_values.json


@dataclass(frozen=True)
class Visit:
    """One session's figures, over its trials (repeatability.values); SI units."""

    started: datetime
    values: Values


@dataclass(frozen=True)
class Course:
    """Sessions processed by the same method with the same options."""

    visits: tuple[Visit, ...]  # of the same hand in order of time, the result's own session last
    other: Visit | None  # of the other hand


@dataclass(frozen=True)
class Compared:
    """A session that a result is compared with, as it was when it was chosen; SI units."""

    result: int
    session: int
    hand: str
    started: datetime
    version: str  # of the program that made its figures
    values: Values = field(repr=False)


@dataclass(frozen=True)
class References:
    """One version of what a result is compared with."""

    number: int  # 0: not stored
    made: datetime
    author: str  # "": chosen by the program when the result was made
    affected: str | None  # the affected hand, as the patient's record said then
    before: Compared | None
    other: Compared | None  # the other hand
    visits: tuple[Visit, ...]  # earlier sessions of the same hand in order of time
    own: Mapping[Key, Repeatability]
    glove: Mapping[Key, Repeatability]
    reference_values: ReferenceData


@dataclass(frozen=True)
class Version:
    """A version by its number, who chose it and when."""

    number: int
    made: datetime
    author: str


def current(
    db: Session, result: Result, reference_values: ReferenceData, number: int | None = None
) -> References:
    """The newest version or that of a `number`; the first one is stored here where there is none. Commits."""
    query = select(ResultReferences).where(ResultReferences.result_id == result.id)
    if number is not None:
        query = query.where(ResultReferences.number == number)
    row = db.scalar(query.order_by(ResultReferences.number.desc()).limit(1))
    if row is None and number is not None:
        raise InputError("clinic.references_version_unknown", number=number, result=result.id)
    return _load(db, row) if row else _store_first(db, result, reference_values)


def choose(
    db: Session,
    result: Result,
    before: int | None,
    other: int | None,
    author: str,
    reference_values: ReferenceData,
) -> References:
    """Store a new version with the results `before` (same hand) and `other` (other hand), None: nothing. Commits."""
    mine, past = occasion_of(result), _matching(db, result)
    same_hand = _require(past, before, mine.hand, True, result)
    other_hand = _require(past, other, mine.hand, False, result)
    audit.record(
        db, AuditEvent("changed", "result", str(result.id), mine.patient, {"references": 1})
    )
    return _store(db, result, same_hand, other_hand, author, past, reference_values)


def candidates(db: Session, result: Result) -> list[Compared]:
    """Every session of the patient that the result may be compared with, in order of time."""
    return [_to_compared(db, p) for p in _matching(db, result)]


def versions(db: Session, result: Result) -> list[Version]:
    """All versions of a result, the first one first."""
    rows = db.execute(
        select(ResultReferences.number, ResultReferences.made, ResultReferences.author)
        .where(ResultReferences.result_id == result.id)
        .order_by(ResultReferences.number)
    )
    return [Version(*row) for row in rows]


def comparison(references: References, result: Result) -> Comparison | None:
    """The result's figures beside those of the session before; None where there is none."""
    if references.before is None:
        return None
    before = references.before
    return Comparison(
        before.started, values(result.figures), before.values, references.own, references.glove
    )


def course(references: References, result: Result) -> Course:
    """The earlier sessions with the result's own at the end, and the other hand."""
    own = Visit(result.recording.session.started, values(result.figures))
    other = references.other
    return Course((*references.visits, own), Visit(other.started, other.values) if other else None)


def _store_first(db: Session, result: Result, reference_values: ReferenceData) -> References:
    """The choice of the program, or a person's for an older result of the recording."""
    past, mine = _matching(db, result), occasion_of(result)
    earlier = [p for p in past if p.occasion.started < mine.started]
    same = [p for p in earlier if p.occasion.hand == mine.hand]
    others = [
        p for p in past if p.occasion.hand != mine.hand and p.occasion.started <= mine.started
    ]
    measured = values(result.figures).keys()
    shared = [p for p in others if measured & p.values.keys()]
    before, other, author = _last(same), _last(shared), ""
    if chosen := _chosen_by_person(db, result):
        author, sessions = chosen
        before, other = (
            next((p for p in past if p.occasion.session == session), None) for session in sessions
        )
    return _store(db, result, before, other, author, past, reference_values, number=1)


def _last(found: Sequence[ProcessedSession]) -> ProcessedSession | None:
    return found[-1] if found else None


def _chosen_by_person(
    db: Session, result: Result
) -> tuple[str, tuple[int | None, int | None]] | None:
    """Who chose last for another result of this recording, and the sessions before and of the other hand."""
    row = db.scalar(
        select(ResultReferences)
        .join(Result, Result.id == ResultReferences.result_id)
        .where(Result.recording_id == result.recording_id, ResultReferences.author != "")
        .order_by(ResultReferences.id.desc())
        .limit(1)
    )
    if row is None:
        return None
    before, other = ((row.data[name] or {}).get("session") for name in ("before", "other"))
    return row.author, (before, other)


def _store(
    db: Session,
    result: Result,
    before: ProcessedSession | None,
    other: ProcessedSession | None,
    author: str,
    past: Sequence[ProcessedSession],
    reference_values: ReferenceData,
    number: int | None = None,
) -> References:
    """Add the version of a `number`, not stored where the database takes nothing (a full disk, another reader was first); None: the next, or an error."""
    mine = occasion_of(result)
    visits = [
        [p.occasion.result, p.occasion.started.isoformat()]
        for p in past
        if p.occasion.hand == mine.hand and p.occasion.started < mine.started
    ]
    own, glove = _sufficient_rows(db, result)
    data = {
        "affected": result.recording.session.patient.affected_hand,
        "before": _snapshot(db, before),
        "other": _snapshot(db, other),
        "visits": visits,
        "own": [_mdc(row) for row in own],
        "glove": [_mdc(row) for row in glove],
    }
    following = number or 1 + max((v.number for v in versions(db, result)), default=0)
    row = ResultReferences(
        result_id=result.id, number=following, author=author, made=now(), data=data
    )
    try:
        row.edition_id = _keep_edition(db, reference_values)
        db.add(row)
        db.commit()
    except DBAPIError:
        db.rollback()
        if number is None:
            raise
        stored = select(ResultReferences).where(ResultReferences.result_id == result.id)
        newest = db.scalar(stored.order_by(ResultReferences.number.desc()).limit(1))
        unstored = ResultReferences(number=0, author="", made=now(), data=data, edition_id="")
        return _load(db, newest) if newest else _load(db, unstored, reference_values)
    return _load(db, row)


def _load(
    db: Session, row: ResultReferences, reference_values: ReferenceData | None = None
) -> References:
    ids = [id_ for id_, _ in row.data["visits"]]
    rows = db.execute(select(Result.id, Result.figures).where(Result.id.in_(ids)))
    figures = {row.id: row.figures for row in rows}
    return References(
        row.number,
        row.made,
        row.author,
        row.data["affected"],
        _from_snapshot(row.data["before"]),
        _from_snapshot(row.data["other"]),
        tuple(
            Visit(datetime.fromisoformat(started), values(figures[id_]))
            for id_, started in row.data["visits"]
            if id_ in figures
        ),
        _mdcs(row.data["own"]),
        _mdcs(row.data["glove"]),
        reference_values or db.get_one(ReferenceEdition, row.edition_id).data,
    )


def _matching(db: Session, result: Result) -> list[ProcessedSession]:
    """The patient's other sessions processed by the same method with the same options, in order of time."""
    mine = occasion_of(result)
    return [
        p
        for p in history(db, mine.patient)
        if p.occasion.processing[1:] == mine.processing[1:]
        and p.occasion.session != mine.session
        and p.occasion.checksum != mine.checksum
    ]


def _require(
    past: Sequence[ProcessedSession], wanted: int | None, hand: str, same: bool, result: Result
) -> ProcessedSession | None:
    """The chosen one; InputError where it is not one of them or of the wrong hand."""
    if wanted is None:
        return None
    for p in past:
        if p.occasion.result == wanted and (p.occasion.hand == hand) == same:
            return p
    raise InputError("clinic.result_not_comparable", other=wanted, result=result.id)


def _sufficient_rows(
    db: Session, result: Result
) -> tuple[list[Repeatability], list[Repeatability]]:
    """The patient's own and the glove's MDCs that a change is judged by."""
    mine = occasion_of(result)
    query = select(Repeatability).where(
        Repeatability.hand == mine.hand, Repeatability.method == mine.method
    )
    own = db.scalars(query.where(Repeatability.patient_id == mine.patient))
    glove = db.scalars(
        query.where(Repeatability.patient_id.is_(None), Repeatability.device == mine.device)
    )
    own_rows, glove_rows = (
        [r for r in rows if r.parameters == dict(mine.parameters) and is_sufficient(r)]
        for rows in (own, glove)
    )
    return own_rows, glove_rows


def _mdc(row: Repeatability) -> list[Any]:
    return [*(getattr(row, name) for name in MDC_COLUMNS), row.freedom]


def _mdcs(rows: Sequence[Sequence[Any]]) -> dict[Key, Repeatability]:
    """Rows as they stood; of no database session."""
    made = [Repeatability(**dict(zip((*MDC_COLUMNS, "freedom"), row))) for row in rows]
    return {(r.measure, r.task, r.name): r for r in made}


def _to_compared(db: Session, p: ProcessedSession) -> Compared:
    o: Occasion = p.occasion
    version = db.scalar(select(Result.version).where(Result.id == o.result)) or ""
    return Compared(o.result, o.session, o.hand, o.started, version, p.values)


def _snapshot(db: Session, p: ProcessedSession | None) -> dict[str, Any] | None:
    if p is None:
        return None
    c = _to_compared(db, p)
    return {
        "result": c.result,
        "session": c.session,
        "hand": c.hand,
        "started": c.started.isoformat(),
        "version": c.version,
        "values": [[*key, value, unit] for key, (value, unit) in c.values.items()],
    }


def _from_snapshot(data: Mapping[str, Any] | None) -> Compared | None:
    if data is None:
        return None
    found: Values = {
        (measure, task, name): (value, unit) for measure, task, name, value, unit in data["values"]
    }
    moment = datetime.fromisoformat(data["started"])
    return Compared(data["result"], data["session"], data["hand"], moment, data["version"], found)


def _keep_edition(db: Session, reference_values: ReferenceData) -> str:
    """The id of the stored reference values; stored where they are new."""
    text = json.dumps(reference_values, sort_keys=True)
    id_ = hashlib.sha256(text.encode()).hexdigest()
    if db.get(ReferenceEdition, id_) is None:
        db.add(ReferenceEdition(id=id_, data=dict(reference_values)))
        db.flush()
    return id_
