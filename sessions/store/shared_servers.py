"""Several servers on one PostgreSQL database and one object storage: which one this is, who else there is, and what lies only with whom.

Each has a data folder of its own, where what it records lies until it is in the object storage; `server` in a row of the database says whose that is.
A server by itself has no mark in its folder: it is called "", and everything that no row ascribes to another is its own.
"""

import json
import socket
import uuid
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

from sqlalchemy import select, update
from sqlalchemy.orm import Session, sessionmaker

from handscope.estimators.errors import InputError
from handscope.sessions.db.patientless_tables import ErasedFile, Server
from handscope.sessions.db.tables import RecordingFile, Result, now
from handscope.sessions.files import object_storage
from handscope.sessions.tables_io.writing import save_file

MARK = "shared-server.json"
SILENT = timedelta(minutes=1)  # since a server told of itself, after which it counts as stopped
OWNED = (RecordingFile, Result, ErasedFile)


@dataclass(frozen=True)
class OtherServer:
    """Another server of the same clinic."""

    name: str  # of its machine
    address: str  # where browsers reach it; "" untold
    seen: datetime
    answers: bool  # whether it told of itself lately


def find_identity(folder: Path) -> str:
    """Which of several servers a data folder belongs to; "" where there is one alone."""
    try:
        return str(json.loads((folder / MARK).read_bytes())["server"])
    except FileNotFoundError:
        return ""
    except (OSError, ValueError, TypeError, KeyError):
        raise InputError("store.server_mark_damaged", file=str(folder / MARK)) from None


def join(
    folder: Path,
    url: str | None,
    database: sessionmaker[Session],
    recordings: str | None,
    address: str,
) -> None:
    """Make the folder's server one of those that share the database and the object storage at `recordings` (None: the one that the folder has).

    The first that shares keeps what was recorded before. InputError where the database is a file, or where the others have another object storage.
    """
    if not (url or "").startswith("postgresql"):
        raise InputError("store.sharing_needs_postgresql")
    with database() as db:
        known = db.scalars(select(Server.storage)).first()
        if recordings is not None:
            object_storage.attach(folder, recordings, known)
        storage = object_storage.find_attached(folder)
        if storage is None:
            raise InputError("store.sharing_needs_storage")
        if known not in (None, storage.folder):
            raise InputError("recording.storage_not_shared", url=storage.url)
        identity = find_identity(folder) or uuid.uuid4().hex
        db.merge(
            Server(
                id=identity,
                name=socket.gethostname()[:100],
                address=address,
                storage=storage.folder,
                seen=now(),
            )
        )
        if known is None:
            for table in OWNED:
                db.execute(update(table).values(server=identity))
        db.commit()
    save_file(json.dumps({"server": identity}).encode(), folder / MARK)


def tell(db: Session, server: str) -> None:
    """Say that this server is there."""
    if server:
        db.execute(update(Server).where(Server.id == server).values(seen=now()))
        db.commit()


def find_other(db: Session, server: str, own: str) -> OtherServer | None:
    """The other server of that identity; None where it is this one, or none that is known."""
    row = db.get(Server, server) if server != own and own else None
    if row is None:
        return None
    return OtherServer(row.name, row.address, row.seen, now() - row.seen < SILENT)


def list_others(db: Session, own: str) -> list[OtherServer]:
    """Every other server, by name."""
    rows = db.scalars(select(Server).where(Server.id != own).order_by(Server.name, Server.id))
    return [
        OtherServer(row.name, row.address, row.seen, now() - row.seen < SILENT)
        for row in (rows if own else ())
    ]
