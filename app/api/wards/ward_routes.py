"""/api/wards: parts of the hospital that patients and accounts belong to"""

from fastapi import APIRouter, Response
from pydantic import Field

from handscope.app.api.answers import WardRow, answers
from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import (
    ADMINISTRATOR,
    EVERY_ACCOUNT,
    Requester,
    RequesterDep,
    requires_role,
)
from handscope.app.state import Db
from handscope.estimators.errors import InputError
from handscope.sessions.db.tables import HOUSE, Ward
from handscope.sessions.wards import wards

router = APIRouter(prefix="/wards", tags=["wards"], dependencies=[requires_role(ADMINISTRATOR)])


class NamedWard(Incoming):
    """The name of a ward."""

    name: str = Field(max_length=200)


@router.get("", dependencies=[requires_role(*EVERY_ACCOUNT)], responses=answers(list[WardRow]))
def list_wards(db: Db, requester: RequesterDep) -> list[WardRow]:
    """All wards, the whole house first; `own` where the account belongs to it or to the whole house."""
    return [ward_row(w, requester) for w in wards.list_wards(db)]


@router.post("", status_code=201, responses=answers(WardRow, 201))
def add_ward(db: Db, requester: RequesterDep, new: NamedWard) -> WardRow:
    """A new ward, without patients and accounts."""
    require_house(requester)
    return ward_row(wards.add(db, new.name), requester)


@router.patch("/{ward_id}", responses=answers(WardRow))
def rename_ward(db: Db, requester: RequesterDep, ward_id: int, change: NamedWard) -> WardRow:
    """Another name of a ward."""
    require_house(requester)
    return ward_row(wards.rename(db, ward_id, change.name), requester)


@router.delete("/{ward_id}", status_code=204)
def remove_ward(db: Db, requester: RequesterDep, ward_id: int) -> Response:
    """Remove a ward that no patient belongs to; its accounts leave it."""
    require_house(requester)
    wards.remove(db, ward_id)
    return Response(status_code=204)


def require_house(requester: Requester) -> None:
    """InputError where the account does not belong to the whole house."""
    if not requester.is_of_house:
        raise InputError("wards.house_administrators")


def require_member(requester: Requester, ward: int) -> None:
    """InputError where the account sees this ward's patients by an emergency access alone."""
    if not requester.is_of_ward(ward):
        raise InputError("wards.members_only")


def ward_row(ward: Ward, requester: Requester) -> WardRow:
    """A ward as the API shows it."""
    own = requester.is_of_house or (ward.id != HOUSE and requester.is_of_ward(ward.id))
    return {"id": ward.id, "name": ward.name, "house": ward.id == HOUSE, "own": own}
