"""One server at a time on a data folder, and on a PostgreSQL database, unless several share that (sessions/store/shared_servers.py).

An advisory lock of the operating system on the file `lock`, which also says who holds it; it ends with its process, however that ends.
On PostgreSQL an advisory lock of a connection that stays open, under a name that says the same; those that share the database hold it together.
"""

import contextlib
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Connection, create_engine, make_url, text
from sqlalchemy.exc import DBAPIError, SQLAlchemyError
from sqlalchemy.pool import NullPool

from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.messages.system import describe
from handscope.estimators.numerics.optional_imports import system_module
from handscope.sessions.store.database import (
    answer_of,
    connect_arguments,
    is_up_to_date,
    place_of,
)
from handscope.sessions.store.shared_servers import MARK, find_identity

fcntl, msvcrt = system_module("fcntl"), system_module("msvcrt")
FILE = "lock"
BEYOND = 1 << 20  # where Windows locks: the holder's name before it stays readable
LOCK = 0x73657276  # of PostgreSQL's advisory locks; any number that nobody else uses
OWN_LOCK = text("SELECT pg_try_advisory_lock(:lock, hashtext(:identity))")
HOLDERS = text(
    "SELECT a.application_name FROM pg_locks l JOIN pg_stat_activity a USING (pid) "
    "WHERE l.locktype = 'advisory' AND l.granted AND l.classid = 0 AND l.objid = :lock AND l.objsubid = 1 "
    "AND l.database = (SELECT oid FROM pg_database WHERE datname = current_database()) "
    "ORDER BY a.pid = pg_backend_pid() DESC"
)


@contextmanager
def hold_folder(folder: Path, url: str | None = None, shared: bool = False) -> Iterator[None]:
    """The folder, and the database at `url`, for this process alone, or with others that share it; InputError that names the holder where another has them."""
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        file = os.open(folder / FILE, os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as problem:
        raise InputError(
            "store.data_folder_cannot_make", folder=str(folder), problem=describe(problem)
        ) from None
    try:
        if not _lock(file):
            holder = _read_holder(file) or phrase("store.other_process")
            raise InputError("store.data_folder_in_use", folder=str(folder), holder=holder)
        os.truncate(file, 0)
        os.lseek(file, 0, os.SEEK_SET)
        os.write(file, _own_name().encode())
        with _hold_database(url, find_identity(folder), shared):
            yield
    finally:
        os.close(file)


def _own_name() -> str:
    return f"process {os.getpid()} on {socket.gethostname()}"


def _read_holder(file: int) -> str:
    with contextlib.suppress(OSError):
        os.lseek(file, 0, os.SEEK_SET)
        return os.read(file, 200).decode("utf-8", "replace").strip()
    return ""


def _lock(file: int) -> bool:
    """Whether the lock is ours now."""
    try:
        if fcntl is not None:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        elif msvcrt is not None:
            os.lseek(file, BEYOND, os.SEEK_SET)
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
            os.lseek(file, 0, os.SEEK_SET)
    except OSError:
        return False
    return True


@contextmanager
def _hold_database(url: str | None, identity: str, shared: bool) -> Iterator[None]:
    """PostgreSQL: the server's advisory lock. SQLite lies in the folder and needs none; a URL that names no database is refused by open_database."""
    if not (url or "").startswith("postgresql"):
        yield
        return
    try:
        named = make_url(url or "").update_query_dict({"application_name": _own_name()[:63]})
        engine = create_engine(
            named,
            poolclass=NullPool,
            isolation_level="AUTOCOMMIT",
            connect_args=connect_arguments(url or ""),
        )
        connection = engine.connect()
    except DBAPIError as problem:
        raise InputError(
            "store.database_cannot_open", engine=place_of(engine), orig=answer_of(problem)
        ) from None
    except (SQLAlchemyError, ImportError):
        yield
        return
    with contextlib.closing(connection):
        _require_database(connection, shared or bool(identity))
        if identity and not connection.scalar(OWN_LOCK, {"lock": LOCK, "identity": identity}):
            raise InputError("store.server_twice", mark=MARK)
        yield


def _require_database(connection: Connection, shared: bool) -> None:
    """Take the lock; InputError where another server has the database alone, or others share it whose schema this program would change."""
    kind = "_shared" if shared else ""
    if not connection.scalar(text(f"SELECT pg_try_advisory_lock{kind}(:lock)"), {"lock": LOCK}):
        raise InputError("store.database_in_use", holder=_holder(connection))
    holders = connection.scalars(HOLDERS, {"lock": LOCK}).all()
    if len(holders) > 1 and not is_up_to_date(connection):
        raise InputError("store.upgrade_needs_rest", holders=", ".join(map(str, holders[1:])))


def _holder(connection: Connection) -> str:
    return str(connection.scalar(HOLDERS, {"lock": LOCK}) or phrase("store.other_process"))
