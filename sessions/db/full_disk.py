"""How a full disk shows: in a file that cannot grow, or in a database that cannot take a row."""

import errno
import sqlite3

from sqlalchemy.exc import DBAPIError

from handscope.estimators.messages.sentence import phrase

FULL = phrase("database.full_disk")
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def is_full(problem: BaseException | None) -> bool:
    """Whether an error says that there is no room on the disk."""
    if isinstance(problem, DBAPIError):
        problem = problem.orig
    if isinstance(problem, sqlite3.Error):
        return problem.sqlite_errorcode == sqlite3.SQLITE_FULL
    if isinstance(problem, OSError):
        return problem.errno in NO_ROOM
    return getattr(problem, "sqlstate", None) == "53100"  # PostgreSQL: disk_full
