"""/login and /api/login: a one-time token in the address, or typed, becomes a cookie"""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from pydantic import BaseModel, Field
from starlette.responses import FileResponse, RedirectResponse

from app.api import access
from app.api.pages import STATIC
from app.api.state import Db, PartsDep
from app.version import software_version
from estimators.errors import InputError

router = APIRouter(tags=["login"])
pages = APIRouter(include_in_schema=False)


class Token(BaseModel):
    token: str = Field(max_length=200)


@pages.get("/login")
def login_page(parts: PartsDep, token: Annotated[str, Query(max_length=200)] = "") -> Response:
    """With a good token: in. Otherwise the page that asks for one."""
    cookie = access.redeem(parts.store, token) if token else None
    if cookie is None:
        return FileResponse(STATIC / "login" / "index.html", status_code=401 if token else 200)
    return _with_cookie(RedirectResponse("/", 303), cookie)


@router.post("/login", status_code=204)
def log_in(parts: PartsDep, given: Token) -> Response:
    cookie = access.redeem(parts.store, given.token.strip())
    if cookie is None:
        raise InputError("this code was used before or is not right; print a new one with: handscope login")
    return _with_cookie(Response(status_code=204), cookie)


@router.delete("/login", status_code=204)
def log_out(db: Db, request: Request) -> Response:
    access.log_out(db, request.cookies.get(access.COOKIE))
    response = Response(status_code=204)
    response.delete_cookie(access.COOKIE)
    return response


@router.get("/health")
def health() -> dict[str, Any]:
    return {"status": "ok", "version": software_version()}


def _with_cookie(response: Response, cookie: str) -> Response:
    response.set_cookie(access.COOKIE, cookie, httponly=True, samesite="strict", path="/")
    return response
