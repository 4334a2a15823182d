"""Rows that a database session sees: everything, or patients of some wards with all that belongs to them.

Every query of a narrowed session is narrowed here, whoever writes it, so that no caller can forget to. What a commit
does by itself (the audit trail, repeatability over all patients) works on everything: `unrestricted`.
Not narrowed: plain SQL and queries of tables instead of classes; none of them reads a patient's rows.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from sqlalchemy import ColumnElement, Select, event, or_, select
from sqlalchemy.orm import ORMExecuteState, Session, sessionmaker, with_loader_criteria

from handscope.sessions.db.tables import (
    HOUSE,
    Base,
    Correction,
    EmergencyAccess,
    Goal,
    HandPhotograph,
    Note,
    Patient,
    PatientSession,
    RecordingFile,
    Repeatability,
    Result,
    ResultReferences,
    Reuse,
    SelfCalibration,
    TreatmentEvent,
)

VISIBLE = "visible"  # the key in Session.info
_patient, _session = Patient.__table__.alias(), PatientSession.__table__.alias()
_recording, _result = RecordingFile.__table__.alias(), Result.__table__.alias()


@dataclass(frozen=True)
class Visibility:
    """Whose patients an account sees that does not see all: of its wards and of the whole house."""

    wards: frozenset[int]
    patients: frozenset[int] = frozenset()  # of other wards, opened in an emergency

    def covers(self, ward: int, patient: int) -> bool:
        """Whether a patient of this ward is seen."""
        return ward == HOUSE or ward in self.wards or patient in self.patients


def enable(database: sessionmaker[Session]) -> None:
    """From now on sessions of this database see only what `restrict` leaves them."""
    event.listen(database, "do_orm_execute", _narrow)


def restrict(db: Session, visibility: Visibility | None) -> None:
    """From now on the session sees no more than this; None: everything."""
    db.info[VISIBLE] = visibility


@contextmanager
def unrestricted(db: Session) -> Iterator[None]:
    """Within, the session sees everything."""
    before = db.info.pop(VISIBLE, None)
    try:
        yield
    finally:
        db.info[VISIBLE] = before


def visible_patients(visibility: Visibility) -> Select[int]:
    """Numbers of the patients that are seen."""
    seen = or_(
        _patient.c.ward_id.in_({HOUSE, *visibility.wards}),
        _patient.c.id.in_(visibility.patients),
    )
    return select(_patient.c.id).where(seen)


def _narrow(state: ORMExecuteState) -> None:
    visibility: Visibility | None = state.session.info.get(VISIBLE)
    if visibility is not None and not state.is_column_load:
        state.statement = state.statement.options(
            *(
                with_loader_criteria(kind, must, include_aliases=True)
                for kind, must in criteria_by_class(visibility).items()
            )
        )


def criteria_by_class(visibility: Visibility) -> dict[type[Base], ColumnElement[bool]]:
    """What rows of each class must fulfil."""
    patients = visible_patients(visibility)
    sessions = select(_session.c.id).where(_session.c.patient_id.in_(patients))
    recordings = select(_recording.c.id).where(_recording.c.session_id.in_(sessions))
    results = select(_result.c.id).where(_result.c.recording_id.in_(recordings))
    narrowed: dict[type[Base], ColumnElement[bool]] = {
        Patient: Patient.id.in_(patients),
        Repeatability: or_(
            Repeatability.patient_id.is_(None), Repeatability.patient_id.in_(patients)
        ),
        ResultReferences: ResultReferences.result_id.in_(results),
    }
    for of_patient in (
        *(Note, PatientSession, SelfCalibration, HandPhotograph, EmergencyAccess),
        *(TreatmentEvent, Goal),
    ):
        narrowed[of_patient] = of_patient.patient_id.in_(patients)
    for of_session in (RecordingFile, Reuse):
        narrowed[of_session] = of_session.session_id.in_(sessions)
    for of_recording in (Correction, Result):
        narrowed[of_recording] = of_recording.recording_id.in_(recordings)
    return narrowed
