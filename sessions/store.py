"""The data folder: the database and the recordings' files beside it. Everything that is kept passes through here."""

import shutil
import uuid
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy.orm import Session, sessionmaker

from estimators.errors import InputError
from sessions import notes, repeatability
from sessions.database import open_database

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

    def path_of(self, file: str) -> Path:
        """A kept file by its name in the database; nothing outside the folder."""
        path = (self.folder / file).resolve()
        if not path.is_relative_to(self.folder.resolve()):
            raise InputError(f"{file!r} lies outside the data folder")
        return path

    def new_recording(self, suffix: str) -> str:
        """A name for a new recording, relative to the folder; InputError where the disk has no room."""
        self.require_room()
        return f"recordings/{uuid.uuid4().hex}{suffix}"

    def require_room(self, needed: int = FREE) -> None:
        """InputError where the disk is nearly full."""
        free = shutil.disk_usage(self.folder).free
        if free < needed:
            raise InputError(
                f"the disk is nearly full: {free / 2**20:.0f} MB free, {needed / 2**20:.0f} MB are needed; make room and try again"
            )


def open_store(folder: Path, url: str | None = None) -> Store:
    """Open the data folder, made when it is not there; files half-written by an earlier run are removed."""
    try:
        for place in (folder, folder / "recordings", folder / "incoming"):
            place.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise InputError(f"the data folder {folder} cannot be made: {problem.strerror}; choose another with --data") from None
    for leftover in (folder / "incoming").iterdir():
        leftover.unlink() if leftover.is_file() else shutil.rmtree(leftover, ignore_errors=True)
    database = open_database(folder, url)
    repeatability.fill(database)
    with database() as db:
        notes.purge(db)
    return Store(folder, database, url)
