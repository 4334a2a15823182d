"""/login/sso: to the organisation's login and back"""

import logging
import secrets
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from starlette.responses import HTMLResponse, RedirectResponse

from handscope.app.api.login_routes import with_cookie
from handscope.app.auth.gate import secure
from handscope.app.auth.oidc import (
    NAME,
    Answer,
    SignOn,
    SignOnError,
    farewell,
    identity,
    leave,
    roles_of,
    subject_of,
)
from handscope.app.auth.roles import ANYBODY, may
from handscope.app.state import Db, PartsDep
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import accounts, audit
from handscope.sessions.clinic.audit import Happened
from handscope.sessions.store import logins

log = logging.getLogger(__name__)
router = APIRouter(include_in_schema=False, dependencies=[may(ANYBODY)])
COOKIE, MINUTES = "handscope-sso", 10
IN = '<!doctype html><title>Handscope</title><meta http-equiv="refresh" content="0; url=/"><a href="/">Handscope</a>'


@router.get("/login/sso")
def go(parts: PartsDep, request: Request) -> Response:
    """To the provider."""
    word = secrets.token_urlsafe(32)
    try:
        response = RedirectResponse(
            leave(_agreed(parts.settings.sign_on), word, _ours(request, "/login/sso/answer")), 303
        )
    except SignOnError as problem:
        return _not_in(problem)
    response.set_cookie(
        COOKIE,
        word,
        max_age=60 * MINUTES,
        path="/login/sso",
        httponly=True,
        samesite="lax",
        secure=secure(request.scope),
    )  # lax: it must come along when the provider sends the browser back
    return response


@router.get("/login/sso/answer")
def come_back(
    db: Db,
    parts: PartsDep,
    request: Request,
    state: Annotated[str, Query(max_length=200)] = "",
    code: Annotated[str, Query(max_length=4000)] = "",
    error: Annotated[str, Query(max_length=200)] = "",
    iss: Annotated[str, Query(max_length=400)] = "",
) -> Response:
    """From the provider. The page that follows is asked for by ours, so that it comes with the strict cookie."""
    agreed, given = (
        _agreed(parts.settings.sign_on),
        Answer(state=state, code=code, error=error, issuer=iss),
    )
    try:
        claims = identity(
            agreed, request.cookies.get(COOKIE, ""), _ours(request, "/login/sso/answer"), given
        )
        name = str(claims.get(NAME) or claims["sub"])
        account = accounts.of_subject(
            db, subject_of(agreed, claims), name, roles_of(agreed, claims)
        )
    except InputError as problem:
        kind = problem.kind if isinstance(problem, SignOnError) else "refused"
        audit.tell(db, Happened("refused", "login", counts={"by": "single sign-on", "why": kind}))
        db.commit()
        response = _not_in(problem)
    else:
        response = with_cookie(HTMLResponse(IN), request, logins.begin(db, account))
    response.delete_cookie(COOKIE, path="/login/sso")
    return response


@router.get("/login/sso/end")
def part(parts: PartsDep, request: Request) -> Response:
    """To where the provider asks whether its own login ends, too: without that whoever comes next to this browser would be in again."""
    try:
        place = farewell(_agreed(parts.settings.sign_on), _ours(request, "/login"))
    except SignOnError as problem:
        log.warning("single sign-on: the provider's own login was not ended: %s", problem)
        place = None
    return RedirectResponse(place or "/login", 303)


def _not_in(problem: InputError) -> Response:
    """Back to our page, which says so; why is for whoever reads the log."""
    log.warning("single sign-on: nobody was let in: %s", problem)
    kind = problem.kind if isinstance(problem, SignOnError) else "refused"
    return RedirectResponse(f"/login?refused={kind}", 303)


def _agreed(agreed: SignOn | None) -> SignOn:
    if agreed is None:
        raise InputError("there is no single sign-on on this server")
    return agreed


def _ours(request: Request, path: str) -> str:
    return str(request.url.replace(path=path, query=""))
