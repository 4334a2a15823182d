"""/api/sessions, and the sessions and recordings of a patient"""

import os
import tempfile
from collections.abc import AsyncIterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, BinaryIO, Literal

from anyio import to_thread
from fastapi import APIRouter, Form, UploadFile
from pydantic import Field
from starlette.responses import FileResponse, Response, StreamingResponse

from handscope.app.api.answers import (
    CorrectionRow,
    RecordingRow,
    SessionAnswer,
    SessionRow,
    answers,
)
from handscope.app.api.pseudonymisation import for_reader
from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import CLINICIAN, SCIENTIST, RequesterDep, requires_role
from handscope.app.options import with_options
from handscope.app.state import Db, LanguageDep, Parts, PartsDep, RepairDep
from handscope.app.version import software_version
from handscope.estimators.data.options import changed_options
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.methods import ALL_METHODS
from handscope.sessions.clinic import (
    corrections,
    dates,
    patients,
    results,
)
from handscope.sessions.db.plain_text import require_plain
from handscope.sessions.db.tables import Correction, PatientSession, RecordingFile, Result, now
from handscope.sessions.files import native
from handscope.sessions.sealing.stored import is_sealed, open_stored
from handscope.sessions.store import (
    crash_repair,
    erasure,
    records,
    shared_servers,
    stored_files,
    visit_facts,
)
from handscope.sessions.store.archive_entries import pieces_of
from handscope.sessions.store.visit_facts import TrunkHeight, Written

router = APIRouter(tags=["sessions"], dependencies=[requires_role(CLINICIAN)])
CHUNK = 2**20
PAIN_FIELDS: tuple[Literal["pain_rest", "pain_movement"], ...] = ("pain_rest", "pain_movement")
REPAIRED = phrase("live.being_repaired")


class SessionChange(Incoming):
    """What may change of a session; `version` is that which was read."""

    version: int = Field(
        description="the version that was seen; somebody else's change meanwhile is refused"
    )
    notes: str | None = Field(None, max_length=visit_facts.LONGEST)
    examiner: str | None = Field(None, max_length=200)
    conclusion: str | None = Field(None, max_length=visit_facts.LONGEST)
    pain_rest: int | None = Field(
        None, description="numerical rating scale, 0 to 10; null: none given"
    )
    pain_movement: int | None = Field(None, description="the same, on movement")
    started: datetime | None = Field(
        None, description="the true date, where the clock was wrong; what the clock said is kept"
    )
    date_reason: str = Field("", max_length=1000, description="why the date is another")
    trunk_height: float | None = Field(
        None,
        allow_inf_nan=False,
        description="of the trunk's sensor above the hips, metres, told afterwards; null: as the recording tells it",
    )


class NewCorrection(Incoming):
    """An event of a recording corrected: its kind and interval, s."""

    event: int = Field(description="which of the recording's events, from 0")
    kind: str = Field(
        description="exclude (the trial), move (its ends), leave_out (a stretch within it)"
    )
    reason: str = Field("", max_length=1000, description="why, in somebody's own words")
    reason_code: Literal["", "helped", "wrong", "interrupted", "slipped", "pain"] = Field(
        "",
        description="why, as one of the reasons that pages offer: everybody reads it in their language",
    )
    onset: float = Field(
        0.0,
        allow_inf_nan=False,
        description="s of the recording: the new ends, or those of the stretch",
    )
    end: float = Field(0.0, allow_inf_nan=False)


class NewResult(Incoming):
    """A recording processed anew: by which method, with which options."""

    method: str | None = Field(None, description="without it what suits the recording's sensors")
    options: dict[str, Any] = Field(default_factory=dict)


@router.post("/patients/{patient_id}/recordings", status_code=201)
async def upload_recording(
    db: Db,
    parts: PartsDep,
    language: LanguageDep,
    patient_id: int,
    file: UploadFile,
    hand: Annotated[str | None, Form()] = None,
    method: Annotated[
        str | None, Form(description="without it what suits the recording's sensors")
    ] = None,
) -> dict[str, Any]:
    """Keep a Motion-BIDS zip or a native recording made elsewhere as a session and process it."""
    patient = patients.get(db, patient_id)
    name = Path(file.filename or "recording").name
    require_plain((name, hand or "", method or ""), "the form", one_line=True)
    suffix = native.SUFFIX if name.endswith(native.SUFFIX) else ".zip"
    handle, place = tempfile.mkstemp(suffix=suffix, dir=parts.store.incoming)
    try:
        with os.fdopen(handle, "wb") as target:
            await receive(file, parts, target)
        upload = await parts.upload_reader.read(
            Path(place), name, records.hand_of(hand) if hand else None
        )
        session = await to_thread.run_sync(
            records.store_upload, db, parts.store, patient, Path(place), name, upload
        )
    finally:
        Path(place).unlink(missing_ok=True)
    result = _queue(db, parts, session, method, {})
    same = _same_recording(db, session)
    again = [
        phrase(
            "store.recording_again",
            session=f["session"],
            started=f"{f['started']:%Y-%m-%d}",
            added=f"{f['added']:%Y-%m-%d}",
        )
        for f in same
    ]
    return {
        "session": session.id,
        "result": result.id,
        "warnings": [language.translate(sentence) for sentence in again],
        "same_recording": same,
    }


@router.get("/sessions/unfinished")
def unfinished_sessions(db: Db, parts: PartsDep, repair: RepairDep) -> list[dict[str, Any]]:
    """Sessions that run or that nobody finished, the oldest first; after a server that was killed those that are `repairing` [this, of so many], and
    those that are closed and whose recordings are read whole, `reading` [this, of so many]. `elsewhere` is the server that records it, where several
    share the database and it is another one: its name, its address, whether it answers."""
    rows = []
    being_read = [s for s in crash_repair.list_unread(db) if repair.reading(s.id)]
    for session in [*records.list_abandoned(db), *being_read]:
        station = parts.stations.of_session(session.id)
        patient = {"id": session.patient_id, "pseudonym": session.patient.pseudonym}
        overnight = now() - session.started > dates.OVERNIGHT
        rows.append(
            {
                **session_row(session),
                "patient": patient,
                "station": station.name if station else None,
                "overnight": overnight,
                "repairing": repair.progress(session.id),
                "reading": repair.reading(session.id),
                "elsewhere": _elsewhere(db, parts, session),
            }
        )
    return rows


@router.post("/sessions/{session_id}/closing", status_code=204)
def close_session(db: Db, parts: PartsDep, repair: RepairDep, session_id: int) -> None:
    """Finish a session that was left open; its recording is stored and processed."""
    if repair.progress(session_id):
        raise InputError(REPAIRED)
    session = records.get(db, session_id)
    if session.state == "open" and (elsewhere := _elsewhere(db, parts, session)):
        raise InputError("store.session_at_other_server", name=elsewhere["name"])
    if station := parts.stations.of_session(session_id):
        parts.stations.close(station.name)
    elif parts.relays.is_awaited(session_id):
        parts.relays.give_up(session_id)
    elif session.state == "open" and records.close(db, parts.store, session_id).state == "recorded":
        _queue(db, parts, session, None, {})


@router.get(
    "/sessions/{session_id}",
    dependencies=[requires_role(CLINICIAN, SCIENTIST)],
    responses=answers(SessionAnswer),
)
def read_session(
    db: Db, parts: PartsDep, requester: RequesterDep, language: LanguageDep, session_id: int
) -> dict[str, Any]:
    """A session with its recordings and results."""
    session = records.get(db, session_id)
    station = parts.stations.of_session(session_id)
    return {
        **for_reader(requester, session_row(session)),
        "plan": language.translate_keys(session.plan, ("title",)),
        "geometry": session.geometry,
        "patient": {"id": session.patient.id, "pseudonym": session.patient.pseudonym},
        "station": station.name if station else None,
        "saving": parts.stations.saves(session.id),
        "other_hand": _other_hand(db, session),
        "same_recording": _same_recording(db, session),
        "recordings": [
            for_reader(requester, recording_row(f))
            | {"corrections": [for_reader(requester, correction_row(c)) for c in f.corrections]}
            for f in session.recordings
        ],
    }


@router.delete("/sessions/{session_id}", status_code=204)
def delete_session(db: Db, parts: PartsDep, session_id: int) -> None:
    """Delete a session that holds no trial, with its recording; any other is refused."""
    erasure.erase_empty_session(db, parts.store, session_id)


@router.patch("/sessions/{session_id}", responses=answers(SessionRow))
def change_session(
    db: Db, parts: PartsDep, session_id: int, change: SessionChange
) -> dict[str, Any]:
    """Notes, conclusion, pain, examiner, date, height of the trunk's sensor; refused with 409 where somebody else changed the session meanwhile.

    With another height what was computed is computed anew, and kept.
    """
    facts = change.model_dump(include={"version", "started", "date_reason"}, exclude_none=True)
    facts["written"] = Written(
        change.notes,
        change.examiner,
        change.conclusion,
        {name: getattr(change, name) for name in PAIN_FIELDS if name in change.model_fields_set},
    )
    if "trunk_height" not in change.model_fields_set:
        return {**session_row(visit_facts.change(db, session_id, **facts))}
    before = [(f, results.current(f)) for f in records.get(db, session_id).recordings if f.sha256]
    changed = visit_facts.change(db, session_id, **facts, trunk=TrunkHeight(change.trunk_height))
    return {
        **session_row(changed),
        "results": [pair for f, stood in before for pair in recomputed(db, parts, f, stood)],
    }


@router.post(
    "/sessions/{session_id}/results",
    status_code=201,
    dependencies=[requires_role(CLINICIAN, SCIENTIST)],
)
def new_result(db: Db, parts: PartsDep, session_id: int, new: NewResult) -> dict[str, Any]:
    """Process the session's recording by another method or with other options; the same again gives the result that is there."""
    result = _queue(db, parts, records.get(db, session_id), new.method, new.options)
    return {"result": result.id}


@router.post("/recordings/{recording_id}/corrections", status_code=201)
def correct(db: Db, parts: PartsDep, recording_id: int, new: NewCorrection) -> dict[str, Any]:
    """Take a trial or a stretch of it out of the figures, or move its ends; what was computed is computed anew without it, and kept."""
    file = _require_closed(db, recording_id)
    before = results.current(file)
    reason = corrections.OFFERED.get(new.reason_code, new.reason)
    made = corrections.add(db, file, new.event, new.kind, reason, new.onset, new.end)
    return {"correction": correction_row(made), "results": recomputed(db, parts, file, before)}


@router.delete("/corrections/{correction_id}")
def undo_correction(db: Db, parts: PartsDep, correction_id: int) -> dict[str, Any]:
    """Take a correction back; it stays in the list with the moment at which it was."""
    file = corrections.get(db, correction_id).recording
    before = results.current(file)
    made = corrections.undo(db, correction_id)
    return {"correction": correction_row(made), "results": recomputed(db, parts, file, before)}


@router.get(
    "/recordings/{recording_id}/file", dependencies=[requires_role(CLINICIAN, does="exported")]
)
def download_recording(db: Db, parts: PartsDep, recording_id: int) -> Response:
    """The recording file, byte for byte."""
    file = _require_closed(db, recording_id)
    path = stored_files.fetch_local(parts.store, file.file, file.sha256)
    name = f"session-{file.session_id}-recording{path.suffix}"
    if not is_sealed(path):
        return FileResponse(path, filename=name)
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return StreamingResponse(
        pieces_of(open_stored(path)), media_type="application/octet-stream", headers=headers
    )


def queue_session(
    db: Db, parts: Parts, session: PatientSession, method: str | None, options: dict[str, Any]
) -> Result:
    """Process a session's recording unless that was done before; no method: the one that suits it."""
    return _queue(db, parts, session, method, options)


def session_row(s: PatientSession) -> SessionRow:
    """A session as the API shows it."""
    return {
        "id": s.id,
        "patient": s.patient_id,
        "hand": s.hand,
        "continues": s.continues_id,
        "state": s.state,
        "started": s.started,
        "dated": records.is_dated(s),
        "recorded_as": s.recorded_as,
        "date_reason": s.date_reason,
        "trunk_height": s.trunk_height if s.trunk_corrected is None else s.trunk_corrected,
        "trunk_corrected": s.trunk_corrected is not None,
        "version": s.version,
        "finished": s.finished,
        "examiner": s.examiner,
        "notes": s.notes,
        "conclusion": s.conclusion,
        "pain_rest": s.pain_rest,
        "pain_movement": s.pain_movement,
        "plan": s.plan,
        "source": "live" if dates.is_measured_here(s) else "upload",
        "duration": next((f.summary.get("duration") for f in s.recordings if f.summary), None),
        "tasks": records.tasks_of(s),
        "empty": erasure.is_empty(s),
    }


def recording_row(f: RecordingFile) -> RecordingRow:
    """A recording's file as the API shows it."""
    current = results.current(f)
    return {
        "id": f.id,
        "format": f.format,
        "name": f.original_name,
        "sha256": f.sha256,
        "bytes": f.bytes,
        "added": f.added,
        "summary": f.summary,
        "corrections": [correction_row(c) for c in f.corrections],
        "results": [
            {
                "id": r.id,
                "method": r.method,
                "parameters": r.parameters,
                "version": r.version,
                "state": r.state,
                "created": r.created,
                "corrections": len(r.corrections),
                "reused": r.reused,
                "current": r in current,
            }
            for r in f.results
        ],
    }


def correction_row(c: Correction) -> CorrectionRow:
    """A correction of an event as the API shows it; times in s."""
    return {
        "id": c.id,
        "event": c.event,
        "kind": c.kind,
        "onset": c.onset,
        "end": c.end,
        "reason": c.reason,
        "reason_code": corrections.reason_code(c),
        "made": c.made,
        "undone": c.undone,
    }


def _other_hand(db: Db, s: PatientSession) -> dict[str, Any] | None:
    """The session of the other hand in the same visit."""
    other = next(iter(records.same_visit(db, s)), None)
    return {"session": other.id, "hand": other.hand} if other else None


def _same_recording(db: Db, s: PatientSession) -> list[dict[str, Any]]:
    """The sessions that have the same recording, and when each got it."""
    return [
        {"session": f.session_id, "started": f.session.started, "added": f.added}
        for f in records.same_recordings(db, s)
    ]


def _elsewhere(db: Db, parts: Parts, session: PatientSession) -> dict[str, Any] | None:
    """The other one of several servers that records a session; None where it is this one."""
    found = (
        shared_servers.find_other(db, f.server, parts.store.server) for f in session.recordings
    )
    other = next((server for server in found if server), None)
    return (
        {"name": other.name, "address": other.address, "answers": other.answers} if other else None
    )


def _require_closed(db: Db, recording_id: int) -> RecordingFile:
    file = db.get(RecordingFile, recording_id)
    if file is None or file.sha256 is None:
        raise InputError("api.no_closed_recording", number=recording_id)
    return file


def recomputed(
    db: Db, parts: Parts, file: RecordingFile, before: Sequence[Result]
) -> list[dict[str, int]]:
    """For each earlier result the one that replaces it."""
    pairs = [(old, _find_or_compute(db, parts, file, old.method, old.parameters)) for old in before]
    return [{"before": old.id, "now": result.id} for old, result in pairs]


def _queue(
    db: Db, parts: Parts, session: PatientSession, method: str | None, options: dict[str, Any]
) -> Result:
    closed = [f for f in session.recordings if f.sha256]
    if not closed:
        raise InputError("api.session_without_recording")
    method = method or records.suited_method(closed[-1])
    if method not in ALL_METHODS:
        raise InputError("analysis.unknown_method", name=method, methods=", ".join(ALL_METHODS))
    changed = changed_options(with_options(ALL_METHODS[method].Params, options))
    return _find_or_compute(db, parts, closed[-1], method, changed)


def _find_or_compute(
    db: Db, parts: Parts, file: RecordingFile, method: str, parameters: Mapping[str, Any]
) -> Result:
    """The result, computed here where it is not there yet; what another server has queued, that one computes."""
    own = parts.store.server
    result = results.find_matching(db, file, method, parameters, software_version(), own)
    if result.state == "queued" and own in ("", result.server):
        parts.jobs.process(result.id)
    return result


async def receive(file: UploadFile, parts: Parts, target: BinaryIO) -> None:
    """Write what is uploaded; InputError where it is too large or the disk is full."""
    async for chunk in _chunks(file, parts.settings.largest_upload):
        parts.store.require_room(len(chunk) + 2**20)
        target.write(chunk)


async def _chunks(file: UploadFile, most: int) -> AsyncIterator[bytes]:
    total = 0
    while chunk := await file.read(CHUNK):
        total += len(chunk)
        if total > most:
            raise InputError("api.upload_too_large", name=str(file.filename), size=most / 2**20)
        yield chunk
