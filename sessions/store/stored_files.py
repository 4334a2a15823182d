"""Kept files, wherever they are: in the data folder, in its object storage, or in the copy of that which lies in `cache/`.

A file is written into the data folder and read from there. Where an object storage is attached, `move_out` brings what is closed there; a file leaves
`recordings/` or `results/` for `cache/` only when it was read back from the storage as it is here. The cache may go at any time.
"""

import contextlib
import hashlib
import logging
import os
import time
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import select
from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.db.tables import ErasedFile, RecordingFile, Result
from handscope.sessions.files import object_storage
from handscope.sessions.files.native import file_checksum
from handscope.sessions.files.object_storage import UnreachableError
from handscope.sessions.sealing.stored import is_sealed
from handscope.sessions.store import shared_servers
from handscope.sessions.store.store import AWAY, CACHE, ELSEWHERE, FREE, Store, free_bytes

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Round:
    """What one round of moving out came to."""

    moved: int = 0
    waiting: int = 0  # files that are to go there, and those that are to be removed there
    problem: str = ""  # why the storage could not be used


def fetch_local(store: Store, file: str, sha256: str | None = None) -> Path:
    """The path of a kept file on this disk, fetched where it was moved out; of one that is nowhere the path where it should be.

    UnreachableError where the storage does not answer, InputError where what it has is not what was kept.
    """
    path, copy = store.path_of(file), store.cached(file)
    if store.away is None or path.exists():
        return path
    if not copy.exists():
        try:
            _fetch(store, file, copy, sha256)
        except FileNotFoundError:
            _require_here(store, file)
            return path
    with contextlib.suppress(OSError):
        # the cache lets go what was not read for longest
        os.utime(copy, ns=(time.time_ns(), copy.stat().st_mtime_ns))
    return copy


def files_of_result(store: Store, result_id: int) -> list[str]:
    """Names of the files that are kept of a result: `results/7.npz` and whatever else begins like that, wherever they are."""
    found = {
        path.name
        for place in (store.folder, store.folder / CACHE)
        for path in (place / "results").glob(f"{result_id}.*")
    }
    away = object_storage.names(store.away, "results", f"{result_id}.") if store.away else []
    return sorted({f"results/{name}" for name in found}.union(away))


def move_out(store: Store, cache_bytes: int) -> Round:
    """Bring what is closed into the object storage, remove there what was erased, and here what another server erased; one round, to be asked again."""
    if store.away is None:
        return Round()
    moved, problem = 0, ""
    if store.server:
        with store.database() as db:
            _remove_erased_elsewhere(db, store)
    try:
        object_storage.require(store.away)
        _remove_erased(store)
        for file, sha256 in _list_closed(store):
            moved += _move_file(store, file, sha256)
        _shrink(store, cache_bytes)
    except UnreachableError as why:
        problem = str(why)
    with store.database() as db:
        return Round(moved, len(_list_closed(store)) + len(_list_erased(db)), problem)


def _result_number(path: Path) -> int | None:
    """Which result a file is of, `results/7.npz`; None for a recording, and for a file that is being written."""
    number = path.name.split(".")[0]
    return int(number) if path.parent.name == "results" and number.isdecimal() else None


def _is_wanted(store: Store, file: str) -> bool:
    """Whether a row still refers to the file."""
    number = _result_number(Path(file))
    with store.database() as db:
        if number is not None:
            return db.get(Result, number) is not None
        return db.scalar(select(RecordingFile.id).where(RecordingFile.file == file)) is not None


def _require_here(store: Store, file: str) -> None:
    """InputError where another server has a file that is not in the object storage yet."""
    if not store.server:
        return
    number = _result_number(Path(file))
    with store.database() as db:
        holder = (
            db.scalar(select(Result.server).where(Result.id == number))
            if number is not None
            else db.scalar(select(RecordingFile.server).where(RecordingFile.file == file))
        )
        other = shared_servers.find_other(db, holder or "", store.server)
    if other is not None:
        raise InputError("store.file_at_other_server", name=other.name)


def _remove_erased_elsewhere(db: Session, store: Store) -> None:
    """Remove from this server's folder what another erased: recordings as it says, copies and results that no row refers to any more."""
    marked = ErasedFile.file.startswith(ELSEWHERE), ErasedFile.server == store.server
    for erased in list(db.scalars(select(ErasedFile).where(*marked))):
        file = erased.file.removeprefix(ELSEWHERE)
        for path in (store.path_of(file), store.cached(file)):
            path.unlink(missing_ok=True)
        db.delete(erased)
        db.commit()
    copies = list(_files(store.folder / CACHE / "recordings"))
    made = [*_files(store.folder / CACHE / "results"), *_files(store.folder / "results")]
    known = set(db.scalars(select(RecordingFile.file))) if copies else set()
    results = {*db.scalars(select(Result.id)), None} if made else set()
    unknown = [path for path in copies if f"recordings/{path.name}" not in known]
    unknown += [path for path in made if _result_number(path) not in results]
    for path in unknown:
        db.merge(ErasedFile(file=f"{AWAY}{path.parent.name}/{path.name}"))
        db.commit()
        path.unlink(missing_ok=True)


def _fetch(store: Store, file: str, copy: Path, sha256: str | None) -> None:
    assert store.away is not None
    store.require_room(FREE + object_storage.size(store.away, file))
    partial = store.incoming / f"{uuid.uuid4().hex}.partial"
    try:
        with partial.open("xb") as out:
            out.writelines(object_storage.pieces(store.away, file))
        if sha256 is not None and file_checksum(partial) != sha256:
            raise InputError("store.object_checksum_differs", file=file)
        copy.parent.mkdir(parents=True, exist_ok=True)
        os.replace(partial, copy)
    finally:
        partial.unlink(missing_ok=True)


def _move_file(store: Store, file: str, sha256: str | None) -> bool:
    """Whether a file is in the storage now and left for the cache; one that is changed or erased meanwhile stays, or stays away."""
    assert store.away is not None
    path, copy = store.path_of(file), store.cached(file)
    try:
        before, total = path.stat(), file_checksum(path)
        if sha256 not in (None, total):
            log.error(
                "%s is not what was recorded: its checksum was %s; it stays on this disk",
                file,
                sha256,
            )
            return False
        if object_storage.put(store.away, file, path) != (_sum_as_it_lies(path) or total):
            raise UnreachableError(phrase("storage.not_given_back", url=store.away.url))
        if not _is_wanted(store, file):  # erased while it was brought there
            object_storage.remove(store.away, file)
            return False
        after = path.stat()
        if (before.st_mtime_ns, before.st_size) != (after.st_mtime_ns, after.st_size):
            return False
        copy.parent.mkdir(parents=True, exist_ok=True)
        os.replace(path, copy)
    except FileNotFoundError:  # erased: the next round removes it there
        return False
    return True


def _sum_as_it_lies(path: Path) -> str:
    """sha256 of a sealed file's own bytes, which go to the storage; "" where it is not sealed."""
    if not is_sealed(path):
        return ""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _list_closed(store: Store) -> list[tuple[str, str | None]]:
    """Files that lie in the data folder and may go, with the recordings' checksums: none that is still written."""
    recordings = (
        {path.name for path in store.recordings.iterdir()} if store.recordings.is_dir() else set()
    )
    results = [
        (path.name, number)
        for path in (store.folder / "results").glob("*.npz")
        if (number := _result_number(path)) is not None
    ]
    with store.database() as db:
        query = select(RecordingFile.file, RecordingFile.sha256).where(
            RecordingFile.sha256.is_not(None)
        )
        found = [
            (file, sha256) for file, sha256 in db.execute(query) if Path(file).name in recordings
        ]
        done = (
            set(db.scalars(select(Result.id).where(Result.state == "done"))) if results else set()
        )
    return [
        *found,
        *((f"results/{name}", None) for name, number in sorted(results) if number in done),
    ]


def _list_erased(db: Session) -> list[ErasedFile]:
    return list(db.scalars(select(ErasedFile).where(ErasedFile.file.startswith(AWAY))))


def _remove_erased(store: Store) -> None:
    assert store.away is not None
    with store.database() as db:
        for erased in _list_erased(db):
            file = erased.file.removeprefix(AWAY)
            object_storage.remove(store.away, file)
            store.cached(file).unlink(missing_ok=True)
            db.delete(erased)
            db.commit()


def _shrink(store: Store, most: int) -> None:
    """Let go of what was not read for longest, until the cache is small enough and the disk has room to record."""
    lying = []
    for path in _files(store.folder / CACHE):
        with contextlib.suppress(FileNotFoundError):  # erased meanwhile
            found = path.stat()
            lying.append((found.st_atime_ns, found.st_size, path))
    cached_bytes = sum(size for _, size, _ in lying)
    for _, size, path in sorted(lying):
        if cached_bytes <= most and free_bytes(store.folder) >= 2 * FREE:
            return
        with contextlib.suppress(OSError):  # Windows: somebody reads it
            path.unlink()
            cached_bytes -= size


def _files(folder: Path) -> Iterator[Path]:
    return (path for path in folder.rglob("*") if path.is_file())
