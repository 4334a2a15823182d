"""Answers where the database takes nothing: a full disk, a lock, a server that does not answer."""

import logging

from starlette.requests import HTTPConnection
from starlette.responses import JSONResponse

from handscope.app.error_body import error_body
from handscope.app.private_log import describe_error
from handscope.app.state import preferred
from handscope.sessions.db.full_disk import FULL, is_full
from handscope.sessions.db.unavailable import UNAVAILABLE, is_unavailable

NO_ROOM = 507  # HTTP: insufficient storage
RETRY_AFTER = "5"  # s
log = logging.getLogger(__name__)


def answer_to_database(connection: HTTPConnection, error: BaseException) -> JSONResponse | None:
    """507 where the disk is full, 503 where the database takes nothing now; None for other errors."""
    if is_full(error):
        log.error("%s: the disk is full", route_of(connection))
        return JSONResponse(error_body(FULL, preferred(connection)), NO_ROOM)
    if is_unavailable(error):
        log.error("%s: %s", route_of(connection), describe_error(error))
        body = error_body(UNAVAILABLE, preferred(connection))
        return JSONResponse(body, 503, {"Retry-After": RETRY_AFTER})
    return None


def route_of(connection: HTTPConnection) -> str:
    """The pattern of the address, without what somebody typed into it."""
    route = connection.scope.get("route")
    return str(getattr(route, "path", "") or "request")
