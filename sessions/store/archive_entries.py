"""Files of a backup's archive, piece by piece, compared with their checksums."""

import hashlib
import os
import zipfile
from collections.abc import Iterable, Iterator
from typing import IO, Any

from handscope.estimators.errors import InputError

PIECE = 2**20  # bytes


def read_entry(archive: zipfile.ZipFile, name: str) -> Iterator[bytes]:
    """A file's bytes; BadZipFile also where the archive points outside itself, or its disk does not give them."""
    try:
        with archive.open(name) as file:
            yield from pieces_of(file)
    except OSError as problem:
        raise zipfile.BadZipFile(f"{name}: {problem.strerror}") from problem


def write_pieces(pieces: Iterable[bytes], target: IO[bytes]) -> Iterator[bytes]:
    """Pass the pieces on as they are written; they are on the disk at the end."""
    for piece in pieces:
        target.write(piece)
        yield piece
    target.flush()
    os.fsync(target.fileno())


def require_checksum(name: str, entry: dict[str, Any], pieces: Iterable[bytes]) -> None:
    """InputError where the pieces are not those of the manifest's entry."""
    total = hashlib.sha256()
    for piece in pieces:
        total.update(piece)
    if total.hexdigest() != entry["sha256"]:
        raise InputError("backup.checksum_differs", name=name)


def pieces_of(file: IO[bytes]) -> Iterator[bytes]:
    """A file's bytes."""
    while piece := file.read(PIECE):
        yield piece
