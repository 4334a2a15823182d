"""/api/self-calibrations: self-calibrations of a patient's hands, and what a session takes over of them"""

from typing import Any

from fastapi import APIRouter
from pydantic import Field

from handscope.app.api.live.session_start import Decision
from handscope.app.api.sessions import recomputed
from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import CLINICIAN, SCIENTIST, requires_role
from handscope.app.language import Language
from handscope.app.report.sections.self_calibration import describe
from handscope.app.state import Db, LanguageDep, PartsDep
from handscope.app.version import software_version
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import patients, results, self_calibrations
from handscope.sessions.clinic.self_calibrations import Offer
from handscope.sessions.db.tables import PatientSession, SelfCalibration
from handscope.sessions.store import records

router = APIRouter(tags=["self-calibrations"], dependencies=[requires_role(CLINICIAN)])


class NewSelfCalibration(Incoming):
    """The result whose self-calibration is to be stored."""

    result: int = Field(
        description="a result by map, whose findings are to be kept with the patient"
    )


class SelfCalibrationChange(Incoming):
    """Whether a stored self-calibration is withdrawn."""

    withdrawn: bool = Field(description="it is not offered any more; what took it over keeps it")


@router.get(
    "/patients/{patient_id}/self-calibrations", dependencies=[requires_role(CLINICIAN, SCIENTIST)]
)
def list_self_calibrations(db: Db, language: LanguageDep, patient_id: int) -> list[dict[str, Any]]:
    """Self-calibrations of both hands, withdrawn ones among them, the newest first."""
    return [row(c, language) for c in patients.get(db, patient_id).self_calibrations]


@router.post("/patients/{patient_id}/self-calibrations", status_code=201)
def keep_self_calibration(
    db: Db, language: LanguageDep, patient_id: int, new: NewSelfCalibration
) -> dict[str, Any]:
    """Keep what a result by map found with the patient; keeping is not using: sessions take it over where somebody decides so."""
    result = results.get(db, new.result)
    if result.recording.session.patient_id != patient_id:
        raise InputError("api.result_of_other_patient", number=new.result)
    return row(
        self_calibrations.store(
            db, result.recording, self_calibrations.of_result(result), software_version()
        ),
        language,
    )


@router.patch("/self-calibrations/{self_calibration_id}")
def change_self_calibration(
    db: Db, language: LanguageDep, self_calibration_id: int, change: SelfCalibrationChange
) -> dict[str, Any]:
    """Withdraw a self-calibration, or offer it again."""
    return row(self_calibrations.withdraw(db, self_calibration_id, change.withdrawn), language)


@router.get("/sessions/{session_id}/reuse", dependencies=[requires_role(CLINICIAN, SCIENTIST)])
def read_reuse(db: Db, parts: PartsDep, language: LanguageDep, session_id: int) -> dict[str, Any]:
    """The session's decision (null: none yet, nothing is taken over), and its options."""
    return _reuse(records.get(db, session_id), language)


@router.put("/sessions/{session_id}/reuse")
def decide(
    db: Db, parts: PartsDep, language: LanguageDep, session_id: int, new: Decision
) -> dict[str, Any]:
    """Decide what the session takes over; its results are computed again with it, the old ones stay stored."""
    session = records.get(db, session_id)
    closed = [f for f in session.recordings if f.sha256]
    before = [
        r for f in closed for r in results.current(f) if r.method in self_calibrations.USED_BY
    ]
    self_calibrations.decide(db, session, new.parts, new.self_calibration)
    recomputations = [
        pair
        for f in closed
        for pair in recomputed(db, parts, f, [r for r in before if r.recording_id == f.id])
    ]
    return {**_reuse(session, language), "results": recomputations}


def row(c: SelfCalibration, language: Language) -> dict[str, Any]:
    """A self-calibration as plain data, its tables in the words of a language."""
    visit = c.recording.session
    return {
        "id": c.id,
        "hand": c.hand,
        "glove": c.glove,
        "session": visit.id,
        "recording": c.recording_id,
        "recorded": visit.started,
        "onset": c.onset,
        "kept": c.stored,
        "withdrawn": c.withdrawn,
        "version": c.version,
        "tables": describe(c.found, c.messages, language),
    }


def offer_row(offer: Offer, language: Language) -> dict[str, Any]:
    """A self-calibration that a session may take over, with the parts that it may take."""
    return {
        **row(offer.self_calibration, language),
        "parts": offer.parts,
        "barred": language.translate(offer.barred),
    }


def _reuse(session: PatientSession, language: Language) -> dict[str, Any]:
    """The decision of a session (None: none yet) and the self-calibrations that are offered to it."""
    decided = self_calibrations.decision(session)
    return {
        "decided": None
        if decided is None
        else {
            "parts": decided.parts,
            "self_calibration": decided.self_calibration_id,
            "made": decided.made,
        },
        "offers": [offer_row(o, language) for o in self_calibrations.offers(session)],
    }
