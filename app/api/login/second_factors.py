"""/api/me/second-factors: the own second factors; each change asks for the password again"""

from typing import Any

from fastapi import APIRouter, Request, Response
from pydantic import Field

from handscope.app.auth import passkeys
from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import EVERY_ACCOUNT, RequesterDep, address_of, requires_role
from handscope.app.state import Db, PartsDep
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.clinic import accounts, second_factors
from handscope.sessions.db.tables import Account
from handscope.sessions.login import logins

router = APIRouter(prefix="/me", tags=["accounts"], dependencies=[requires_role(*EVERY_ACCOUNT)])
EXPIRED = phrase("login.passkey_too_late")
PASSWORD_FIRST = phrase("login.password_first")


class Confirmed(Incoming):
    """The password again, before second factors change."""

    password: str = Field(max_length=accounts.LONGEST, description="of the own account")


class NewFactor(Confirmed):
    """A second factor to be added, with its name."""

    name: str = Field(max_length=200, description="what its owner calls it")


class AppCode(Incoming):
    """The first code of an authenticator app."""

    code: str = Field(max_length=40, description="that the app shows")


class MadePasskey(Incoming):
    """A passkey as the browser made it."""

    ticket: str = Field(max_length=64)
    name: str = Field(max_length=200)
    credential: dict[str, Any] = Field(description="what the browser answered")


@router.get("/second-factors")
def list_factors(db: Db, parts: PartsDep, who: RequesterDep, request: Request) -> dict[str, Any]:
    """What the account has, how many recovery codes are left, and whether one is required."""
    account = accounts.get(db, who.account)
    required = not set(parts.settings.second_factor).isdisjoint(account.roles)
    return {
        "factors": second_factors.describe(second_factors.of_account(db, account)),
        "recovery_codes": second_factors.count_recovery_codes(db, account),
        "required": required and second_factors.may_have_one(account),
        "passkeys": bool(passkeys.host_of(request)),
    }


@router.post("/second-factors/totp", status_code=201)
def begin_totp(db: Db, who: RequesterDep, request: Request, new: NewFactor) -> dict[str, str]:
    """An authenticator for an app: its secret, and the QR code as a picture's address. It counts once confirmed."""
    account = _with_password(db, who.account, new.password, request)
    factor, address = second_factors.begin_totp(db, account, new.name)
    return {"secret": factor.secret, "picture": _qr_code(address)}


@router.post("/second-factors/totp/confirmation")
def confirm_totp(
    db: Db, who: RequesterDep, request: Request, given: AppCode
) -> dict[str, list[str]]:
    """Take the authenticator into use by a code that it shows; gives recovery codes where there are none."""
    account = accounts.get(db, who.account)
    with logins.counting_second(db, account, address_of(request)) as accept:
        codes = second_factors.confirm_totp(db, account, given.code)
        accept()
    return {"recovery_codes": codes}


@router.post("/second-factors/passkey", status_code=201)
def begin_passkey(
    db: Db, parts: PartsDep, who: RequesterDep, request: Request, new: Confirmed
) -> dict[str, Any]:
    """What the browser is to ask for a new passkey."""
    account = _with_password(db, who.account, new.password, request)
    present = second_factors.passkeys(db, account, passkeys.host_of(request))
    asked = passkeys.ask_to_register(request, account, present)
    return {"ticket": parts.pending_logins.add(account.id, asked), "options": asked.options}


@router.post("/second-factors/passkey/confirmation")
def confirm_passkey(
    db: Db, parts: PartsDep, who: RequesterDep, made: MadePasskey
) -> dict[str, list[str]]:
    """Keep the passkey that the browser made; gives recovery codes where there are none."""
    pending = parts.pending_logins.get(made.ticket)
    parts.pending_logins.end(made.ticket)
    if pending is None or pending.asked is None or pending.account != who.account:
        raise InputError(EXPIRED)
    found = passkeys.verify_registration(pending.asked, made.credential)
    codes = second_factors.add_passkey(
        db,
        accounts.get(db, who.account),
        made.name,
        found.credential,
        found.key,
        found.counter,
        pending.asked.host,
    )
    return {"recovery_codes": codes}


@router.post("/second-factors/{factor_id}/removal", status_code=204)
def remove_factor(
    db: Db, who: RequesterDep, request: Request, factor_id: int, given: Confirmed
) -> Response:
    """Take one out of use."""
    account = _with_password(db, who.account, given.password, request)
    second_factors.remove(db, account, factor_id)
    return Response(status_code=204)


@router.post("/recovery-codes", status_code=201)
def renew_codes(
    db: Db, who: RequesterDep, request: Request, given: Confirmed
) -> dict[str, list[str]]:
    """Ten new recovery codes; the earlier ones count no longer."""
    account = _with_password(db, who.account, given.password, request)
    if not second_factors.of_account(db, account):
        raise InputError("api.recovery_without_factor")
    return {"recovery_codes": second_factors.new_recovery_codes(db, account)}


def _with_password(db: Db, account_id: int, password: str, request: Request) -> Account:
    """The account, whose password was typed again: nobody changes it on a screen that was left open."""
    account = accounts.get(db, account_id)
    if not second_factors.may_have_one(account):
        raise InputError(second_factors.NONE_HERE)
    if account.password is None:
        raise InputError(PASSWORD_FIRST)
    if logins.log_in(db, account.name, password, address_of(request)) is None:
        raise InputError("api.password_wrong")
    return account


def _qr_code(address: str) -> str:
    try:
        import segno
    except ImportError:
        raise InputError(second_factors.MISSING) from None
    return str(segno.make(address, micro=False).svg_data_uri(scale=5, light="white"))
