"""/login and /api/login: a one-time token in the address, or typed, or a name with its password, becomes a cookie"""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from pydantic import BaseModel, ConfigDict, Field
from sqlalchemy import select
from sqlalchemy.exc import DBAPIError
from starlette.responses import FileResponse, JSONResponse, RedirectResponse

from handscope.app.api.pages import STATIC
from handscope.app.auth.gate import cookie_name, cookie_of, secure
from handscope.app.auth.roles import ANYBODY, EVERY_ACCOUNT, address_of, may
from handscope.app.state import Db, PartsDep
from handscope.app.version import software_version
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import accounts, audit
from handscope.sessions.clinic.audit import Happened
from handscope.sessions.store import logins

router = APIRouter(tags=["login"], dependencies=[may(ANYBODY)])
pages = APIRouter(include_in_schema=False, dependencies=[may(ANYBODY)])


class Proof(BaseModel):
    model_config = ConfigDict(extra="forbid")

    token: str = Field("", max_length=200, description="a one-time token; or")
    name: str = Field("", max_length=64, description="an account, with its")
    password: str = Field("", max_length=accounts.LONGEST)


@pages.get("/login")
def login_page(
    parts: PartsDep, db: Db, request: Request, token: Annotated[str, Query(max_length=200)] = ""
) -> Response:
    """With a good token: in. Otherwise the page that asks for one."""
    account = logins.redeem(db, parts.store, token) if token else None
    if account is None:
        _refused(db, token)
        return FileResponse(STATIC / "login" / "index.html", status_code=401 if token else 200)
    return with_cookie(RedirectResponse("/", 303), request, logins.begin(db, account))


@router.get("/login")
def ways_in(db: Db, parts: PartsDep) -> dict[str, Any]:
    """What the login page offers: passwords where an account has one, the organisation's login where one is named."""
    return {"passwords": accounts.with_passwords(db), "single": parts.settings.sign_on is not None}


@router.post("/login", status_code=204)
def log_in(parts: PartsDep, db: Db, request: Request, given: Proof) -> Response:
    if given.name:
        account = logins.by_password(db, given.name, given.password, address_of(request))
        if account is None:
            raise InputError(
                "the name or the password is not right; after five tries the account is closed for a quarter of an hour"
            )
    else:
        account = logins.redeem(db, parts.store, given.token.strip())
        if account is None:
            _refused(db, given.token)
            raise InputError(
                "this code was used before or is not right; print a new one with: handscope login"
            )
    return with_cookie(Response(status_code=204), request, logins.begin(db, account))


@router.delete(
    "/login",
    status_code=204,
    responses={
        200: {"description": "ended; the page named by `next` ends the organisation's login"}
    },
)
def log_out(db: Db, parts: PartsDep, request: Request) -> Response:
    """`next` is where the browser goes then, where that is not our login page: whom the organisation let in, it would let in again."""
    account = logins.end(db, cookie_of(request))
    single = (
        account is not None and account.subject is not None and parts.settings.sign_on is not None
    )
    response = JSONResponse({"next": "/login/sso/end"}) if single else Response(status_code=204)
    response.delete_cookie(
        cookie_name(request.scope),
        path="/",
        secure=secure(request.scope),
        httponly=True,
        samesite="strict",
    )
    return response


def _refused(db: Db, token: str) -> None:
    if token:
        audit.tell(db, Happened("refused", "login", counts={"by": "code"}))
        db.commit()


@router.get("/health")
def health(parts: PartsDep, response: Response) -> dict[str, Any]:
    """For whoever watches over the server: 503 where it cannot work. Without its object storage it records on: that is told, a restart would not mend it."""
    status = "ok"
    try:
        with parts.store.database() as db:
            db.execute(select(1))
    except DBAPIError:
        response.status_code, status = 503, "the database does not answer"
    told: dict[str, Any] = {"status": status, "version": software_version()}
    if parts.moving_out:
        latest = parts.moving_out.latest
        told["object_storage"] = {
            "status": "cannot be used" if latest.problem else "ok",
            "files_waiting": latest.waiting,
        }
    return told


@router.get("/openapi.json", include_in_schema=False, dependencies=[may(*EVERY_ACCOUNT)])
def openapi(request: Request) -> dict[str, Any]:
    found: dict[str, Any] = request.app.openapi()
    return found


def with_cookie(response: Response, request: Request, cookie: str) -> Response:
    """Scripts cannot read it, other sites' pages cannot send it, and behind TLS it never travels without."""
    response.set_cookie(
        cookie_name(request.scope),
        cookie,
        httponly=True,
        samesite="strict",
        secure=secure(request.scope),
        path="/",
    )
    return response
