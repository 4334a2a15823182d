"""Erase a patient for good: rows, recordings, results and files. What stays is a line that says that something was erased, not whose it was.

Rows and the list of files go in one transaction, then the files: a power cut in between is finished by the next start. Files in an object storage,
which must answer, go with its next round. SQLite overwrites what it deletes (secure_delete) and its log is emptied. What was exported, printed or backed up is out of reach.
"""

from collections.abc import Collection

from sqlalchemy import ColumnElement, Select, select
from sqlalchemy.orm import Session, selectinload

from handscope.estimators.errors import InputError
from handscope.sessions.clinic import audit, patients
from handscope.sessions.db.tables import (
    AuditLine,
    ErasedFile,
    Patient,
    PatientSession,
    RecordingFile,
    Result,
)
from handscope.sessions.files import object_storage
from handscope.sessions.store import records, stored_files
from handscope.sessions.store.store import ELSEWHERE, Store, remove_erased


def erase(db: Session, store: Store, patient_id: int, typed: str) -> dict[str, int]:
    """Erase the patient whose pseudonym was typed as it is stored; InputError, and nothing is erased, where it is another or where work goes on; gives what there was."""
    patient = patients.get(db, patient_id)
    if " ".join(typed.split()) != patient.pseudonym:
        raise InputError("store.erasure_code_differs", code=patient.pseudonym)
    sessions = list(db.scalars(_of(patient)))
    recordings = [f for s in sessions for f in s.recordings]
    results = [r for f in recordings for r in f.results]
    _require_rest(patient, sessions, results)
    if store.away is not None:
        object_storage.require(store.away)
    files = {f.file for f in recordings} | {
        name for r in results for name in stored_files.files_of_result(store, r.id)
    }
    paths = [
        path
        for file in files
        for path in (store.path_of(file), store.cached(file))
        if path.exists()
    ]
    counts = {
        "sessions": len(sessions),
        "recordings": len(recordings),
        "results": len(results),
        "notes": len(patient.notes),
        "bytes": sum(path.stat().st_size for path in paths),
    }
    audit.record(db, audit.AuditEvent("erased", "patient", counts=counts))
    db.add_all(_mark_erased(store, recordings, files))
    db.delete(patient)
    db.commit()
    remove_erased(db, store, files)
    return counts


def is_empty(session: PatientSession) -> bool:
    """Whether a finished session that was measured here holds no trial and no task that the patient could not do, and nothing is computed of it."""
    running = any(r.state in ("queued", "running") for f in session.recordings for r in f.results)
    finished = session.state != "open" and not running
    return finished and records.is_without_trial(session) and not records.has_unable(session)


def erase_empty_session(db: Session, store: Store, session_id: int) -> None:
    """Erase a session without trials, with its recording; InputError, and nothing is erased, where it holds any."""
    session = records.get(db, session_id)
    if not is_empty(session):
        raise InputError("store.session_not_empty", day=f"{session.started:%Y-%m-%d}")
    files = {f.file for f in session.recordings} | {
        name
        for f in session.recordings
        for r in f.results
        for name in stored_files.files_of_result(store, r.id)
    }
    db.add_all(_mark_erased(store, session.recordings, files))
    db.delete(session)
    db.commit()
    remove_erased(db, store, files)


def erasures(db: Session, within: ColumnElement[bool] | None = None) -> list[AuditLine]:
    """The lines that were left, the newest first; `within`: what else holds of them."""
    query = (
        select(AuditLine)
        .where(AuditLine.what == "erased", AuditLine.kind == "patient")
        .order_by(AuditLine.id.desc())
    )
    return list(db.scalars(query if within is None else query.where(within)))


def _mark_erased(
    store: Store, recordings: Collection[RecordingFile], files: Collection[str]
) -> list[ErasedFile]:
    """The files as ones that must go, here and in the other servers' folders; of results those remove what no row refers to (stored_files.move_out)."""
    elsewhere = [f for f in recordings if store.server and f.server not in ("", store.server)]
    return [
        *(ErasedFile(file=file, server=store.server) for file in sorted(files)),
        *(ErasedFile(file=ELSEWHERE + file.file, server=file.server) for file in elsewhere),
    ]


def _of(patient: Patient) -> Select[PatientSession]:
    everything = selectinload(PatientSession.recordings).selectinload(RecordingFile.results)
    return select(PatientSession).where(PatientSession.patient_id == patient.id).options(everything)


def _require_rest(patient: Patient, sessions: list[PatientSession], results: list[Result]) -> None:
    if any(s.state == "open" for s in sessions):
        raise InputError("store.session_not_finished", code=patient.pseudonym)
    if any(r.state == "running" for r in results):
        raise InputError("store.results_being_computed", code=patient.pseudonym)
