"""How a database shows that it takes nothing now: locked by another process, stopped, or cut off from the server."""

import sqlite3

from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeout

from handscope.estimators.messages.sentence import phrase

UNAVAILABLE = phrase("database.unavailable")
LOCKED = (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED)
# SQLSTATE classes: connection, operator, resources, rollback, lock
PASSING = "08", "57", "53", "40", "55"


def is_unavailable(problem: BaseException | None) -> bool:
    """Whether the same request may succeed a moment later."""
    if isinstance(problem, PoolTimeout):
        return True
    if not isinstance(problem, DBAPIError):
        return False
    orig = problem.orig
    if isinstance(orig, sqlite3.Error):
        return getattr(orig, "sqlite_errorcode", 0) & 0xFF in LOCKED
    state = getattr(orig, "sqlstate", None)
    if state is None:  # the driver found no server to ask
        return problem.connection_invalidated or type(problem).__name__ == "OperationalError"
    return str(state).startswith(PASSING)
