"""What was done with a patient, visit by visit: read in a few queries, whatever the number of visits."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session, selectinload

from handscope.sessions.db.tables import PatientSession, RecordingFile, Result


@dataclass(frozen=True)
class Visit:
    """A session of the patient with what its newest finished result says of the calibration."""

    session: PatientSession
    # as app.results keeps it: source, onset, end, quality by sensor; None without a result
    calibration: Mapping[str, Any] | None
    warnings: int  # of that result


def visits(db: Session, patient_id: int) -> list[Visit]:
    """All visits of a patient, the newest first."""
    of_patient = PatientSession.patient_id == patient_id
    query = (
        select(PatientSession).where(of_patient).options(selectinload(PatientSession.recordings))
    )
    sessions = db.scalars(
        query.order_by(PatientSession.started.desc(), PatientSession.id.desc())
    ).all()
    rows = db.execute(
        select(RecordingFile.session_id, Result.content["calibration"], Result.warnings)
        .join(RecordingFile, Result.recording_id == RecordingFile.id)
        .join(PatientSession, RecordingFile.session_id == PatientSession.id)
        .where(of_patient, Result.state == "done")
        .order_by(Result.id)
    )
    newest = {session: (calibration, len(warnings)) for session, calibration, warnings in rows}
    return [Visit(s, *newest.get(s.id, (None, 0))) for s in sessions]
