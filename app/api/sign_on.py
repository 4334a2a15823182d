"""/login/sso: to the organisation's login and back"""

import secrets
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from starlette.responses import HTMLResponse, RedirectResponse

from app.api.access import secure
from app.api.login import with_cookie
from app.api.roles import ANYBODY, may
from app.api.state import Db, PartsDep
from app.single_sign_on import SignOn, identity, leave, roles_of
from estimators.errors import InputError
from sessions import accounts, audit, logins
from sessions.audit import Happened

router = APIRouter(include_in_schema=False, dependencies=[may(ANYBODY)])
COOKIE, MINUTES = "handscope-sso", 10
IN = '<!doctype html><title>Handscope</title><meta http-equiv="refresh" content="0; url=/"><a href="/">Handscope</a>'


@router.get("/login/sso")
def go(parts: PartsDep, request: Request) -> Response:
    """To the provider."""
    word = secrets.token_urlsafe(32)
    response = RedirectResponse(leave(_agreed(parts.settings.sign_on), word, _back(request)), 303)
    response.set_cookie(
        COOKIE, word, max_age=60 * MINUTES, path="/login/sso", httponly=True, samesite="lax", secure=secure(request.scope)
    )  # lax: it must come along when the provider sends the browser back
    return response


@router.get("/login/sso/answer")
def come_back(
    db: Db,
    parts: PartsDep,
    request: Request,
    state: Annotated[str, Query(max_length=200)] = "",
    code: Annotated[str, Query(max_length=4000)] = "",
) -> Response:
    """From the provider. The page that follows is asked for by ours, so that it comes with the strict cookie."""
    agreed = _agreed(parts.settings.sign_on)
    try:
        claims = identity(agreed, request.cookies.get(COOKIE, ""), _back(request), state, code)
        name = str(claims.get("preferred_username") or claims["sub"])
        account = accounts.of_subject(db, f"{agreed.issuer} {claims['sub']}", name, roles_of(agreed, claims))
    except InputError:
        audit.tell(db, Happened("refused", "login", counts={"by": "single sign-on"}))
        db.commit()
        response: Response = RedirectResponse("/login?refused=1", 303)
    else:
        response = with_cookie(HTMLResponse(IN), request, logins.begin(db, account))
    response.delete_cookie(COOKIE, path="/login/sso")
    return response


def _agreed(agreed: SignOn | None) -> SignOn:
    if agreed is None:
        raise InputError("there is no single sign-on on this server")
    return agreed


def _back(request: Request) -> str:
    return str(request.url.replace(path="/login/sso/answer", query=""))
