"""Files of a folder or a zip by their relative path, nothing trusted: a zip may climb out of its folder, lie about its size or be cut."""

import hashlib
import lzma
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path, PurePosixPath

from handscope.estimators.errors import InputError
from handscope.sessions.sealing.stored import open_stored

MOST_FILES = 10_000
# of all files together: an hour of 17 sensors at 1 kHz as text is about 3.5 GB
MOST_BYTES = 4 * 2**30
MOST_RATIO = 400  # of unpacked to packed; numbers as text stay below 20
WANTED = (".tsv", ".json")
PIECE = 2**20  # bytes read at a time: a recording is never as a whole in memory as text
Pieces = Callable[[], Iterator[bytes]]  # opens a file and gives its bytes
Files = Mapping[str, Pieces]  # by relative path


def open_files(path: Path) -> Files:
    """Readers of the .tsv and .json files by relative path; InputError where the place is no folder or zip that can be read."""
    if path.is_dir():
        return _folder(path)
    if not path.exists():
        raise InputError("motion_bids.does_not_exist", name=str(path))
    if not _is_zip(path):
        with open_stored(path) as file:
            begins_like_zip = file.read(4) == b"PK\x03\x04"
        if begins_like_zip:
            raise InputError("motion_bids.zip_cut_off", name=path.name)
        raise InputError("motion_bids.not_a_recording", name=path.name)
    return _zip(path)


def whole(file: Pieces) -> bytes:
    """All of a small file."""
    return b"".join(file())


def with_checksum(files: Files) -> tuple[Files, Callable[[], str]]:
    """The same files, and the sha256 over their names and contents in order of name; what is read of
    them on the way is not read once more for it."""
    left, total = sorted(files), hashlib.sha256()

    def read(name: str) -> Iterator[bytes]:
        nonlocal total
        if name not in left:
            yield from files[name]()
            return
        while left[0] != name:
            _exhaust(read(left[0]))
        running = total.copy()
        running.update(name.encode() + b"\0")
        for piece in files[name]():
            running.update(piece)
            yield piece
        if left[:1] == [name]:  # read to its end, and by nobody else meanwhile
            left.pop(0)
            total = running

    def checksum() -> str:
        while left:
            _exhaust(read(left[0]))
        return total.hexdigest()

    return {name: partial(read, name) for name in files}, checksum


def _exhaust(pieces: Iterator[bytes]) -> None:
    for _ in pieces:
        pass


def _is_zip(path: Path) -> bool:
    try:
        with open_stored(path) as file:
            return zipfile.is_zipfile(file)
    except zipfile.BadZipFile:  # one that names further disks
        return False


def _folder(path: Path) -> dict[str, Pieces]:
    found = sorted(
        p
        for p in path.rglob("*")
        if p.suffix in WANTED and p.is_file() and p.resolve().is_relative_to(path.resolve())
    )
    if len(found) > MOST_FILES:
        raise InputError("motion_bids.folder_too_many_files", name=str(path), most=MOST_FILES)
    return {p.relative_to(path).as_posix(): partial(_of_file, p) for p in found}


def _of_file(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        yield from iter(partial(file.read, PIECE), b"")


def _zip(path: Path) -> dict[str, Pieces]:
    try:
        with open_stored(path) as file, zipfile.ZipFile(file) as archive:
            # is_dir() fails on a name without a letter
            entries = [entry for entry in archive.infolist() if not entry.filename.endswith("/")]
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        raise InputError("motion_bids.zip_damaged", name=path.name) from None
    _refuse_tricks(path.name, entries)
    return {
        e.filename: partial(_unpack, path, e)
        for e in entries
        if PurePosixPath(e.filename).suffix in WANTED and not e.filename.startswith("__MACOSX/")
    }


def _refuse_tricks(name: str, entries: list[zipfile.ZipInfo]) -> None:
    if len(entries) > MOST_FILES:
        raise InputError(
            "motion_bids.zip_too_many_files", name=name, count=len(entries), most=MOST_FILES
        )
    for entry in entries:
        parts = PurePosixPath(entry.filename.replace("\\", "/")).parts
        if (
            ".." in parts
            or entry.filename.startswith(("/", "\\"))
            or ":" in entry.filename.split("/")[0]
        ):
            raise InputError("motion_bids.zip_path_outside", name=name, file=entry.filename)
        if entry.external_attr >> 28 == 0xA:
            raise InputError("motion_bids.zip_link", name=name, file=entry.filename)
        if entry.flag_bits & 1:
            raise InputError("motion_bids.zip_encrypted", name=name)
        if entry.file_size > MOST_RATIO * max(entry.compress_size, 1) and entry.file_size > 2**20:
            raise InputError(
                "motion_bids.zip_compression_ratio",
                name=name,
                file=entry.filename,
                size=entry.file_size / 2**20,
                bytes=entry.compress_size,
            )
    total = sum(entry.file_size for entry in entries)
    if total > MOST_BYTES:
        raise InputError(
            "motion_bids.zip_too_large", name=name, size=total / 2**30, most=MOST_BYTES / 2**30
        )


def _unpack(path: Path, entry: zipfile.ZipInfo) -> Iterator[bytes]:
    length = 0
    try:
        with (
            open_stored(path) as stored,
            zipfile.ZipFile(stored) as archive,
            archive.open(entry) as file,
        ):
            for piece in iter(partial(file.read, PIECE), b""):
                length += len(piece)
                if length > entry.file_size:
                    raise InputError(
                        "motion_bids.zip_wrong_size", name=path.name, file=entry.filename
                    )
                yield piece
    except (
        zipfile.BadZipFile,
        zlib.error,
        lzma.LZMAError,
        EOFError,
        OSError,
        NotImplementedError,
        RuntimeError,
        UnicodeDecodeError,  # of a name beside the contents
    ):
        raise InputError(
            "motion_bids.zip_file_damaged", name=path.name, file=entry.filename
        ) from None
