"""The data folder: the database and the recordings' files beside it. Everything that is kept passes through here."""

import shutil
import uuid
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import select, text
from sqlalchemy.orm import Session, sessionmaker

from estimators.errors import InputError
from sessions import notes, repeatability
from sessions.database import RESTORING, open_database
from sessions.tables import ErasedFile

FREE = 200 * 2**20  # bytes that must be free to begin a recording: half an hour of 17 sensors at 200 Hz


@dataclass(frozen=True)
class Store:
    """Where things are and how the database is opened."""

    folder: Path
    database: sessionmaker[Session]
    url: str | None = None

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
        """A kept file by its name in the database; nothing outside the folder."""
        path = (self.folder / file).resolve()
        if not path.is_relative_to(self.folder.resolve()):
            raise InputError(f"{file!r} lies outside the data folder")
        return path

    def result_files(self, result_id: int) -> list[str]:
        """Names of the files that are kept of a result: `results/7.npz` and whatever else begins like that."""
        return sorted(path.relative_to(self.folder).as_posix() for path in (self.folder / "results").glob(f"{result_id}.*"))

    def new_recording(self, suffix: str) -> str:
        """A name for a new recording, relative to the folder; InputError where the disk has no room."""
        self.require_room()
        return f"recordings/{uuid.uuid4().hex}{suffix}"

    def require_room(self, needed: int = FREE) -> None:
        """InputError where the disk is nearly full."""
        free = free_bytes(self.folder)
        if free < needed:
            raise InputError(
                f"the disk is nearly full: {free / 2**20:.0f} MB free, {needed / 2**20:.0f} MB are needed; make room and try again"
            )


def free_bytes(folder: Path) -> int:
    """Room on the folder's disk."""
    return shutil.disk_usage(folder).free


def open_store(folder: Path, url: str | None = None) -> Store:
    """Open the data folder, made when it is not there; files half-written by an earlier run are removed."""
    try:
        for place in (folder, folder / "recordings", folder / "incoming"):
            place.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise InputError(f"the data folder {folder} cannot be made: {problem.strerror}; choose another with --data") from None
    if (folder / RESTORING).exists():
        raise InputError(f"a backup was being restored into {folder} and that did not end; empty the folder and restore again")
    for leftover in (folder / "incoming").iterdir():
        leftover.unlink() if leftover.is_file() else shutil.rmtree(leftover, ignore_errors=True)
    database = open_database(folder, url)
    repeatability.fill(database)
    store = Store(folder, database, url)
    with database() as db:
        notes.purge(db)
        remove_erased(db, store)
    return store


def remove_erased(db: Session, store: Store, files: Collection[str] | None = None) -> None:
    """Remove these files, or all, whose rows were erased (sessions/erasing.py) or never kept, and what the database's log still holds of those."""
    left = [erased for erased in db.scalars(select(ErasedFile)) if files is None or erased.file in files]
    for erased in left:
        store.path_of(erased.file).unlink(missing_ok=True)
        db.delete(erased)
    db.commit()
    if left and db.get_bind().dialect.name == "sqlite":
        db.execute(text("PRAGMA wal_checkpoint(TRUNCATE)"))
