"""Sessions that a crash left open: listed at once from the ends of their recordings, read whole afterwards.

`close_from_ends` reads what a recorder wrote since its last checkpoint, however long the recording is; its summary then says `unread`. Checksum, samples,
losses and warnings need the whole recording: `read_whole` follows, and a server that stops before is followed by one that goes on there.
"""

from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from handscope.sessions.db.tables import PatientSession, RecordingFile, now
from handscope.sessions.files import native
from handscope.sessions.files.recording_ends import RecordingEnds, read_ends
from handscope.sessions.store import records
from handscope.sessions.store.store import Store

UNREAD = "unread"  # in the summary of a recording of which the ends alone were read


def close_from_ends(db: Session, store: Store, session_id: int) -> PatientSession:
    """Close a session; one whose recordings' ends do not tell enough is closed as ever (records.close)."""
    session = records.get(db, session_id)
    found = {
        file.id: ends
        for file in session.recordings
        if file.sha256 is None and (ends := _ends_of(store, file)) is not None
    }
    if not found or any(f.id not in found for f in session.recordings):
        return records.close(db, store, session_id)
    for file in session.recordings:
        file.bytes = store.path_of(file.file).stat().st_size
        file.summary = _summary(found[file.id])
    session.finished, session.state = now(), "recorded"
    db.commit()
    return session


def list_unread(db: Session, server: str = "") -> list[PatientSession]:
    """Sessions of which a recording is still to be read whole, the oldest first; of one of several servers its own alone."""
    finished = select(PatientSession).where(PatientSession.state == "recorded")
    recorded = records.of_server(finished, server)
    missing = recorded.where(PatientSession.recordings.any(RecordingFile.sha256.is_(None)))
    sessions = db.scalars(missing.order_by(PatientSession.started))
    return [s for s in sessions if any(is_unread(file) for file in s.recordings)]


def is_unread(file: RecordingFile) -> bool:
    """Whether the ends of a recording alone were read."""
    return bool(file.summary and file.summary.get(UNREAD))


def read_whole(db: Session, store: Store, session_id: int) -> PatientSession:
    """Checksum and summary of a session's recordings that were not read; one that holds nothing makes it failed."""
    session = records.get(db, session_id)
    for file in session.recordings:
        if is_unread(file):
            records.describe(file, store)
    if not any(file.sha256 for file in session.recordings):
        session.state = "failed"
    db.commit()
    return session


def _ends_of(store: Store, file: RecordingFile) -> RecordingEnds | None:
    path = store.path_of(file.file)
    if path.suffix != native.SUFFIX or not path.exists():
        return None
    records.require_finished(path)
    return read_ends(path)


def _summary(ends: RecordingEnds) -> dict[str, Any]:
    """What lists show of a recording until it is read whole."""
    return {
        UNREAD: True,
        "duration": round(ends.duration, 3),
        "streams": [records.stream_row(stream) for stream in ends.streams],
        "events": [records.event_row(event) for event in ends.events],
        "warnings": [],
        "source": {"format": "native", "device_id": f"{ends.device_id:016x}"},
    }
