"""/login and /api/login: a one-time token in the address, or typed, or a name with its password, becomes a cookie"""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from pydantic import Field
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from starlette.responses import JSONResponse, RedirectResponse

from handscope.app.auth import passkeys
from handscope.app.auth.gate import cookie_name, cookie_of
from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import ANYBODY, EVERY_ACCOUNT, address_of, requires_role
from handscope.app.auth.security_headers import is_over_tls
from handscope.app.page_files.document import document
from handscope.app.state import Db, PartsDep
from handscope.app.version import software_version
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.clinic import accounts, second_factors
from handscope.sessions.db.tables import Account, now
from handscope.sessions.login import logins
from handscope.sessions.store import shared_servers
from handscope.sessions.store.database import require_writable

router = APIRouter(tags=["login"], dependencies=[requires_role(ANYBODY)])
EXPIRED = phrase("login.too_late")
HEALTH_WAIT = 1.0  # s: a change of the server itself is over by then
pages = APIRouter(include_in_schema=False, dependencies=[requires_role(ANYBODY)])


class Proof(Incoming):
    """What proves an account: a one-time token, or a name with its password."""

    token: str = Field("", max_length=200, description="a one-time token; or")
    name: str = Field("", max_length=64, description="an account, with its")
    password: str = Field("", max_length=accounts.LONGEST)


class Ticket(Incoming):
    """A login that waits for its second factor."""

    ticket: str = Field(max_length=64, description="as the first step of the login gave it")


class SecondProof(Ticket):
    """The second factor of a login: a code or a passkey's answer."""

    code: str = Field("", max_length=40, description="of an app, or a recovery code; or")
    credential: dict[str, Any] | None = Field(None, description="what a passkey answered")


@pages.get("/login")
def login_page(
    parts: PartsDep, db: Db, request: Request, token: Annotated[str, Query(max_length=200)] = ""
) -> Response:
    """Log in with a valid token; otherwise the page that asks for one."""
    account = logins.log_in_by_code(db, parts.store, token, address_of(request)) if token else None
    if account is None:
        return document("login/index.html", request.headers, status=401 if token else 200)
    if second_factors.needs_one(db, account):
        ticket = parts.pending_logins.add(account.id)
        return RedirectResponse(f"/login#second={ticket}", 303)  # what follows # is in no log
    cookie = logins.begin(db, account, cookie_of(request))
    return with_cookie(RedirectResponse("/", 303), request, cookie)


@router.get("/login")
def login_options(db: Db, parts: PartsDep) -> dict[str, Any]:
    """Options of the login page: passwords where an account has one, single sign-on where configured."""
    return {"passwords": accounts.has_passwords(db), "single": parts.settings.sign_on is not None}


@router.post(
    "/login",
    status_code=204,
    responses={202: {"description": "right; `ticket` waits for a second factor"}},
)
def log_in(parts: PartsDep, db: Db, request: Request, given: Proof) -> Response:
    """Log in by token or password; sets the cookie, or asks for the second factor."""
    if given.name:
        account = logins.log_in(db, given.name, given.password, address_of(request))
        if account is None:
            raise InputError("api.login_refused")
    else:
        code = given.token.strip()
        account = logins.log_in_by_code(db, parts.store, code, address_of(request))
        if account is None:
            raise InputError("api.code_refused")
    if second_factors.needs_one(db, account):
        return JSONResponse({"ticket": parts.pending_logins.add(account.id)}, 202)
    cookie = logins.begin(db, account, cookie_of(request))
    return with_cookie(Response(status_code=204), request, cookie)


@router.post("/login/second-factors")
def ask_for_second(parts: PartsDep, db: Db, request: Request, given: Ticket) -> dict[str, Any]:
    """What the account may prove itself with: codes (of an app, or recovery codes), and `passkey`, what the browser is to ask for one."""
    account = _waiting(db, parts, given.ticket)
    present = second_factors.passkeys(db, account, passkeys.host_of(request))
    if not present:
        return {"ticket": given.ticket, "passkey": None}
    asked = passkeys.ask_to_prove(request, present)
    parts.pending_logins.end(given.ticket)
    return {"ticket": parts.pending_logins.add(account.id, asked), "passkey": asked.options}


@router.post("/login/second", status_code=204)
def prove_second(parts: PartsDep, db: Db, request: Request, given: SecondProof) -> Response:
    """The second factor of a login: a code, or a passkey's answer."""
    account = _waiting(db, parts, given.ticket)
    with logins.counting_second(db, account, address_of(request)) as accept:
        if given.credential is not None:
            pending = parts.pending_logins.get(given.ticket)
            if pending is None or pending.asked is None:
                raise InputError(EXPIRED)
            present = second_factors.passkeys(db, account, pending.asked.host)
            passkeys.verify(pending.asked, given.credential, present).used = now()
        elif not second_factors.accept_code(db, account, given.code):
            raise InputError(second_factors.WRONG)
        accept()
    parts.pending_logins.end(given.ticket)
    cookie = logins.begin(db, account, cookie_of(request))
    return with_cookie(Response(status_code=204), request, cookie)


def _waiting(db: Db, parts: PartsDep, ticket: str) -> Account:
    """Whose login waits for its second factor."""
    pending = parts.pending_logins.get(ticket)
    account = db.get(Account, pending.account) if pending else None
    if account is None or account.disabled:
        raise InputError(EXPIRED)
    return account


@router.delete(
    "/login",
    status_code=204,
    responses={
        200: {"description": "ended; the page named by `next` ends the organisation's login"}
    },
)
def log_out(db: Db, parts: PartsDep, request: Request) -> Response:
    """`next` is the address that the browser opens afterwards, after a single sign-on; else the login page."""
    account = logins.end(db, cookie_of(request))
    single = (
        account is not None and account.subject is not None and parts.settings.sign_on is not None
    )
    response = JSONResponse({"next": "/login/sso/end"}) if single else Response(status_code=204)
    response.delete_cookie(
        cookie_name(request.scope),
        path="/",
        secure=is_over_tls(request.scope),
        httponly=True,
        samesite="strict",
    )
    return response


@router.get("/health")
def health(parts: PartsDep, response: Response) -> dict[str, Any]:
    """For monitoring: 503 where the server cannot work. It still records without its object storage, so that is only reported."""
    status = "ok"
    try:
        with parts.store.database() as db:
            require_writable(db, HEALTH_WAIT)
    except (DBAPIError, PoolTimeout):
        response.status_code, status = 503, "the database is locked or does not answer"
    payload: dict[str, Any] = {"status": status, "version": software_version()}
    if parts.storage_mover:
        latest = parts.storage_mover.latest
        payload["object_storage"] = {
            "status": "cannot be used" if latest.problem else "ok",
            "files_waiting": latest.waiting,
        }
    if parts.store.server and status == "ok":
        with parts.store.database() as db:
            others = shared_servers.list_others(db, parts.store.server)
        payload["other_servers"] = {"answer": sum(o.answers for o in others), "all": len(others)}
    return payload


@router.get("/openapi.json", include_in_schema=False, dependencies=[requires_role(*EVERY_ACCOUNT)])
def openapi(request: Request) -> dict[str, Any]:
    """The OpenAPI description of the API."""
    schema: dict[str, Any] = request.app.openapi()
    return schema


def with_cookie(response: Response, request: Request, cookie: str) -> Response:
    """The response with a login cookie: hidden from scripts, not sent by other sites' pages, TLS only behind TLS."""
    response.set_cookie(
        cookie_name(request.scope),
        cookie,
        httponly=True,
        samesite="strict",
        secure=is_over_tls(request.scope),
        path="/",
    )
    return response
