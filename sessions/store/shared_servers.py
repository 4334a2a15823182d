"""Several servers on one PostgreSQL database and one object storage: which one this is, who else there is, and what lies only with whom.

Each has a data folder of its own, where what it records lies until it is in the object storage; `server` in a row of the database says whose that is.
A server by itself has no mark in its folder: it is called "", and everything that no row ascribes to another is its own.
"""

import json
import socket
import uuid
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

from sqlalchemy import ColumnElement, delete, func, select, update
from sqlalchemy.orm import Session, sessionmaker

from handscope.estimators.errors import InputError
from handscope.sessions.db.patientless_tables import ErasedFile, Server
from handscope.sessions.db.tables import PatientSession, RecordingFile, Result, now
from handscope.sessions.files import object_storage
from handscope.sessions.tables_io.writing import save_file

MARK = "shared-server.json"
SILENT = timedelta(minutes=1)  # without a heartbeat, after which a server counts as stopped
_NOW = func.timezone("UTC", func.now())  # PostgreSQL's clock, one for all
OWNED = (RecordingFile, Result, ErasedFile)


@dataclass(frozen=True)
class OtherServer:
    """Another server of the same clinic."""

    id: str
    name: str  # of its machine
    address: str  # where browsers reach it; "" where that is not known
    answers: bool  # whether it was there within the last minute, by the database's clock


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
        identity = find_identity(folder)
        if known is not None and not identity and _holds_files(folder):
            raise InputError("store.sharing_needs_empty_folder", folder=str(folder))
        identity = identity or uuid.uuid4().hex
        save_file(json.dumps({"server": identity}).encode(), folder / MARK)
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


def record_heartbeat(db: Session, server: str) -> None:
    """Say that this server is there, by the database's clock."""
    db.execute(update(Server).where(Server.id == server).values(seen=_NOW))
    db.commit()


def find_other(db: Session, server: str, own: str) -> OtherServer | None:
    """The other server of that identity; None where it is this one, or none that is known."""
    if not own or server == own:
        return None
    return next(iter(_read(db, Server.id == server)), None)


def list_others(db: Session, own: str) -> list[OtherServer]:
    """Every other server, by name."""
    return _read(db, Server.id != own) if own else []


def retire(db: Session, name: str, own: str) -> int:
    """Take over what the server of that name left behind, for good; gives how many sessions it left open. InputError where it answers, or none has that name alone.

    Recordings that it had not brought to the object storage are lost with its disk: sessions of which nothing is left are closed as failed when this server starts next.
    """
    found = [o for o in list_others(db, own) if o.name == name]
    if len(found) != 1:
        raise InputError("store.server_unknown", name=name, count=len(found))
    if found[0].answers:
        raise InputError("store.server_answers", name=name)
    of_it = RecordingFile.server == found[0].id
    left = db.scalar(
        select(func.count())
        .select_from(PatientSession)
        .where(PatientSession.state == "open", PatientSession.recordings.any(of_it))
    )
    for table in OWNED:
        db.execute(update(table).where(table.server == found[0].id).values(server=own))
    db.execute(delete(Server).where(Server.id == found[0].id))
    db.commit()
    return int(left or 0)


def _read(db: Session, which: ColumnElement[bool]) -> list[OtherServer]:
    query = select(Server, _NOW - Server.seen < SILENT).where(which)
    rows = db.execute(query.order_by(Server.name, Server.id)).all()
    return [OtherServer(row.id, row.name, row.address, bool(answers)) for row, answers in rows]


def _holds_files(folder: Path) -> bool:
    """Whether a data folder has recordings or results of its own."""
    return any(
        path.is_file() for place in ("recordings", "results") for path in (folder / place).glob("*")
    )
