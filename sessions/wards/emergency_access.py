"""Emergency access ("break the glass"): a clinician opens a patient of another ward by the code, with a reason, for some hours.

Its end does not depend on the wall clock alone, which may be set back: access_deadlines.py.
The reason lies with the patient, and is erased with the patient. The audit trail, which holds no text, has who opened
which patient until when, and the reason's SHA-256: a reason that was changed afterwards is found.
"""

import hashlib
from collections.abc import Collection, Sequence
from datetime import datetime, timedelta

from sqlalchemy import select
from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.sessions.clinic import audit
from handscope.sessions.db.plain_text import require_plain
from handscope.sessions.db.tables import EmergencyAccess, Patient, now
from handscope.sessions.db.visible_rows import Visibility, unrestricted
from handscope.sessions.wards.access_deadlines import deadlines_of

LASTS = timedelta(hours=4)
SHORTEST, LONGEST = 10, 1000  # characters of a reason
SHOWN = timedelta(days=90)  # how long a head of ward sees an access listed
KIND = "emergency_access"


def open_patient(
    db: Session, account_id: int, visibility: Visibility | None, pseudonym: str, reason: str
) -> EmergencyAccess:
    """Let the account see the patient with this code for LASTS; InputError where there is none, or where it is already visible to the account."""
    reason = _checked_reason(reason)
    code = " ".join(pseudonym.split())
    with unrestricted(db):
        found = db.scalar(select(Patient).where(Patient.pseudonym == code))
    if found is None:
        audit.record(db, audit.AuditEvent("refused", KIND))
        db.commit()
        raise InputError("wards.no_such_code", code=code)
    if visibility is None or visibility.covers(found.ward_id, found.id):
        raise InputError("wards.seen_anyway", code=code)
    moment = now()
    access = EmergencyAccess(patient=found, account_id=account_id, reason=reason, begun=moment)
    access.ends = moment + LASTS
    db.add(access)
    db.flush()
    counts = {"until": access.ends.isoformat(), "reason_sha256": sum_of(reason)}
    event = audit.AuditEvent("created", KIND, str(access.id), found.id, counts)
    audit.record(db, event)
    db.commit()
    deadlines_of(db).start_countdown(access)
    return access


def end(db: Session, access_id: int, account_id: int) -> None:
    """End one's own access before its time; InputError where it is none of the account's."""
    with unrestricted(db):
        access = db.get(EmergencyAccess, access_id)
        if access is None or access.account_id != account_id:
            raise InputError("wards.no_such_access", number=access_id)
        access.ends = min(access.ends, now())
        deadlines_of(db).end(access)
        event = audit.AuditEvent(
            "changed", KIND, str(access.id), access.patient_id, {"fields": ["ends"]}
        )
        audit.record(db, event)
        db.commit()


def patients_open_to(db: Session, account_id: int) -> frozenset[int]:
    """Patients whom the account sees at present through an emergency access."""
    with unrestricted(db):
        return frozenset(access.patient_id for access in list_own(db, account_id))


def list_for_heads(
    db: Session, wards: Collection[int] | None, moment: datetime
) -> Sequence[EmergencyAccess]:
    """Accesses of the last SHOWN to patients of these wards (None: of all), the newest first."""
    query = (
        select(EmergencyAccess)
        .join(Patient)
        .where(EmergencyAccess.begun > moment - SHOWN)
        .order_by(EmergencyAccess.id.desc())
    )
    return db.scalars(query if wards is None else query.where(Patient.ward_id.in_(wards))).all()


def list_own(db: Session, account_id: int) -> Sequence[EmergencyAccess]:
    """The account's accesses that last still, the newest first."""
    query = select(EmergencyAccess).where(
        EmergencyAccess.account_id == account_id, EmergencyAccess.ends > now()
    )
    found = db.scalars(query.order_by(EmergencyAccess.id.desc())).all()
    return [access for access in found if deadlines_of(db).lasts(access)]


def sum_of(reason: str) -> str:
    """The reason's SHA-256, as the audit trail has it."""
    return hashlib.sha256(reason.encode()).hexdigest()


def _checked_reason(reason: str) -> str:
    require_plain(reason, "the reason")
    reason = reason.strip()
    if not SHORTEST <= len(reason) <= LONGEST:
        raise InputError("wards.reason_length", least=SHORTEST, most=LONGEST)
    return reason
