"""Tables whose rows belong to no patient and to no account's row: the audit trail, files to remove, maps of columns, counted tries, servers."""

from datetime import datetime
from typing import Any

from sqlalchemy import String
from sqlalchemy.orm import Mapped, mapped_column

from handscope.sessions.db.columns import Base, now


class AuditLine(Base):
    """Who did what, when; each line is chained to the one before (sessions/clinic/audit.py)."""

    __tablename__ = "audit"

    # from 1 on, without a gap
    id: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    at: Mapped[datetime]
    who: Mapped[str] = mapped_column(String(64), index=True)  # an account's name
    address: Mapped[str] = mapped_column(String(64))  # where the request came from
    # viewed, created, changed, exported, erased, logged in, refused
    what: Mapped[str] = mapped_column(String(64))
    kind: Mapped[str] = mapped_column(String(32))  # patient, session, result, account, ...
    ref: Mapped[str] = mapped_column(String(64))  # its number
    # whose it is: a number that no other patient gets
    patient: Mapped[int | None] = mapped_column(index=True)
    # names of fields; of an erased patient sessions, recordings, results, notes, bytes
    counts: Mapped[dict[str, Any]] = mapped_column(default=dict)
    previous: Mapped[str] = mapped_column(String(64))
    hash: Mapped[str] = mapped_column(String(64))


class StoredColumnMap(Base):
    """Which columns of other loggers' tables are what, by the tables' headers (sessions/table_import/stored_maps.py)."""

    __tablename__ = "column_map"

    id: Mapped[int] = mapped_column(primary_key=True)
    key: Mapped[str] = mapped_column(String(64), unique=True)  # sha256 of the header
    data: Mapped[dict[str, Any]] = mapped_column(default=dict)  # MAP.json without hand and lengths
    changed: Mapped[datetime] = mapped_column(default=now)


class ErasedFile(Base):
    """A file that must go: its rows are gone, or it is an upload whose rows are not there yet; the next start finishes what a power cut interrupted."""

    __tablename__ = "erased_file"

    file: Mapped[str] = mapped_column(primary_key=True)  # relative to the data folder
    # which of several has it in its folder (sessions/store/shared_servers.py)
    server: Mapped[str] = mapped_column(String(32), default="", server_default="")


class Server(Base):
    """One of several servers that share the database and an object storage (sessions/store/shared_servers.py)."""

    __tablename__ = "server"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)  # in its data folder's mark
    name: Mapped[str] = mapped_column(String(100))  # of its machine
    address: Mapped[str] = mapped_column(String(300))  # where browsers reach it
    storage: Mapped[str] = mapped_column(String(32))  # the object storage's mark
    seen: Mapped[datetime]  # when it reported last


class Attempt(Base):
    """A try of a password, counted before it was checked (sessions/login/logins.py)."""

    __tablename__ = "attempt"

    id: Mapped[int] = mapped_column(primary_key=True)
    # hash of the account's name or of the address
    key: Mapped[str] = mapped_column(String(64), index=True)
    at: Mapped[datetime] = mapped_column(default=now)
