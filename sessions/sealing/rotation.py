"""Another data key for sealed files, and sealing for those that lie there plain.

A file's own key is wrapped anew, in the other of its header's two slots, and the earlier one is emptied when that is on the disk: what is in the file is not
written again, and a kill at any moment leaves a file that one of the keys opens.
"""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO

from handscope.sessions.sealing.keys import NAME, WRAPPED, DataKey
from handscope.sessions.sealing.sealed_stream import ABOUT, EMPTY, HEADER, key_of, slots_of
from handscope.sessions.sealing.stored import COPIED, create_stored, is_sealed, open_stored

SEALED = ("recordings", "results", "cache")  # folders of the data folder whose files are sealed


def stored_files(folder: Path) -> Iterator[Path]:
    """Every file of the data folder that a data key seals."""
    for name in SEALED:
        yield from sorted(p for p in (folder / name).rglob("*") if p.is_file())


def change_key(path: Path, keys: Sequence[DataKey], new: DataKey) -> bool:
    """Whether a sealed file was of another key and is of the new one now; InputError where no key opens it."""
    with path.open("r+b", buffering=0) as file:
        header = file.read(HEADER)
        for place, slot in _changes(header, keys, new, path.name):
            file.seek(place)
            file.write(slot)
            os.fsync(file.fileno())
    return slots_of(header) != [] and not _is_of(header, new)


def change_key_of_bytes(data: bytes, keys: Sequence[DataKey], new: DataKey) -> bytes:
    """The same for sealed bytes of the database."""
    held = bytearray(data)
    for place, slot in _changes(data[:HEADER], keys, new, "a picture"):
        held[place : place + WRAPPED] = slot
    return bytes(held)


def seal_file(path: Path) -> bool:
    """Whether a plain file was sealed, in its place, by the first key of this process; what it was is gone when the sealed one is read back."""
    if is_sealed(path):
        return False
    partial = path.with_name(f".{path.name}.partial")
    partial.unlink(missing_ok=True)
    try:
        with path.open("rb") as file, create_stored(partial, COPIED) as out:
            while piece := file.read(COPIED):
                out.write(piece)
            out.flush()
            os.fsync(out.fileno())
        with path.open("rb") as before, open_stored(partial) as after:
            _require_equal(before, after)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    return True


def _changes(
    header: bytes, keys: Sequence[DataKey], new: DataKey, what: str
) -> Iterator[tuple[int, bytes]]:
    """Places and contents of the slots, in the order in which they are written."""
    file_key = key_of(header, [new, *keys], what)
    slots = slots_of(header)
    names = [slot[:NAME] for slot in slots]
    into = (
        names.index(new.name) if new.name in names else slots.index(EMPTY) if EMPTY in slots else 1
    )
    if names[into] != new.name:
        yield ABOUT + into * WRAPPED, new.wrap(file_key, header[:ABOUT])
    if slots[1 - into] != EMPTY:
        yield ABOUT + (1 - into) * WRAPPED, EMPTY


def _is_of(header: bytes, key: DataKey) -> bool:
    return {slot for slot in slots_of(header) if slot != EMPTY} == {
        slot for slot in slots_of(header) if slot[:NAME] == key.name
    }


def _require_equal(one: IO[bytes], other: IO[bytes]) -> None:
    while piece := one.read(COPIED):
        assert other.read(len(piece)) == piece, "a sealed file does not read as what was sealed"
    assert not other.read(1)
