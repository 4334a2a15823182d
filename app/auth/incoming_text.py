"""What every request passes: names that are known, and text that can be shown and stored (sessions/db/plain_text.py)."""

from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator
from starlette.datastructures import QueryParams
from starlette.requests import HTTPConnection
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from handscope.app.error_body import error_body
from handscope.app.language import Language, preferred
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.db.plain_text import find_refused, require_plain


class Incoming(BaseModel):
    """Base of all bodies: unknown names and control characters are refused."""

    model_config = ConfigDict(extra="forbid")

    @model_validator(mode="before")
    @classmethod
    def _check_text(cls, given: Any) -> Any:
        if isinstance(given, dict):
            for name, value in given.items():
                require_plain(name, "the request")
                require_plain(value, name)
        return given


class PlainAddresses:
    """ASGI middleware: addresses with control characters, in the path or the query, are refused."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and not _is_plain(scope):
            error = error_body(phrase("gate.address_unprintable"), _language(scope))
            await JSONResponse(error, 400)(scope, receive, send)
            return
        await self._app(scope, receive, send)


def _language(scope: Scope) -> Language:
    return preferred(HTTPConnection(scope).headers.get("accept-language", ""))


def _is_plain(scope: Scope) -> bool:
    if find_refused(scope["path"], one_line=True):
        return False
    try:
        for name, value in QueryParams(scope["query_string"]).multi_items():
            require_plain([name, value], "the address")
    except InputError:
        return False
    return True
