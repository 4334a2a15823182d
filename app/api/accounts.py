"""/api/accounts: who may log in, for administrators; /api/me: the own account; /api/audit: the audit trail"""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from pydantic import Field

from handscope.app.api.answers import AccountRow, answers
from handscope.app.api.wards.ward_routes import require_house
from handscope.app.auth.gate import cookie_of
from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import (
    ADMINISTRATOR,
    EVERY_ACCOUNT,
    RequesterDep,
    address_of,
    requires_role,
)
from handscope.app.state import Db, LanguageDep, PartsDep
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.clinic import accounts, audit, second_factors
from handscope.sessions.clinic.accounts import LOCAL
from handscope.sessions.db.roles import ROLES
from handscope.sessions.db.tables import HOUSE, Account, AuditLine
from handscope.sessions.login import logins
from handscope.sessions.wards import account_changes, wards

UNGUARDED = phrase("audit.no_triggers")
router = APIRouter(tags=["accounts"], dependencies=[requires_role(ADMINISTRATOR)])
own = APIRouter(tags=["accounts"], dependencies=[requires_role(*EVERY_ACCOUNT)])
MOST_WARDS = 200
WARDS = "numbers of the wards whose patients the account sees; 1 is the whole house"
MOST = 200  # lines of the audit trail in one answer


class NewAccount(Incoming):
    """A new account: its name and its roles."""

    name: str = Field(max_length=64)
    roles: list[str] = Field(max_length=len(ROLES), description=", ".join(ROLES))
    wards: list[int] | None = Field(None, max_length=MOST_WARDS, description=WARDS)


class AccountChange(Incoming):
    """What an administrator may change of an account; `version` is that which was read."""

    version: int = Field(
        description="the version that was seen; somebody else's change meanwhile is refused"
    )
    roles: list[str] | None = Field(None, max_length=len(ROLES))
    disabled: bool | None = None
    wards: list[int] | None = Field(None, max_length=MOST_WARDS, description=WARDS)
    heads: list[int] | None = Field(
        None, max_length=MOST_WARDS, description="wards among these that the account heads"
    )


class NewPassword(Incoming):
    """A new password, with the current one as proof."""

    current: str = Field(
        "", max_length=accounts.LONGEST, description="the password until now, where there is one"
    )
    password: str = Field(max_length=4 * accounts.LONGEST)


@router.get("/accounts", responses=answers(list[AccountRow]))
def list_accounts(db: Db, who: RequesterDep) -> list[dict[str, Any]]:
    """Every account, and whether it has a second factor; to an administrator of wards those of the wards."""
    proved = second_factors.accounts_with_one(db)
    return [
        {**account_row(account), "second": account.id in proved}
        for account in wards.known_accounts(db, who.visibility)
    ]


@router.post("/accounts", status_code=201, responses=answers(AccountRow, 201))
def add_account(db: Db, parts: PartsDep, who: RequesterDep, new: NewAccount) -> dict[str, Any]:
    """A new account, with a one-time code by which its owner logs in and sets a password."""
    require_house(who)
    for ward in new.wards or ():
        wards.get(db, ward)
    account = accounts.add(db, new.name, new.roles)
    if new.wards is not None:
        wards.assign(db, account, new.wards)
    return {**account_row(account), "code": logins.new_token(parts.store.folder, account.name)}


@router.patch("/accounts/{account_id}", responses=answers(AccountRow))
def change_account(db: Db, who: RequesterDep, account_id: int, change: AccountChange) -> Any:
    """Other roles or wards, in or out of use; nobody locks himself out, and nobody overwrites another's change unseen (409)."""
    require_house(who)
    account = accounts.get(db, account_id)
    if account.id == who.account and (
        change.disabled
        or (change.roles is not None and ADMINISTRATOR not in change.roles)
        or (change.wards is not None and HOUSE not in change.wards)
    ):
        raise InputError("api.own_account")
    facts = account_changes.AccountChange(**change.model_dump(exclude={"version"}))
    account_changes.change(db, account, change.version, facts)
    if account.disabled:
        logins.end_all(db, account)
    return account_row(account)


@router.post("/accounts/{account_id}/code", status_code=201)
def make_code(db: Db, parts: PartsDep, who: RequesterDep, account_id: int) -> dict[str, str]:
    """A one-time code: it logs in as this account, once, within 15 minutes."""
    require_house(who)
    account = accounts.get(db, account_id)
    if account.name == LOCAL or account.disabled:
        raise InputError("api.code_not_given_here")
    audit.record(db, audit.AuditEvent("created", "code", str(account.id)))
    db.commit()
    return {"code": logins.new_token(parts.store.folder, account.name)}


@router.delete("/accounts/{account_id}/second-factors", status_code=204)
def remove_second_factors(db: Db, who: RequesterDep, account_id: int) -> Response:
    """Take all second factors of an account out of use, where their owner lost them; its logins end."""
    require_house(who)
    account = accounts.get(db, account_id)
    second_factors.remove_all(db, account)
    logins.end_all(db, account)
    return Response(status_code=204)


@own.get("/me", responses=answers(AccountRow))
def read_me(db: Db, who: RequesterDep) -> dict[str, Any]:
    """The own account, and whether a second factor is still required."""
    row = account_row(accounts.get(db, who.account))
    return {**row, "lacks_second_factor": who.lacks_second_factor}


@own.put("/me/password", status_code=204)
def set_password(db: Db, who: RequesterDep, request: Request, new: NewPassword) -> Response:
    """Set the own password; every other login of the account ends."""
    account = accounts.get(db, who.account)
    if account.name == LOCAL or account.subject is not None:
        raise InputError("api.account_without_password")
    if (
        account.password is not None
        and logins.log_in(db, account.name, new.current, address_of(request)) is None
    ):
        raise InputError("api.old_password_wrong")
    accounts.set_password(db, account, new.password)
    logins.end_all(db, account, but=cookie_of(request))
    return Response(status_code=204)


@router.get("/audit")
def read_audit(
    db: Db,
    requester: RequesterDep,
    response: Response,
    who: Annotated[str, Query(max_length=64)] = "",
    what: Annotated[str, Query(max_length=64)] = "",
    patient: int | None = None,
    before: Annotated[int | None, Query(description="a line's number, to go on from there")] = None,
    limit: Annotated[int, Query(ge=1, le=MOST)] = 100,
) -> list[dict[str, Any]]:
    """Lines of the audit trail, the newest first; to an administrator of wards those about their patients and of their accounts; the header X-Total-Count says how many there are."""
    within = wards.audited_within(db, requester.visibility)
    response.headers["X-Total-Count"] = str(audit.count_lines(db, who, what, patient, within))
    lines = audit.list_lines(db, who, what, patient, before, limit, within)
    return [audit_row(line) for line in lines]


@router.get("/audit/verification")
def verify_audit(db: Db, language: LanguageDep) -> dict[str, Any]:
    """Whether the chain holds from the first line to the last."""
    chain = audit.verify(db)
    gone = UNGUARDED if chain.unguarded else ""
    broken = language.translate(chain.broken or gone)
    return {"lines": chain.lines, "last": chain.last, "broken": broken}


def account_row(a: Account) -> AccountRow:
    """An account as the API shows it; nothing secret."""
    kind = (
        "code"
        if a.name == LOCAL
        else "single"
        if a.subject
        else "password"
        if a.password
        else "none"
    )
    return {
        "id": a.id,
        "name": a.name,
        "roles": a.roles,
        "disabled": a.disabled,
        "created": a.created,
        "wards": [{"ward": m.ward_id, "name": m.ward.name, "head": m.head} for m in a.memberships],
        "proof": kind,
        "local": a.name == LOCAL,
        "version": a.version,
    }


def audit_row(line: AuditLine) -> dict[str, Any]:
    """A line of the audit trail as the API shows it."""
    return {
        c.key: getattr(line, c.key)
        for c in AuditLine.__table__.columns
        if c.key not in ("previous", "hash")
    }
