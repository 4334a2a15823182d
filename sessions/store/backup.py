"""Everything in the data folder as one checked file, made while the server runs, and back into an empty folder.

A backup is a zip: `database.jsonl` (all rows at one moment, sessions/store/database_dump.py), the files of the data folder as they stood (recordings whose
session was not finished end where they were then) and of its object storage, `manifest.json` with size and SHA-256 of each. One-time codes and logins
are not in it, nor where the object storage is: what is restored lies in the new folder.
"""

import contextlib
import hashlib
import itertools
import json
import os
import shutil
import struct
import tempfile
import time
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from sqlalchemy import Connection, Engine, create_engine, text
from sqlalchemy.exc import DBAPIError

from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.messages.system import describe
from handscope.sessions.clinic import audit
from handscope.sessions.db.tables import now
from handscope.sessions.files import object_storage
from handscope.sessions.files.object_storage import MARK, ObjectStorage, find_attached
from handscope.sessions.sealing.keys import SEALED_MARK
from handscope.sessions.sealing.rotation import SEALED
from handscope.sessions.sealing.stored import create_stored, is_sealing, open_stored, unsealed
from handscope.sessions.store import database_dump, sealed_files, shared_servers
from handscope.sessions.store.archive_entries import (
    PIECE,
    pieces_of,
    read_entry,
    require_checksum,
    write_pieces,
)
from handscope.sessions.store.database import FILE, RESTORING, answer_of, connect, place_of
from handscope.sessions.store.store import CACHE, PROBE, free_bytes

FORMAT = "handscope backup"
FORMAT_VERSION = 1
DATABASE, MANIFEST = "database.jsonl", "manifest.json"
PASSING = (
    "incoming",
    "tokens",
    "address",
    CACHE,
    MARK,
    shared_servers.MARK,
    SEALED_MARK,
    FILE,
    f"{FILE}-wal",
    f"{FILE}-shm",
    f"{FILE}-journal",
    RESTORING,
)
# all that reading a damaged zip was seen to raise
DAMAGED = zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError, struct.error
TRIES = 3  # times that a backup is begun again because a patient was erased meanwhile


@dataclass
class BackupSummary:
    """What went into a backup."""

    files: dict[str, dict[str, Any]] = field(default_factory=dict)  # by name: bytes, sha256
    problems: list[str] = field(default_factory=list)  # what was missing or is not what was kept
    audit: tuple[int, str] | None = None  # number and hash of the audit trail's last line

    @property
    def bytes(self) -> int:
        return sum(int(f["bytes"]) for f in self.files.values())


def write(
    folder: Path, url: str | None, target: Path, software: str, recipients: Sequence[str] = ()
) -> BackupSummary:
    """Back up the data folder into `target`, which is there only when it is whole; InputError where there is nothing to back up.

    With recipients it is sealed for them: it is made in the data folder, and leaves it sealed alone.
    """
    if url is None and not (folder / FILE).is_file():
        raise InputError("backup.no_data", folder=str(folder))
    if is_sealing() and not recipients:
        raise InputError("sealing.backup_needs_recipient")
    if target.exists():
        raise InputError("backup.exists", target=str(target))
    if target.absolute().is_relative_to(folder.absolute()):
        raise InputError("backup.inside_data_folder", target=str(target))
    partial = target.with_name(f".{target.name}.partial")
    sealed = partial if recipients else None
    if sealed is not None:
        partial = folder / "incoming" / partial.name
    engine = connect(folder, url)
    try:
        partial.parent.mkdir(mode=0o700, exist_ok=True)
        for _ in range(TRIES):
            with _create(partial) as out:
                stored, made = _archive(engine, folder, software, out)
                out.flush()
                os.fsync(out.fileno())
            with engine.connect() as connection:
                erased = stored.keys() - _recordings(connection).keys()
            if not erased:
                _verify(partial)
                if sealed is not None:
                    sealed_files.seal(partial, sealed, recipients)
                os.replace(sealed or partial, target)
                return made
        raise InputError("backup.erased_meanwhile")
    except OSError as problem:
        raise InputError(
            "backup.cannot_write_backup", target=str(target), strerror=describe(problem)
        ) from None
    except DBAPIError as problem:
        if free_bytes(folder) < PROBE:
            raise InputError("backup.disk_full", folder=str(folder)) from None
        raise InputError(
            "backup.database_cannot_read", engine=place_of(engine), orig=answer_of(problem)
        ) from None
    finally:
        for left in (partial, sealed):
            if left is not None:
                left.unlink(missing_ok=True)
        engine.dispose()


def restore(
    source: Path,
    folder: Path,
    url: str | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> dict[str, Any]:
    """Put a backup into an empty data folder (and an empty database); gives its manifest. InputError, and nothing stays, where that fails.

    The database comes last and a mark lies in the folder until then: an interrupted restore cannot be taken for data.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError("backup.folder_not_empty", folder=str(folder))
    existed = folder.exists()
    with _open(source) as archive:
        manifest = _manifest(archive, source)
        engine = connect(folder, url) if url else create_engine(f"sqlite:///{folder / RESTORING}")
        try:
            folder.mkdir(parents=True, exist_ok=True)
            (folder / RESTORING).touch()
            _unpack(archive, manifest, folder, progress)
            with archive.open(DATABASE) as lines:
                _fill(engine, lines)
            engine.dispose()
            if url:
                (folder / RESTORING).unlink()
            else:
                os.replace(folder / RESTORING, folder / FILE)
        except BaseException as problem:
            engine.dispose()
            for leftover in folder.iterdir() if folder.exists() else ():
                shutil.rmtree(leftover) if leftover.is_dir() else leftover.unlink()
            if not existed:
                with contextlib.suppress(OSError):
                    folder.rmdir()
            if isinstance(problem, OSError):
                raise InputError(
                    "backup.cannot_write_folder", folder=str(folder), strerror=describe(problem)
                ) from None
            if isinstance(problem, DBAPIError):
                raise InputError(
                    "backup.database_refused", engine=place_of(engine), orig=answer_of(problem)
                ) from None
            raise
    return manifest


def check(source: Path) -> dict[str, Any]:
    """Read a backup whole and compare every checksum; gives its manifest, InputError names the first file that is not as it was."""
    with _open(source) as archive:
        manifest = _manifest(archive, source)
        for name, entry in manifest["files"].items():
            require_checksum(name, entry, read_entry(archive, name))
    return manifest


def read_audit_head(source: Path) -> tuple[int, str]:
    """Number and hash of the audit trail's last line as a backup noted them; InputError where it did not."""
    with _open(source) as archive:
        noted = _manifest(archive, source).get("audit")
    if not noted:
        raise InputError("backup.no_audit_head", source=str(source))
    number, total = noted
    return int(number), str(total)


def _archive(
    engine: Engine, folder: Path, software: str, out: IO[bytes]
) -> tuple[dict[str, str | None], BackupSummary]:
    """Write the zip; gives the recordings that the database names, with their checksums, and what was put in."""
    made, moment = BackupSummary(), now()
    with zipfile.ZipFile(out, "w") as archive:
        with _snapshot(engine) as connection:
            recordings, made.audit = _recordings(connection), audit.read_head(connection)
            _put(archive, made, DATABASE, database_dump.dump(connection), zipfile.ZIP_DEFLATED)
        away = _answering(folder, made)
        for name in sorted({*recordings, *_others(folder), *_object_names(away)}):
            try:
                _put(archive, made, name, _stored_pieces(folder, away, name), zipfile.ZIP_STORED)
            except FileNotFoundError:
                if name in recordings and recordings[name] is not None:
                    made.problems.append(phrase("backup.recording_missing", name=name))
                continue
            if (sum_ := recordings.get(name)) is not None and made.files[name]["sha256"] != sum_:
                made.problems.append(phrase("backup.recording_changed", name=name, sha256=sum_))
        entry = {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "software": software,
            "made": moment.isoformat(),
            "problems": made.problems,
            "audit": made.audit,
        }
        archive.writestr(MANIFEST, json.dumps({**entry, "files": made.files}, indent=1))
    return recordings, made


@contextlib.contextmanager
def _snapshot(engine: Engine) -> Iterator[Connection]:
    """A connection that sees the database as it is at this moment, while others go on writing."""
    with engine.connect() as connection:
        if engine.dialect.name == "sqlite":
            connection.exec_driver_sql("BEGIN")
        else:
            connection = connection.execution_options(isolation_level="REPEATABLE READ")
        yield connection
        connection.rollback()
        if engine.dialect.name == "sqlite":  # what was erased meanwhile could not leave the log
            connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")


def _create(partial: Path) -> IO[bytes]:
    """The file of a backup that is being made; what is made in a sealed data folder is sealed, too."""
    partial.unlink(missing_ok=True)
    if is_sealing():
        return create_stored(partial, PIECE)
    return os.fdopen(os.open(partial, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600), "w+b")


def _recordings(connection: Connection) -> dict[str, str | None]:
    """Names of the recordings' files with their checksums; None while one is being written."""
    return {
        str(row.file): row.sha256
        for row in connection.execute(text("SELECT file, sha256 FROM recording"))
    }


def _others(folder: Path) -> Iterator[str]:
    """Files of the data folder besides recordings, which the database names."""
    for path in folder.rglob("*"):
        name = path.relative_to(folder)
        if (
            path.is_file()
            and name.parts[0] not in (*PASSING, "recordings")
            and not path.name.endswith(".partial")
        ):
            yield name.as_posix()


def _answering(folder: Path, made: BackupSummary) -> ObjectStorage | None:
    """The object storage, where there is one; one that does not answer is a problem of the backup."""
    away = find_attached(folder)
    try:
        if away is not None:
            object_storage.require(away)
    except InputError as problem:
        made.problems.append(str(problem))
        return None
    return away


def _object_names(away: ObjectStorage | None) -> list[str]:
    """Results that were moved into the object storage."""
    return object_storage.names(away, "results") if away else []


def _stored_pieces(folder: Path, away: ObjectStorage | None, name: str) -> Iterator[bytes]:
    """A file's bytes from where it is: it may leave the folder for its cache, and that for good, at any moment."""
    for place in (folder, folder / CACHE):
        with contextlib.suppress(FileNotFoundError), open_stored(place / name) as file:
            yield from pieces_of(file)
            return
    if away is None:
        raise FileNotFoundError(name)
    with tempfile.TemporaryFile(dir=folder / "incoming") as held:
        held.writelines(object_storage.pieces(away, name))
        held.seek(0)
        yield from pieces_of(unsealed(held, name))


def _put(
    archive: zipfile.ZipFile, made: BackupSummary, name: str, pieces: Iterable[bytes], how: int
) -> None:
    entry = zipfile.ZipInfo(name, time.gmtime()[:6])
    entry.compress_type, entry.external_attr = how, 0o600 << 16
    total, size, each = hashlib.sha256(), 0, iter(pieces)
    first = next(each, b"")  # what is not there is no entry
    with archive.open(entry, "w", force_zip64=True) as file:
        for piece in itertools.chain([first], each):
            file.write(piece)
            total.update(piece)
            size += len(piece)
    made.files[name] = {"bytes": size, "sha256": total.hexdigest()}


def _verify(path: Path) -> None:
    with open_stored(path) as file, zipfile.ZipFile(file) as archive:
        if (bad := archive.testzip()) is not None:
            raise InputError("backup.not_read_back", bad=bad)


@contextlib.contextmanager
def _open(source: Path) -> Iterator[zipfile.ZipFile]:
    if sealed_files.is_sealed(source):
        raise InputError("backup.sealed", source=str(source))
    try:
        with open_stored(source) as file, zipfile.ZipFile(file) as archive:
            yield archive
    except DAMAGED as problem:
        raise InputError("backup.damaged", source=str(source), problem=str(problem)) from None
    except OSError as problem:  # also where a damaged directory points before the file's beginning
        raise InputError(
            "backup.cannot_read", source=str(source), strerror=describe(problem)
        ) from None


def _manifest(archive: zipfile.ZipFile, source: Path) -> dict[str, Any]:
    try:
        manifest = json.loads(archive.read(MANIFEST))
        known = manifest["format"] == FORMAT and DATABASE in manifest["files"]
    except (KeyError, TypeError, ValueError):
        known = False
    if not known:
        raise InputError("backup.not_a_backup", source=str(source))
    if manifest["format_version"] > FORMAT_VERSION:
        raise InputError(
            "backup.newer_format",
            source=str(source),
            manifest=manifest["format_version"],
            format_version=FORMAT_VERSION,
        )
    return dict(manifest)


def _unpack(
    archive: zipfile.ZipFile,
    manifest: dict[str, Any],
    folder: Path,
    progress: Callable[[float], None],
) -> None:
    """Files into their places, each compared with its checksum; the database's lines are only compared."""
    home, done = folder.resolve(), 0
    whole = max(1, sum(entry["bytes"] for entry in manifest["files"].values()))
    for name, entry in manifest["files"].items():
        if name not in archive.namelist():
            raise InputError("backup.file_missing", name=name)
        path = (folder / name).resolve()
        if not path.is_relative_to(home) or path == home / RESTORING:
            raise InputError("backup.path_outside", name=name)
        if name == DATABASE:
            require_checksum(name, entry, read_entry(archive, name))
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            with _open_new(name, path) as target:
                require_checksum(name, entry, write_pieces(read_entry(archive, name), target))
        done += entry["bytes"]
        progress(done / whole)


def _open_new(name: str, path: Path) -> IO[bytes]:
    """The place of a file that is restored; sealed where this process seals, and what is its like."""
    if name.split("/")[0] in SEALED:
        return create_stored(path, PIECE)
    return path.open("xb")


def _fill(engine: Engine, lines: Iterable[bytes]) -> None:
    """Rows into the database; checksums guard against accidents, not against somebody who made them to fit."""
    try:
        database_dump.load(engine, lines)
    except (AttributeError, KeyError, StopIteration, TypeError) as problem:
        raise InputError(
            "backup.foreign_rows", error=type(problem).__name__, problem=str(problem)
        ) from problem
