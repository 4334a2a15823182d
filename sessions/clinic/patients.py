"""Patients under pseudonyms: make, find, change. No names, no dates of birth."""

from typing import Any, TypeVarTuple

from sqlalchemy import Select, func, select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session
from sqlalchemy.orm.exc import StaleDataError

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import HANDS
from handscope.estimators.hand.geometry import measures_from
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.clinic import trunk_height
from handscope.sessions.clinic.pseudonyms import require_code
from handscope.sessions.db.conflicts import ConflictError, require_seen
from handscope.sessions.db.plain_text import require_plain
from handscope.sessions.db.tables import Note, Patient, PatientSession, now

Rows = TypeVarTuple("Rows")
LONGEST_PSEUDONYM = 64
FIRST_YEAR = 1900  # of birth
CHANGEABLE = (
    "pseudonym",
    "ward_id",
    "year_of_birth",
    "dominant_hand",
    "affected_hand",
    "hand_measures",
    "trunk_height",
    "archived",
)


def create(
    db: Session, pseudonym: str, note: str = "", confirmed: bool = False, **facts: Any
) -> Patient:
    """Keep a new patient, with a first note where one is given; InputError where the pseudonym is empty, taken or, not confirmed, may be a name."""
    taken = db.scalar(select(Patient.id).where(Patient.pseudonym == " ".join(pseudonym.split())))
    require_code(pseudonym, confirmed or taken is not None)
    patient = Patient(
        pseudonym=pseudonym, notes=[Note(text=note.strip())] if note.strip() else [], **facts
    )
    _check(patient)
    db.add(patient)
    try:
        db.commit()
    except IntegrityError:
        db.rollback()
        raise InputError("clinic.patient_exists", code=patient.pseudonym) from None
    return patient


def find(
    db: Session, search: str = "", archived: bool = False, limit: int = 200, offset: int = 0
) -> list[tuple[Patient, int, Any]]:
    """Patients whose pseudonym contains the search words, the newest first, with how many sessions they have and when the last one was."""
    query = (
        _matching(
            select(Patient, func.count(PatientSession.id), func.max(PatientSession.started)),
            search,
            archived,
        )
        .outerjoin(PatientSession)
        .group_by(Patient.id)
        .order_by(
            func.coalesce(func.max(PatientSession.started), Patient.created).desc(),
            Patient.id.desc(),
        )
        .limit(limit)
        .offset(offset)
    )
    return [(patient, int(count), last) for patient, count, last in db.execute(query)]


def count(db: Session, search: str = "", archived: bool = False) -> int:
    """How many patients `find` would give without a limit."""
    return db.scalar(_matching(select(func.count(Patient.id)), search, archived)) or 0


def _matching(query: Select[*Rows], search: str, archived: bool) -> Select[*Rows]:
    query = query.where(Patient.archived.is_(archived))
    for word in search.split():
        query = query.where(Patient.pseudonym.icontains(word, autoescape=True))
    return query


def get(db: Session, patient_id: int) -> Patient:
    """The patient; InputError where there is none."""
    patient = db.get(Patient, patient_id)
    if patient is None:
        raise InputError("clinic.patient_unknown", number=patient_id)
    return patient


def change(
    db: Session, patient_id: int, version: int, confirmed: bool = False, **facts: Any
) -> Patient:
    """Change facts of a patient as it stood at `version`; ConflictError where somebody else changed it meanwhile."""
    patient = get(db, patient_id)
    changed = phrase("conflict.patient_by_code", code=patient.pseudonym)
    require_seen(changed, patient.version, version)
    unknown = set(facts) - set(CHANGEABLE)
    if unknown:
        raise InputError("clinic.patient_field_unknown", what=sorted(unknown)[0])
    if facts.get("pseudonym", patient.pseudonym) != patient.pseudonym:
        require_code(facts["pseudonym"] or "", confirmed)
    for name, value in facts.items():
        setattr(patient, name, value)
    try:
        _check(patient)
        db.commit()
    except IntegrityError:
        db.rollback()
        raise InputError("clinic.patient_exists", code=str(facts.get("pseudonym"))) from None
    except StaleDataError:
        db.rollback()
        raise ConflictError(phrase("conflict.patient")) from None
    return patient


def _check(patient: Patient) -> None:
    require_plain(patient.pseudonym or "", "the pseudonym", one_line=True)
    patient.pseudonym = " ".join((patient.pseudonym or "").split())
    if not 1 <= len(patient.pseudonym) <= LONGEST_PSEUDONYM:
        raise InputError("clinic.pseudonym_length", longest_pseudonym=LONGEST_PSEUDONYM)
    if patient.dominant_hand not in (None, *HANDS):
        raise InputError("clinic.hand_side", what=phrase("clinic.dominant_hand"))
    if patient.affected_hand not in (None, *HANDS, "both"):
        raise InputError("clinic.hand_side", what=phrase("clinic.affected_hand"))
    year, this = patient.year_of_birth, now().year
    if year is not None and not FIRST_YEAR <= year <= this:
        raise InputError("clinic.birth_year_outside", year=year, first=FIRST_YEAR, last=this)
    if patient.trunk_height is not None:
        trunk_height.require_height(patient.trunk_height)
    for hand, measures in (patient.hand_measures or {}).items():
        if hand not in HANDS:
            raise InputError("clinic.hand_measures_side", hand=hand)
        measures_from(measures)
