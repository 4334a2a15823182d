"""The data folder: the database and the recordings' files beside it. Everything that is kept passes through here."""

import contextlib
import shutil
import uuid
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import select, text
from sqlalchemy.orm import Session, sessionmaker

from handscope.estimators.errors import InputError
from handscope.estimators.messages.system import describe
from handscope.sessions.clinic import notes, repeatability
from handscope.sessions.db.tables import ErasedFile
from handscope.sessions.files import object_storage
from handscope.sessions.files.object_storage import ObjectStorage
from handscope.sessions.sealing.keys import mark_sealed
from handscope.sessions.store import shared_servers
from handscope.sessions.store.database import RESTORING, open_database
from handscope.sessions.store.folder_privacy import keep_private, mend_permissions

CACHE = "cache"  # of files that are in the object storage
# begins the name of an erased file that is still to be removed from the object storage
AWAY = "away:"
ELSEWHERE = "elsewhere:"  # begins the name of one that another server has in its folder
PROBE = 2**20  # bytes that must be free to start at all: the database makes files of its own
# bytes that must be free to begin a recording: half an hour of 17 sensors at 200 Hz
FREE = 200 * 2**20


@dataclass(frozen=True)
class Store:
    """Where things are and how the database is opened."""

    folder: Path
    database: sessionmaker[Session]
    url: str | None = None
    # where closed files are moved (sessions/store/stored_files.py); None keeps them in the folder
    away: ObjectStorage | None = None
    server: str = ""  # which of several servers' folder it is (sessions/store/shared_servers.py)

    @property
    def recordings(self) -> Path:
        return self.folder / "recordings"

    @property
    def incoming(self) -> Path:
        return self.folder / "incoming"

    def close(self) -> None:
        """Give the database's connections back; the next use opens new ones."""
        self.database.kw["bind"].dispose()

    def path_of(self, file: str) -> Path:
        """Where a kept file is written, by its name in the database; nothing outside the folder. To read one: stored_files.fetch_local."""
        path = (self.folder / file).resolve()
        if not path.is_relative_to(self.folder.resolve()):
            raise InputError("store.path_outside", file=file)
        return path

    def cached(self, file: str) -> Path:
        """Where the copy of a file lies that is in the object storage."""
        return self.path_of(f"{CACHE}/{self.path_of(file).relative_to(self.folder.resolve())}")

    def new_recording(self, suffix: str) -> str:
        """A name for a new recording, relative to the folder; InputError where the disk has no room."""
        self.require_room()
        return f"recordings/{uuid.uuid4().hex}{suffix}"

    def require_room(self, needed: int = FREE) -> None:
        """InputError where the disk is nearly full."""
        free = free_bytes(self.folder)
        if free < needed:
            raise InputError("store.disk_nearly_full", free=free / 2**20, needed=needed / 2**20)


def free_bytes(folder: Path) -> int:
    """Room on the folder's disk."""
    return shutil.disk_usage(folder).free


def store_at(folder: Path, url: str | None = None) -> Store:
    """The store of a data folder that another process opened; nothing is tidied up."""
    return Store(
        folder,
        open_database(folder, url),
        url,
        object_storage.find_attached(folder),
        shared_servers.find_identity(folder),
    )


def open_store(
    folder: Path,
    url: str | None = None,
    recordings: str | None = None,
    shared_at: str | None = None,
) -> Store:
    """Open the data folder, made when it is not there; files half-written by an earlier run are removed.

    `recordings` is the URL of an object storage that closed files are moved to from now on; None leaves that as it is.
    `shared_at` makes this one of several servers, and says where browsers reach it ("" untold); None leaves that as it is.
    """
    keep_private()
    try:
        for place in (folder, folder / "recordings", folder / "incoming"):
            place.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise InputError(
            "store.data_folder_cannot_make", folder=str(folder), problem=describe(problem)
        ) from None
    if (folder / RESTORING).exists():
        raise InputError("store.restore_unfinished", folder=str(folder))
    for leftover in (folder / "incoming").iterdir():
        leftover.unlink() if leftover.is_file() else shutil.rmtree(leftover, ignore_errors=True)
    _require_writable(folder)
    mark_sealed(folder)
    mend_permissions(folder)
    if shared_at is not None:
        database = open_database(folder, url)
        try:
            shared_servers.join(folder, url, database, recordings, shared_at)
        finally:
            database.kw["bind"].dispose()
    elif recordings is not None:
        object_storage.attach(folder, recordings)
    store = store_at(folder, url)
    repeatability.fill(store.database)
    with store.database() as db:
        notes.purge(db)
        remove_erased(db, store)
    return store


def _require_writable(folder: Path) -> None:
    """InputError where the disk is read-only or full, or somebody else's: said before the database is asked, whose words for it are not clear."""
    probe = folder / "incoming" / "probe"
    try:
        probe.write_bytes(bytes(PROBE))
        probe.unlink()
    except OSError as problem:
        with contextlib.suppress(OSError):
            probe.unlink(missing_ok=True)
        raise InputError(
            "store.data_folder_not_writable", folder=str(folder), problem=describe(problem)
        ) from None


def remove_erased(db: Session, store: Store, files: Collection[str] | None = None) -> None:
    """Remove these files, or all, whose rows were erased (sessions/store/erasure.py) or never kept, and what the database's log still holds of those.

    What may be in the object storage, and what another server has, is removed by the next round of stored_files.move_out, there by that server.
    """
    query = select(ErasedFile).where(
        ~ErasedFile.file.startswith(AWAY), ~ErasedFile.file.startswith(ELSEWHERE)
    )
    if store.server:
        query = query.where(ErasedFile.server == store.server)
    left = [erased for erased in db.scalars(query) if files is None or erased.file in files]
    for erased in left:
        store.path_of(erased.file).unlink(missing_ok=True)
        if store.away is not None:
            store.cached(erased.file).unlink(missing_ok=True)
            db.merge(ErasedFile(file=AWAY + erased.file))
        db.delete(erased)
    db.commit()
    if left and db.get_bind().dialect.name == "sqlite":
        db.execute(text("PRAGMA wal_checkpoint(TRUNCATE)"))
