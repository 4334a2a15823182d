"""/login/sso: to the organisation's login and back"""

import logging
import secrets
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from starlette.responses import HTMLResponse, RedirectResponse

from handscope.app.api.login.login_routes import with_cookie
from handscope.app.auth.gate import cookie_of
from handscope.app.auth.oidc import (
    NAME,
    Answer,
    SignOn,
    SignOnError,
    authorization_address,
    logout_address,
    roles_of,
    subject_of,
    verify_identity,
)
from handscope.app.auth.roles import ANYBODY, requires_role
from handscope.app.auth.security_headers import is_over_tls
from handscope.app.state import Db, PartsDep
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import accounts, audit
from handscope.sessions.clinic.audit import AuditEvent
from handscope.sessions.login import logins

log = logging.getLogger(__name__)
router = APIRouter(include_in_schema=False, dependencies=[requires_role(ANYBODY)])
COOKIE, MINUTES = "handscope-sso", 10
IN = '<!doctype html><title>Handscope</title><meta http-equiv="refresh" content="0; url=/"><a href="/">Handscope</a>'


@router.get("/login/sso")
def redirect_to_provider(parts: PartsDep, request: Request) -> Response:
    """To the provider."""
    word = secrets.token_urlsafe(32)
    try:
        response = RedirectResponse(
            authorization_address(
                _require_configuration(parts.settings.sign_on),
                word,
                _ours(request, "/login/sso/answer"),
            ),
            303,
        )
    except SignOnError as problem:
        return _refuse(problem)
    response.set_cookie(
        COOKIE,
        word,
        max_age=60 * MINUTES,
        path="/login/sso",
        httponly=True,
        samesite="lax",
        secure=is_over_tls(request.scope),
    )  # lax: the provider's redirect back must send it
    return response


@router.get("/login/sso/answer")
def receive_answer(
    db: Db,
    parts: PartsDep,
    request: Request,
    state: Annotated[str, Query(max_length=200)] = "",
    code: Annotated[str, Query(max_length=4000)] = "",
    error: Annotated[str, Query(max_length=200)] = "",
    iss: Annotated[str, Query(max_length=400)] = "",
) -> Response:
    """From the provider. Our own page requests the next one, so that the strict cookie is sent."""
    agreed, given = (
        _require_configuration(parts.settings.sign_on),
        Answer(state=state, code=code, error=error, issuer=iss),
    )
    try:
        claims = verify_identity(
            agreed, request.cookies.get(COOKIE, ""), _ours(request, "/login/sso/answer"), given
        )
        name = str(claims.get(NAME) or claims["sub"])
        account = accounts.get_or_add_subject(
            db, subject_of(agreed, claims), name, roles_of(agreed, claims)
        )
    except InputError as problem:
        kind = problem.kind if isinstance(problem, SignOnError) else "refused"
        audit.record(
            db, AuditEvent("refused", "login", counts={"by": "single sign-on", "why": kind})
        )
        db.commit()
        response = _refuse(problem)
    else:
        response = with_cookie(
            HTMLResponse(IN), request, logins.begin(db, account, cookie_of(request))
        )
    response.delete_cookie(COOKIE, path="/login/sso")
    return response


@router.get("/login/sso/end")
def end_login(parts: PartsDep, request: Request) -> Response:
    """To the page that ends the provider's own login: else the next person at this browser would be logged in."""
    try:
        place = logout_address(
            _require_configuration(parts.settings.sign_on), _ours(request, "/login")
        )
    except SignOnError as problem:
        log.warning("single sign-on: the provider's own login was not ended: %s", problem)
        place = None
    return RedirectResponse(place or "/login", 303)


def _refuse(problem: InputError) -> Response:
    """Back to our login page; the reason goes to the log."""
    log.warning("single sign-on: nobody was let in: %s", problem)
    kind = problem.kind if isinstance(problem, SignOnError) else "refused"
    return RedirectResponse(f"/login?refused={kind}", 303)


def _require_configuration(agreed: SignOn | None) -> SignOn:
    if agreed is None:
        raise InputError("api.no_single_sign_on")
    return agreed


def _ours(request: Request, path: str) -> str:
    return str(request.url.replace(path=path, query=""))
