"""Sessions and their recordings: begun live, or made from an uploaded file."""

import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import Select, or_, select
from sqlalchemy.orm import Session

from handscope.estimators.data.samples import Event, Stream
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import HANDS, Hand
from handscope.estimators.hand.geometry import measures_from, sized, table_of
from handscope.estimators.methods import default_for
from handscope.sessions.db.tables import ErasedFile, Patient, PatientSession, RecordingFile, now
from handscope.sessions.files import native
from handscope.sessions.files.recorder import is_being_written
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.sealing.stored import store_file
from handscope.sessions.store import stored_files
from handscope.sessions.store.store import Store

FINISH_WAIT = 10.0  # s that closing a session waits for its recorder


@dataclass(frozen=True)
class Upload:
    """What is kept of an uploaded recording beside its file."""

    hand: Hand
    started: datetime | None  # where the recording has it
    bytes: int
    sha256: str
    summary: Mapping[str, Any]


def tasks_of(session: PatientSession) -> list[str]:
    """Names of the tasks in a session's recordings, one for each trial."""
    events = (e for f in session.recordings for e in f.summary.get("events", []))
    return [e["task"] for e in events if e["trial_type"] == "task"]


def is_without_trial(session: PatientSession) -> bool:
    """Whether a session that was measured here holds no accepted trial."""
    here = all(f.format == "native" and not f.original_name for f in session.recordings)
    return here and not tasks_of(session)


def has_unable(session: PatientSession) -> bool:
    """Whether the patient could not do some task, or may have been unable: summaries of older versions have no outcomes."""
    events = (e for f in session.recordings for e in f.summary.get("events", []))
    attempts = (e for e in events if e["trial_type"] == "annotation" and not e.get("phase"))
    return any(e.get("outcome", "unable") == "unable" for e in attempts if e.get("task"))


def begin(
    db: Session,
    store: Store,
    patient: Patient,
    hand: Hand,
    geometry: Mapping[str, Any],
    examiner: str = "",
    continues: int | None = None,
    plan: Mapping[str, Any] | None = None,
) -> tuple[PatientSession, RecordingFile]:
    """A session about to be recorded, with the place of its recording; it may continue one of the other hand."""
    measures_from(geometry)
    session = PatientSession(
        patient=patient,
        hand=hand,
        geometry=dict(geometry),
        trunk_height=patient.trunk_height,
        examiner=examiner,
        continues_id=continues,
        plan=dict(plan or {}),
    )
    place = store.new_recording(native.SUFFIX)
    file = RecordingFile(session=session, format="native", file=place, server=store.server)
    db.add_all([session, file])
    db.commit()
    return session, file


def close(db: Session, store: Store, session_id: int) -> PatientSession:
    """The recording is finished: keep its checksum and what it holds; a session whose recording holds nothing is failed."""
    session = get(db, session_id)
    for file in session.recordings:
        if file.sha256 is None:
            require_finished(store.path_of(file.file))
            describe(file, store)
    session.finished = now()
    session.state = "recorded" if any(f.sha256 for f in session.recordings) else "failed"
    db.commit()
    return session


def read_upload(upload: Path, name: str, hand: Hand | None) -> Upload:
    """What an uploaded recording holds, called `name` where it was; takes seconds of a core. InputError where it cannot be opened."""
    try:
        recording = formats_recordings.load(upload, hand)
    except InputError as mistake:
        raise _named(mistake, upload.name, Path(name).name) from None
    return Upload(
        recording.hand,
        _start_of(recording),
        upload.stat().st_size,
        native.file_checksum(upload),
        summary(recording),
    )


def _named(mistake: InputError, stored: str, name: str) -> InputError:
    """The same mistake of a file that its user calls `name`."""
    if mistake.message is None:
        return InputError(str(mistake).replace(stored, name))
    values = {
        key: value.replace(stored, name) if type(value) is str else value
        for key, value in mistake.message.values.items()
    }
    return InputError(replace(mistake.message, values=values))


def store_upload(
    db: Session, store: Store, patient: Patient, upload: Path, name: str, found: Upload
) -> PatientSession:
    """Keep an uploaded recording that was read as a session of its own; `upload` is moved into the store.

    Until the session is stored the file is listed as one to be removed, so that a crash between the two leaves no file without a session.
    """
    suffix = native.SUFFIX if upload.suffix == native.SUFFIX else ".zip"
    place = store.new_recording(suffix)
    fleeting = ErasedFile(file=place, server=store.server)
    db.add(fleeting)
    db.commit()
    store_file(upload, store.path_of(place))
    try:
        moment = now()
        session = PatientSession(
            patient=patient, hand=found.hand, geometry={}, state="recorded", finished=moment
        )
        session.started = found.started or moment
        kind = "native" if suffix == native.SUFFIX else "motion-bids"
        file = RecordingFile(
            session=session,
            format=kind,
            file=place,
            original_name=Path(name).name[:200],
            server=store.server,
        )
        file.bytes, file.sha256, file.summary = found.bytes, found.sha256, dict(found.summary)
        db.add_all([session, file])
        db.delete(fleeting)
        db.commit()
    except BaseException:
        db.rollback()
        store.path_of(place).unlink(missing_ok=True)
        raise
    return session


def add_upload(
    db: Session, store: Store, patient: Patient, upload: Path, name: str, hand: Hand | None
) -> PatientSession:
    """Read an uploaded recording and keep it, only when it can be opened."""
    return store_upload(db, store, patient, upload, name, read_upload(upload, name, hand))


def get(db: Session, session_id: int) -> PatientSession:
    """The session; InputError where there is none."""
    session = db.get(PatientSession, session_id)
    if session is None:
        raise InputError("store.session_unknown", number=session_id)
    return session


def same_visit(db: Session, session: PatientSession) -> list[PatientSession]:
    """Sessions of the other hand in the same visit: the one that it continues first, then those that continue it."""
    is_neighbour = or_(
        PatientSession.id == session.continues_id, PatientSession.continues_id == session.id
    )
    return list(db.scalars(select(PatientSession).where(is_neighbour).order_by(PatientSession.id)))


def same_recordings(db: Session, session: PatientSession) -> list[RecordingFile]:
    """Files of the patient's other sessions that were kept before with the content of one of this session's, the first one first."""
    sums = {f.sha256: f.id for f in session.recordings if f.sha256}
    found = (
        select(RecordingFile)
        .join(PatientSession)
        .where(
            PatientSession.patient_id == session.patient_id,
            PatientSession.id != session.id,
            RecordingFile.sha256.in_(sums),
        )
        .order_by(RecordingFile.id)
    )
    return [f for f in db.scalars(found) if f.id < sums[f.sha256 or ""]]


def visible_among(db: Session, sessions: Collection[int]) -> set[int]:
    """Which of these sessions the database session sees."""
    return set(db.scalars(select(PatientSession.id).where(PatientSession.id.in_(sessions))))


def open_recording(store: Store, file: RecordingFile) -> LoadedRecording:
    """A kept recording with its session's hand and geometry."""
    session = file.session
    recording = formats_recordings.load(
        stored_files.fetch_local(store, file.file, file.sha256), hand_of(session.hand)
    )
    if not session.geometry:
        return recording
    return replace(recording, geometry=sized(recording.hand, measures_from(session.geometry)))


def require_finished(path: Path) -> None:
    """Wait for a recorder that outlived its server; InputError, and the session stays open, where it goes on."""
    until = time.monotonic() + FINISH_WAIT
    while path.exists() and is_being_written(path):
        if time.monotonic() > until:
            raise InputError("store.recording_in_progress")
        time.sleep(0.05)


def describe(file: RecordingFile, store: Store) -> None:
    """Size, checksum and summary of a closed file; a file that holds no samples keeps sha256 None."""
    path = store.path_of(file.file)
    try:
        recording = formats_recordings.load(path, hand_of(file.session.hand))
    except InputError as problem:
        file.summary = {"problem": str(problem).replace(path.name, "the recording")}
        return
    file.bytes, file.sha256 = path.stat().st_size, native.file_checksum(path)
    file.summary = summary(recording)


def list_abandoned(db: Session, server: str = "") -> list[PatientSession]:
    """Sessions that are not finished, the oldest first: they run, or a server that stopped left them open; of one of several servers its own alone."""
    query = select(PatientSession).where(PatientSession.state == "open")
    return list(db.scalars(of_server(query, server).order_by(PatientSession.started)))


def of_server(query: Select[PatientSession], server: str) -> Select[PatientSession]:
    """Sessions of which the server has a recording; "" is one alone, which has all."""
    if not server:
        return query
    return query.where(PatientSession.recordings.any(RecordingFile.server == server))


def suited_method(file: RecordingFile) -> str:
    """The method for a closed recording when nobody names one; summaries of older versions name no quantities."""
    streams = file.summary.get("streams", [])
    return default_for(
        [Stream(s["name"], (), tuple(s.get("quantities", ())), s.get("rate", 0.0)) for s in streams]
    )


def hand_of(word: str) -> Hand:
    """left or right as a Hand."""
    for hand in HANDS:
        if word == hand:
            return hand
    raise InputError("store.unknown_hand", word=word)


def is_dated(session: PatientSession) -> bool:
    """Whether somebody or something tells when the hand was measured: else `started` is the instant of the upload."""
    if session.recorded_as is not None:
        return True
    facts = [(f.summary.get("start_utc"), f) for f in session.recordings]
    return any(
        start or (f.format == "native" and "start_utc" not in f.summary) for start, f in facts
    )


def _start_of(recording: LoadedRecording) -> datetime | None:
    """When it was recorded, where the recording has that with its time zone."""
    try:
        start = datetime.fromisoformat(recording.start_utc or "")
    except ValueError:
        return None
    return start if start.tzinfo else start.replace(tzinfo=UTC)


def summary(recording: LoadedRecording) -> dict[str, Any]:
    """What a recording holds, for lists and pages."""
    streams = [{**stream_row(b.stream), "samples": len(b.t)} for b in recording.samples.values()]
    gaps = int(sum(np.isnan(b.values).any(axis=(1, 2)).sum() for b in recording.samples.values()))
    return {
        "duration": round(recording.duration, 3),
        "start_utc": recording.start_utc,
        "streams": streams,
        "events": [event_row(e) for e in recording.events],
        "losses": dict(recording.losses),
        "samples_with_gaps": gaps,
        "warnings": list(recording.warnings),
        "source": dict(recording.source),
        "geometry": table_of(recording.geometry),
    }


def stream_row(stream: Stream) -> dict[str, Any]:
    """A stream in a recording's summary."""
    return {
        "name": stream.name,
        "sensors": list(stream.sensors),
        "quantities": list(stream.quantities),
        "rate": round(stream.rate, 3),
    }


def event_row(event: Event) -> dict[str, Any]:
    """An event in a recording's summary."""
    row = {
        "trial_type": event.trial_type,
        "onset": round(event.onset, 3),
        "duration": round(event.duration, 3),
        "task": event.details.get("task_name"),
    }
    outcome = str(event.details.get("outcome") or "").partition(":")[0]  # without its reason
    further = {"phase": event.details.get("phase"), "outcome": outcome}
    return row | {name: value for name, value in further.items() if value}
