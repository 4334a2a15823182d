"""The audit trail: who saw, made, changed, exported and erased what, who logged in and what was refused; only ever appended to.

Each line holds the hash of the one before, so that a line changed, taken out or put in breaks the chain from there on (`verify`). Who can write
the whole database can forge a whole chain, or cut off its end: note the last line's number and hash elsewhere (`read_head`; every backup does) and verify
against them. Triggers refuse UPDATE and
DELETE of lines besides.

Rows that a database session adds, changes or removes are noted with it and written in its own transaction, whoever changes them: no caller can
forget to. Names of what was changed are kept, never values: no line holds a pseudonym or a text, and a patient's number is given to nobody else
after erasing.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import ColumnElement, Connection, event, func, insert, inspect, select, text, update
from sqlalchemy.orm import Session, sessionmaker

from handscope.estimators.messages.sentence import phrase
from handscope.sessions.clinic import audit_copy, audit_guards
from handscope.sessions.db.tables import (
    Account,
    AssessmentPlan,
    AuditLine,
    Base,
    Correction,
    EmergencyAccess,
    Goal,
    HandPhotograph,
    Note,
    Patient,
    PatientSession,
    RecordingFile,
    Result,
    Reuse,
    SecondFactor,
    SelfCalibration,
    StoredColumnMap,
    TreatmentEvent,
    Ward,
    now,
)
from handscope.sessions.db.visible_rows import unrestricted

SERVER = "server"  # who, where no account asked for it
NOTHING = "0" * 64  # before the first line
LOCK = 0x61756469  # of PostgreSQL's advisory locks; any number that nobody else uses
LONGEST = 64  # characters of a reference
LARGEST = 2**31 - 1  # number of a row that both databases take
KINDS: Mapping[type[Base], str] = {
    Patient: "patient",
    Note: "note",
    PatientSession: "session",
    RecordingFile: "recording",
    Correction: "correction",
    SelfCalibration: "self_calibration",
    HandPhotograph: "photograph",
    TreatmentEvent: "treatment_event",
    Goal: "goal",
    Reuse: "reuse",
    Result: "result",
    Account: "account",
    SecondFactor: "second_factor",
    Ward: "ward",
    StoredColumnMap: "column_map",
    AssessmentPlan: "assessment_plan",
}
BY_ITSELF: Mapping[
    type[Base], frozenset[str]
] = {  # what changes as the work goes on, without anybody's wish
    Patient: frozenset({"version"}),
    Note: frozenset({"version"}),
    Goal: frozenset({"changed"}),
    PatientSession: frozenset({"state", "finished", "version"}),
    RecordingFile: frozenset({"sha256", "bytes", "summary"}),
    Result: frozenset(column.key for column in Result.__table__.columns),
    SecondFactor: frozenset({"counter", "used"}),
    Account: frozenset({"version"}),
}


@dataclass(frozen=True)
class AuditEvent:
    """What a line is about."""

    what: str  # viewed, created, changed, exported, erased, logged in, logged out, refused
    kind: str  # patient, session, ..., account, login
    ref: str = ""  # its number
    patient: int | None = None
    counts: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Verdict:
    """What verifying found."""

    lines: int  # that hold, from the first on
    last: str  # hash of the last of them
    broken: str = ""  # the first that does not, and how
    back: int = 0  # the first line of an earlier time than the one before: a clock was set back, or lines are somebody's own; 0 for none
    # triggers that should refuse changes and are gone, off or changed
    unguarded: tuple[str, ...] = ()


def enable(database: sessionmaker[Session], copy_to: str = "") -> None:
    """From now on every commit of this database is audited, and its lines copied to a place outside where one is named."""
    event.listen(database, "after_flush", _collect_rows)
    event.listen(database, "before_commit", _write)
    event.listen(database, "after_rollback", _discard)
    audit_copy.enable(database, copy_to)


def set_actor(db: Session, who: str, address: str) -> None:
    """Say on whose behalf this database session works."""
    db.info.update(who=who, address=address)


def record(db: Session, *happened: AuditEvent) -> None:
    """Note what is no change of a row; it is written with the next commit."""
    db.info.setdefault("audit", []).extend(happened)


def list_lines(
    db: Session,
    who: str = "",
    what: str = "",
    patient: int | None = None,
    before: int | None = None,
    limit: int = 100,
    within: ColumnElement[bool] | None = None,
) -> list[AuditLine]:
    """The newest first; `before` a line's number, to go on from there; `within`: what else holds of them (sessions/wards)."""
    query = select(AuditLine).where(*_wanted(who, what, patient, within))
    query = query.order_by(AuditLine.id.desc()).limit(limit)
    return list(db.scalars(query.where(AuditLine.id < before) if before else query))


def count_lines(
    db: Session,
    who: str = "",
    what: str = "",
    patient: int | None = None,
    within: ColumnElement[bool] | None = None,
) -> int:
    """How many lines there are of those that `list_lines` gives."""
    wanted = _wanted(who, what, patient, within)
    return db.scalar(select(func.count(AuditLine.id)).where(*wanted)) or 0


def _wanted(
    who: str, what: str, patient: int | None, within: ColumnElement[bool] | None
) -> list[ColumnElement[bool]]:
    """What holds of the lines that are asked for."""
    asked = ((AuditLine.who, who), (AuditLine.what, what), (AuditLine.patient, patient))
    return [column == value for column, value in asked if value] + (
        [] if within is None else [within]
    )


def verify(db: Session, against: Sequence[tuple[int, str]] = ()) -> Verdict:
    """Go along the chain until the first line that does not fit; `against` are numbers and hashes noted before."""
    if not audit_guards.has_trail(db):
        return Verdict(0, NOTHING, phrase("audit.no_table"))
    if columns := audit_guards.find_missing_columns(db):
        return Verdict(0, NOTHING, phrase("audit.no_columns", names=", ".join(columns)))
    missing = audit_guards.find_missing_triggers(db)
    return replace(_follow(db, against), unguarded=missing)


def _follow(db: Session, against: Sequence[tuple[int, str]]) -> Verdict:
    """The chain itself."""
    number, last, noted, before, back = 0, NOTHING, dict(against), None, 0
    for line in db.execute(
        select(AuditLine.__table__).order_by(AuditLine.id).execution_options(yield_per=1000)
    ).mappings():
        number += 1
        if line["id"] != number:
            return Verdict(number - 1, last, phrase("audit.line_missing", number=number))
        if line["previous"] != last:
            return Verdict(
                number - 1,
                last,
                phrase("audit.line_exchanged", number=number, before=number - 1),
            )
        if line["hash"] != hash_of(line):
            return Verdict(number - 1, last, phrase("audit.line_changed", number=number))
        if noted.pop(number, line["hash"]) != line["hash"]:
            return Verdict(
                number - 1,
                last,
                phrase("audit.other_hash", number=number),
            )
        if before is not None and line["at"] < before and not back:
            back = number
        last, before = line["hash"], line["at"]
    if noted:
        return Verdict(
            number,
            last,
            phrase("audit.cut_off", number=min(noted), last=number),
        )
    # making an account is recorded: where there is one, the trail is not empty by itself
    if number == 0 and db.scalar(select(Account.id).limit(1)) is not None:
        return Verdict(0, NOTHING, phrase("audit.emptied"))
    return Verdict(number, last, back=back)


def read_head(connection: Connection) -> tuple[int, str] | None:
    """Number and hash of the last line, to be noted elsewhere; None where there is none, or the database is from before the chain."""
    found = inspect(connection)
    if not found.has_table("audit") or "hash" not in {
        column["name"] for column in found.get_columns("audit")
    }:
        return None
    last = connection.execute(text("SELECT id, hash FROM audit ORDER BY id DESC LIMIT 1")).first()
    return (int(last.id), str(last.hash)) if last else None


def hash_of(line: Mapping[Any, Any]) -> str:
    """SHA-256 of everything a line says and of its predecessor's hash."""
    at: datetime = line["at"]
    names = ("id", "who", "address", "what", "kind", "ref", "patient", "counts", "previous")
    content = {
        **{name: line[name] for name in names},
        "at": at.astimezone(UTC).isoformat(timespec="microseconds"),
    }
    return hashlib.sha256(
        json.dumps(content, sort_keys=True, separators=(",", ":")).encode()
    ).hexdigest()


def add_patient(db: Session, happened: AuditEvent) -> AuditEvent:
    """The same with the patient whom it is about."""
    if not happened.ref.isdecimal() or int(happened.ref) > LARGEST:
        return happened
    return replace(happened, patient=patient_of(db, happened.kind, int(happened.ref)))


def patient_of(db: Session, kind: str, number: int) -> int | None:
    """Whose a session, recording, result, note or correction is."""
    of_session = select(PatientSession.patient_id)
    queries = {
        "patient": select(Patient.id).where(Patient.id == number),
        "note": select(Note.patient_id).where(Note.id == number),
        "session": of_session.where(PatientSession.id == number),
        "recording": of_session.join(RecordingFile).where(RecordingFile.id == number),
        "correction": of_session.join(RecordingFile)
        .join(Correction)
        .where(Correction.id == number),
        "photograph": select(HandPhotograph.patient_id).where(HandPhotograph.id == number),
        "treatment_event": select(TreatmentEvent.patient_id).where(TreatmentEvent.id == number),
        "goal": select(Goal.patient_id).where(Goal.id == number),
        "self_calibration": select(SelfCalibration.patient_id).where(SelfCalibration.id == number),
        "reuse": of_session.join(Reuse).where(Reuse.id == number),
        "result": of_session.join(RecordingFile).join(Result).where(Result.id == number),
        "emergency_access": select(EmergencyAccess.patient_id).where(EmergencyAccess.id == number),
    }
    return db.scalar(queries[kind]) if kind in queries else None


def _collect_rows(db: Session, _: object) -> None:
    """After a flush: what it added, changed and removed. Removing a patient takes everything with it and is recorded by its caller."""
    found = [("created", row, ()) for row in db.new] + [
        ("changed", row, _fields(row)) for row in db.dirty
    ]
    if not any(isinstance(row, Patient) for row in db.deleted):
        found += [("erased", row, ()) for row in db.deleted]
    noted = [
        (what, KINDS[type(row)], row.id, names)
        for what, row, names in found
        if type(row) in KINDS and (what != "changed" or names)
    ]
    db.info.setdefault("rows", []).extend(noted)


def _fields(row: object) -> tuple[str, ...]:
    """Columns of a row that a person changed."""
    if not isinstance(row, Base) or type(row) not in KINDS:
        return ()
    state, own = inspect(row), BY_ITSELF.get(type(row), frozenset())
    return tuple(
        a.key
        for a in state.mapper.column_attrs
        if a.key not in own and state.attrs[a.key].history.has_changes()
    )


def _write(db: Session) -> None:
    """Before a commit: everything noted, in the same transaction."""
    with unrestricted(db):  # a patient who was moved to another ward is still whose line it is
        db.flush()
        happened = [*_row_events(db), *db.info.get("audit", ())]
        _discard(db)
        if happened:
            _append(db, happened)


def _row_events(db: Session) -> Iterator[AuditEvent]:
    for what, kind, number, names in db.info.get("rows", ()):
        yield AuditEvent(
            what,
            kind,
            str(number),
            patient_of(db, kind, number),
            {"fields": list(names)} if names else {},
        )


def _append(db: Session, happened: Sequence[AuditEvent]) -> None:
    """Nobody else appends between the reading of the last line and the commit."""
    if db.get_bind().dialect.name == "postgresql":
        db.execute(text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": LOCK})
    else:  # SQLite has one writer: this takes its lock, though it changes nothing
        db.execute(update(AuditLine.__table__).where(AuditLine.id < 0).values(ref=""))  # type: ignore[arg-type]
    last, previous = db.execute(
        select(AuditLine.id, AuditLine.hash).order_by(AuditLine.id.desc()).limit(1)
    ).first() or (0, NOTHING)
    who, address, moment, rows = db.info.get("who", SERVER), db.info.get("address", ""), now(), []
    for number, one in enumerate(happened, last + 1):
        about = {
            "what": one.what,
            "kind": one.kind,
            "ref": one.ref[:LONGEST],
            "patient": one.patient,
            "counts": dict(one.counts),
        }
        row = {
            "id": number,
            "at": moment,
            "who": who,
            "address": address,
            **about,
            "previous": previous,
        }
        previous = row["hash"] = hash_of(row)
        rows.append(row)
    db.execute(insert(AuditLine), rows)
    audit_copy.add_waiting(db, rows)


def _discard(db: Session) -> None:
    db.info.pop("audit", None)
    db.info.pop("rows", None)
