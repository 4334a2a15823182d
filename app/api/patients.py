"""/api/patients"""

from datetime import date
from itertools import chain
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from pydantic import Field
from starlette.responses import StreamingResponse

from handscope.app.api.answers import NoteRow, PatientAnswer, PatientListed, PatientRow, answers
from handscope.app.api.pseudonymisation import for_reader
from handscope.app.api.sessions import session_row
from handscope.app.api.wards.emergency_routes import emergency_row
from handscope.app.api.wards.ward_routes import require_member
from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import (
    ADMINISTRATOR,
    CLINICIAN,
    SCIENTIST,
    RequesterDep,
    requires_role,
)
from handscope.app.example_patients import patients as example_patients
from handscope.app.language import Language
from handscope.app.results.result_view import calibration_payload
from handscope.app.state import Db, LanguageDep, PartsDep
from handscope.app.workers.patient_exporter import stream_patient_export
from handscope.sessions.clinic import dates, notes, patients, timeline
from handscope.sessions.db.tables import Note, Patient, now
from handscope.sessions.store import erasure
from handscope.sessions.wards import wards

router = APIRouter(tags=["patients"], dependencies=[requires_role(CLINICIAN)])
MOST = 200  # patients in one answer
TYPED = 2000  # characters of a field that has a rule of its own


class NewPatient(Incoming):
    """A new patient, under a pseudonym."""

    pseudonym: str = Field(description="a code, never a name", max_length=TYPED)
    ward: int | None = Field(
        None, description="one of the account's wards; without it the first of them"
    )
    year_of_birth: int | None = None
    dominant_hand: str | None = None
    affected_hand: str | None = None
    note: str = Field("", max_length=notes.LONGEST)
    confirmed: bool = Field(
        False, description="that the pseudonym is a code although it looks like a name"
    )


class PatientChange(Incoming):
    """What may change of a patient; `version` is that which was read."""

    version: int = Field(
        description="the version that was seen; somebody else's change meanwhile is refused"
    )
    pseudonym: str | None = Field(None, max_length=TYPED)
    ward: int | None = Field(None, description="the ward that the patient is moved to")
    year_of_birth: int | None = None
    dominant_hand: str | None = None
    affected_hand: str | None = None
    hand_measures: dict[str, dict[str, Any]] | None = Field(
        None, description="HandGeometry by hand, metres"
    )
    trunk_height: float | None = Field(
        None,
        allow_inf_nan=False,
        description="of the trunk's sensor above the hips, metres; for reaching",
    )
    archived: bool | None = None
    confirmed: bool = Field(
        False, description="that the pseudonym is a code although it looks like a name"
    )


class Erasure(Incoming):
    """The pseudonym typed again, before everything of a patient is erased."""

    pseudonym: str = Field(
        max_length=200, description="typed by the person who erases, as it is stored"
    )


class NewNote(Incoming):
    """The text of a new note."""

    text: str = Field(max_length=notes.LONGEST + 100)


class NoteChange(Incoming):
    """A note's new text, or that it is removed."""

    version: int = Field(description="the version that was seen")
    text: str | None = Field(None, max_length=notes.LONGEST + 100)
    removed: bool | None = Field(None, description="a removed note can be brought back for a week")


@router.get(
    "/patients",
    dependencies=[requires_role(CLINICIAN, SCIENTIST)],
    responses=answers(list[PatientListed]),
)
def list_patients(
    db: Db,
    parts: PartsDep,
    requester: RequesterDep,
    response: Response,
    search: Annotated[str, Query(max_length=200)] = "",
    archived: bool = False,
    offset: Annotated[int, Query(ge=0)] = 0,
    limit: Annotated[int, Query(ge=1, le=MOST)] = MOST,
) -> list[dict[str, Any]]:
    """Patients by pseudonym, the most recently seen first; the header X-Total-Count says how many there are."""
    response.headers["X-Total-Count"] = str(patients.count(db, search, archived))
    matches = patients.find(db, search, archived, limit, offset)
    planned = example_patients.planned(parts.store.folder)
    return [
        {
            **for_reader(requester, {**patient_row(p), "sessions": count, "last_session": last}),
            "planned": planned.get(p.pseudonym, 0),
        }
        for p, count, last in matches
    ]


@router.post("/patients", status_code=201, responses=answers(PatientRow, 201))
def create_patient(db: Db, requester: RequesterDep, new: NewPatient) -> Any:
    """Create a patient in a ward of the account's."""
    ward = wards.ward_for_new_patient(db, requester.visibility, new.ward)
    made = patients.create(db, **new.model_dump(exclude={"ward"}), ward_id=ward)
    return patient_row(made)


@router.get(
    "/patients/{patient_id}",
    dependencies=[requires_role(CLINICIAN, SCIENTIST)],
    responses=answers(PatientAnswer),
)
def read_patient(
    db: Db, parts: PartsDep, requester: RequesterDep, language: LanguageDep, patient_id: int
) -> dict[str, Any]:
    """A patient with notes and all sessions, the newest first."""
    patient, clock, visits = patients.get(db, patient_id), now(), timeline.visits(db, patient_id)
    sessions = [v.session for v in visits]
    doubts = dates.find_doubts(patient, sessions, clock)
    rows = [
        for_reader(
            requester,
            {
                **session_row(v.session),
                "calibration": calibration_payload(v.calibration, language),
                "warnings": v.warnings,
                "doubts": doubts[v.session.id],
            },
        )
        for v in visits
    ]
    return {
        **for_reader(
            requester,
            {
                **patient_row(patient),
                "notes": [note_row(n, language) for n in patient.notes if n.removed is None],
                "emergency_accesses": [
                    emergency_row(a) for a in patient.emergency_accesses if requester.sees_all
                ],
            },
        ),
        "sessions": rows,
        "planned": example_patients.planned(parts.store.folder).get(patient.pseudonym, 0),
        "clock": for_reader(
            requester, {"now": clock, "doubts": dates.find_clock_doubts(patient, sessions, clock)}
        ),
    }


@router.patch("/patients/{patient_id}", responses=answers(PatientRow))
def change_patient(db: Db, requester: RequesterDep, patient_id: int, change: PatientChange) -> Any:
    """Change a patient; 409 where somebody else changed it meanwhile."""
    facts = change.model_dump(exclude_unset=True, exclude={"ward"})
    if change.ward is not None:
        require_member(requester, patients.get(db, patient_id).ward_id)
        facts["ward_id"] = wards.get(db, change.ward).id
    return patient_row(patients.change(db, patient_id, **facts))


@router.get(
    "/patients/{patient_id}/export.zip", dependencies=[requires_role(CLINICIAN, does="exported")]
)
def export_patient(db: Db, parts: PartsDep, patient_id: int) -> StreamingResponse:
    """Everything about a patient: facts, notes, recordings as kept and as Motion-BIDS, results, a manifest with checksums."""
    pseudonym = patients.get(db, patient_id).pseudonym
    zipped = stream_patient_export(parts.store, patient_id)
    first = next(zipped)
    name = f"handscope-{''.join(c if c.isascii() and c.isalnum() else '-' for c in pseudonym)}-{date.today().isoformat()}.zip"
    return StreamingResponse(
        chain([first], zipped),
        media_type="application/zip",
        headers={"Content-Disposition": f'attachment; filename="{name}"'},
    )


@router.post("/patients/{patient_id}/erasure")
def erase_patient(
    db: Db, parts: PartsDep, requester: RequesterDep, patient_id: int, body: Erasure
) -> dict[str, int]:
    """Erase everything about a patient for good; answers with what there was."""
    require_member(requester, patients.get(db, patient_id).ward_id)
    sessions = {s.id for s in patients.get(db, patient_id).sessions}
    counts = erasure.erase(db, parts.store, patient_id, body.pseudonym)
    parts.stations.close_replays(sessions)
    return counts


@router.get("/erasures", dependencies=[requires_role(CLINICIAN, ADMINISTRATOR)])
def list_erasures(db: Db, requester: RequesterDep) -> list[dict[str, Any]]:
    """What was erased when, the newest first; never whose it was. To accounts of wards what their own erased."""
    within = wards.audited_within(db, requester.visibility)
    return [
        {"at": line.at, "what": "patient erased", "counts": line.counts}
        for line in erasure.erasures(db, within)
    ]


@router.post("/patients/{patient_id}/notes", status_code=201, responses=answers(NoteRow, 201))
def write_note(db: Db, language: LanguageDep, patient_id: int, new: NewNote) -> Any:
    """Write a note about a patient."""
    return note_row(notes.write(db, patients.get(db, patient_id), new.text), language)


@router.get("/notes/{note_id}", responses=answers(NoteRow))
def read_note(db: Db, language: LanguageDep, note_id: int) -> Any:
    """One note."""
    return note_row(notes.get(db, note_id), language)


@router.patch("/notes/{note_id}", responses=answers(NoteRow))
def change_note(db: Db, language: LanguageDep, note_id: int, change: NoteChange) -> Any:
    """Correct a note, remove it or bring it back."""
    return note_row(notes.change(db, note_id, **change.model_dump(exclude_unset=True)), language)


def patient_row(p: Patient) -> PatientRow:
    """A patient as the API shows them; lengths in m, trunk height in m."""
    return {
        "id": p.id,
        "pseudonym": p.pseudonym,
        "ward": p.ward_id,
        "ward_name": p.ward.name,
        "year_of_birth": p.year_of_birth,
        "dominant_hand": p.dominant_hand,
        "affected_hand": p.affected_hand,
        "hand_measures": p.hand_measures,
        "trunk_height": p.trunk_height,
        "archived": p.archived,
        "created": p.created,
        "version": p.version,
    }


def note_row(n: Note, language: Language) -> NoteRow:
    """A note as the API shows it, the demonstration's in the reader's language."""
    return {
        "id": n.id,
        "text": language.example(n.text),
        "written": n.written,
        "removed": n.removed,
        "version": n.version,
    }
