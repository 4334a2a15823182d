"""/api/patients"""

from typing import Annotated, Any

from fastapi import APIRouter, Query
from pydantic import BaseModel, ConfigDict, Field

from app.api.sessions import session_row
from app.api.state import Db
from sessions import patients
from sessions.tables import Patient

router = APIRouter(prefix="/patients", tags=["patients"])


class NewPatient(BaseModel):
    model_config = ConfigDict(extra="forbid")

    pseudonym: str = Field(description="a code, never a name", max_length=200)
    year_of_birth: int | None = None
    dominant_hand: str | None = None
    affected_hand: str | None = None
    notes: str = Field("", max_length=20_000)


class PatientChange(BaseModel):
    model_config = ConfigDict(extra="forbid")

    version: int = Field(description="the version that was seen; somebody else's change meanwhile is refused")
    pseudonym: str | None = Field(None, max_length=200)
    year_of_birth: int | None = None
    dominant_hand: str | None = None
    affected_hand: str | None = None
    hand_measures: dict[str, dict[str, Any]] | None = Field(None, description="HandGeometry by hand, metres")
    notes: str | None = Field(None, max_length=20_000)
    archived: bool | None = None


@router.get("")
def list_patients(db: Db, search: Annotated[str, Query(max_length=200)] = "", archived: bool = False) -> list[dict[str, Any]]:
    """Patients by pseudonym, the most recently seen first."""
    return [{**patient_row(p), "sessions": count, "last_session": last} for p, count, last in patients.find(db, search, archived)]


@router.post("", status_code=201)
def create_patient(db: Db, new: NewPatient) -> dict[str, Any]:
    return patient_row(patients.create(db, **new.model_dump()))


@router.get("/{patient_id}")
def read_patient(db: Db, patient_id: int) -> dict[str, Any]:
    """A patient with all sessions, the newest first."""
    patient = patients.get(db, patient_id)
    return {**patient_row(patient), "sessions": [session_row(s) for s in patient.sessions]}


@router.patch("/{patient_id}")
def change_patient(db: Db, patient_id: int, change: PatientChange) -> dict[str, Any]:
    return patient_row(patients.change(db, patient_id, **change.model_dump(exclude_unset=True)))


def patient_row(p: Patient) -> dict[str, Any]:
    return {
        "id": p.id,
        "pseudonym": p.pseudonym,
        "year_of_birth": p.year_of_birth,
        "dominant_hand": p.dominant_hand,
        "affected_hand": p.affected_hand,
        "hand_measures": p.hand_measures,
        "notes": p.notes,
        "archived": p.archived,
        "created": p.created,
        "version": p.version,
    }
