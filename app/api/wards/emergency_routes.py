"""/api/emergency-accesses: a patient of another ward, opened with a reason for some hours"""

from fastapi import APIRouter, Response
from pydantic import Field

from handscope.app.api.answers import EmergencyRow, answers
from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import ADMINISTRATOR, CLINICIAN, RequesterDep, requires_role
from handscope.app.state import Db
from handscope.sessions.db.tables import EmergencyAccess, now
from handscope.sessions.wards import emergency_access
from handscope.sessions.wards.access_deadlines import lasts

router = APIRouter(
    prefix="/emergency-accesses", tags=["wards"], dependencies=[requires_role(CLINICIAN)]
)


class NewEmergencyAccess(Incoming):
    """Whose data are needed, and why."""

    pseudonym: str = Field(max_length=200, description="the patient's code, typed as it is stored")
    reason: str = Field(
        max_length=2 * emergency_access.LONGEST,
        description="why; shown on the patient's page and to the head of the patient's ward",
    )


@router.post("", status_code=201, responses=answers(EmergencyRow, 201))
def open_patient(db: Db, requester: RequesterDep, new: NewEmergencyAccess) -> EmergencyRow:
    """Open a patient of another ward by the code; audited, shown to the ward, ends by itself."""
    made = emergency_access.open_patient(
        db, requester.account, requester.visibility, new.pseudonym, new.reason
    )
    return {**emergency_row(made), "by": requester.name}


@router.get(
    "",
    dependencies=[requires_role(CLINICIAN, ADMINISTRATOR)],
    responses=answers(list[EmergencyRow]),
)
def list_accesses(db: Db, requester: RequesterDep, own: bool = False) -> list[EmergencyRow]:
    """Of the last 90 days, the newest first: to an administrator of the whole house all, to a head those of the wards; `own`: the account's, while they last.

    Accounts without the clinician's role get neither codes nor reasons.
    """
    if own:
        return [emergency_row(a) for a in emergency_access.list_own(db, requester.account)]
    everything = requester.is_of_house and ADMINISTRATOR in requester.roles
    wards = None if everything else requester.heads
    rows = [emergency_row(a) for a in emergency_access.list_for_heads(db, wards, now())]
    return rows if requester.sees_all else [{**row, "pseudonym": "", "reason": ""} for row in rows]


@router.delete("/{access_id}", status_code=204)
def end_access(db: Db, requester: RequesterDep, access_id: int) -> Response:
    """End one's own emergency access before its time."""
    emergency_access.end(db, access_id, requester.account)
    return Response(status_code=204)


def emergency_row(access: EmergencyAccess) -> EmergencyRow:
    """An emergency access as the API shows it."""
    return {
        "id": access.id,
        "patient": access.patient_id,
        "pseudonym": access.patient.pseudonym,
        "by": access.account.name,
        "reason": access.reason,
        "begun": access.begun,
        "ends": access.ends,
        "lasts": lasts(access),
    }
