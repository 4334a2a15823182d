"""Gloves that measured here, as their recordings tell: firmware, strips, losses, when each was worn and calibrated last."""

from collections import defaultdict
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from handscope.sessions.clinic.self_calibrations import glove_of
from handscope.sessions.db.tables import PatientSession, RecordingFile, Result

MOST_SOUGHT = 50  # recordings of a glove in which its last calibration is looked for


@dataclass(frozen=True)
class KnownGlove:
    """A glove of which there are recordings, as its newest one shows it."""

    name: str
    device_id: str  # "" where its recordings do not tell
    firmware: str
    sessions: int
    session: int  # the newest
    started: datetime  # of that session
    hand: str
    streams: list[dict[str, Any]]  # of it: name, sensors, rate in Hz, samples, lost
    calibrated: datetime | None  # start of the session calibrated last
    calibrated_sensors: int  # of it


def known_gloves(db: Session) -> list[KnownGlove]:
    """Those of recordings that the database session sees, the one worn last first."""
    rows = db.execute(
        select(RecordingFile.id, RecordingFile.session_id, RecordingFile.summary["source"])
        .join(PatientSession, RecordingFile.session_id == PatientSession.id)
        .where(RecordingFile.sha256.is_not(None))
        .order_by(PatientSession.started.desc(), RecordingFile.id.desc())
    )
    found: dict[tuple[str, str], list[tuple[int, int]]] = defaultdict(list)
    for recording, session, source in rows:
        name, number = str((source or {}).get("device") or ""), glove_of({"source": source or {}})
        if name or number:
            found[("", number) if number else (name, "")].append((recording, session))
    return [_known(db, recordings) for recordings in found.values()]


def _known(db: Session, recordings: list[tuple[int, int]]) -> KnownGlove:
    newest = db.get_one(RecordingFile, recordings[0][0])
    source, losses = newest.summary.get("source", {}), newest.summary.get("losses", {})
    streams = [
        {
            "name": s["name"],
            "sensors": len(s["sensors"]),
            "rate": s["rate"],
            "samples": s["samples"],
            "lost": losses.get(s["name"]),
        }
        for s in newest.summary.get("streams", [])
    ]
    calibrated, sensors = _last_calibration(db, [r for r, _ in recordings[:MOST_SOUGHT]])
    return KnownGlove(
        str(source.get("device") or ""),
        glove_of(newest.summary),
        str(source.get("firmware") or ""),
        len({session for _, session in recordings}),
        newest.session_id,
        newest.session.started,
        newest.session.hand,
        streams,
        calibrated,
        sensors,
    )


def _last_calibration(db: Session, recordings: list[int]) -> tuple[datetime | None, int]:
    """Start of the session with the newest calibration, and its sensors; the results' contents are large, so they are read one at a time."""
    results = db.execute(
        select(Result.id, PatientSession.started)
        .join(RecordingFile, Result.recording_id == RecordingFile.id)
        .join(PatientSession, RecordingFile.session_id == PatientSession.id)
        .where(Result.recording_id.in_(recordings), Result.state == "done")
        .order_by(PatientSession.started.desc(), Result.id.desc())
    ).all()
    for result, started in results:
        calibration = db.scalar(select(Result.content["calibration"]).where(Result.id == result))
        if calibration:
            return started, len(calibration.get("quality") or {})
    return None, 0
