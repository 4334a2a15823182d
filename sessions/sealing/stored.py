"""The one door to files of the data folder: sealed ones are opened by the keys of this process, new ones sealed where there is one (keys.py)."""

import io
import os
import shutil
from contextlib import suppress
from pathlib import Path
from typing import IO, BinaryIO, cast

from handscope.sessions.sealing.keys import keys_of_this_process
from handscope.sessions.sealing.sealed_stream import MAGIC, SealedReader, SealedWriter

BUFFER = 2**16  # bytes read at a time
COPIED = 2**20  # bytes copied at a time


def is_sealing() -> bool:
    """Whether what this process stores from now on is sealed."""
    return bool(keys_of_this_process())


def is_sealed(path: Path) -> bool:
    """Whether a file lies there sealed."""
    with suppress(OSError), path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC
    return False


def is_sealed_data(data: bytes) -> bool:
    """The same of bytes."""
    return data.startswith(MAGIC)


def open_stored(path: Path) -> BinaryIO:
    """A stored file's bytes, plain or unsealed, at any place; InputError where no key fits."""
    file = path.open("rb")
    try:
        return unsealed(file, path.name)
    except BaseException:
        file.close()
        raise


def unsealed(file: IO[bytes], what: str) -> BinaryIO:
    """The same of a file that is open at its beginning."""
    sealed = file.read(len(MAGIC)) == MAGIC
    file.seek(0)
    if not sealed:
        return cast(BinaryIO, file)
    reader = SealedReader(file, keys_of_this_process(), what)
    return cast(BinaryIO, io.BufferedReader(reader, BUFFER))


def read_stored(path: Path) -> bytes:
    """All of a small file."""
    with open_stored(path) as file:
        return file.read()


def create_stored(path: Path, buffer: int) -> BinaryIO:
    """A new file to append to; FileExistsError where there is one."""
    keys = keys_of_this_process()
    if not keys:
        return path.open("xb", buffering=buffer)
    raw = path.open("xb", buffering=0)
    return cast(BinaryIO, io.BufferedWriter(SealedWriter(raw, keys[0]), buffer))


def continue_stored(path: Path, end: int, buffer: int) -> BinaryIO:
    """A stored file to append to behind `end` bytes of its content, the rest of which goes; InputError where no key fits.

    A sealed one is sealed anew up to there beside it and takes its place at once: a record of it cannot be cut.
    """
    if not is_sealed(path):
        file = path.open("r+b", buffering=buffer)
        file.seek(end)
        file.truncate()
        return file
    partial = path.with_name(f".{path.name}.partial")
    partial.unlink(missing_ok=True)
    try:
        target = create_stored(partial, buffer)
        try:
            _copy(path, end, target)
            os.replace(partial, path)
        except BaseException:
            with suppress(
                OSError
            ):  # of what it has yet to write: the first error says what happened
                target.close()
            raise
        return target
    finally:
        partial.unlink(missing_ok=True)


def _copy(path: Path, end: int, target: BinaryIO) -> None:
    """The first `end` bytes of a stored file's content, on the disk when this returns."""
    left = end
    with open_stored(path) as whole:
        while piece := whole.read(min(COPIED, left)):
            target.write(piece)
            left -= len(piece)
    target.flush()
    os.fsync(target.fileno())


def write_stored(data: bytes, path: Path) -> None:
    """Write one file whole or not at all."""
    partial = path.with_name(f".{path.name}.partial")
    partial.unlink(missing_ok=True)
    try:
        with create_stored(partial, max(1, len(data))) as file:
            file.write(data)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def store_file(source: Path, target: Path) -> None:
    """Move a file to where it is stored; sealed where this process seals, and then on the disk before the source goes."""
    if not is_sealing():
        shutil.move(source, target)
        return
    try:
        with source.open("rb") as file, create_stored(target, COPIED) as out:
            shutil.copyfileobj(file, out, COPIED)
            out.flush()
            os.fsync(out.fileno())
    except BaseException:
        target.unlink(missing_ok=True)
        raise
    source.unlink()


def seal_bytes(data: bytes) -> bytes:
    """Bytes as they may lie in the database: sealed where this process seals."""
    keys = keys_of_this_process()
    if not keys:
        return data
    held = io.BytesIO()
    writer = SealedWriter(cast(io.FileIO, held), keys[0])
    writer.write(data)
    return held.getvalue()


def unseal_bytes(data: bytes) -> bytes:
    """The same back, and bytes that were never sealed as they are."""
    with unsealed(io.BytesIO(data), "a picture") as file:
        return file.read()
