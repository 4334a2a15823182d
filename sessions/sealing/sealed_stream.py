"""A sealed file: appended to record by record, read at any place, cut anywhere.

header    256 bytes: magic, the file's number (16), two slots of its key wrapped by a data key (keys.py), zeros
record    plaintext's place in the file (u64), its length (u32), a random nonce (12), AES-256-GCM of it with the first two authenticated

A record does not cross a multiple of SEGMENT: where none fits the rest is zeros, and every segment begins with a record, so that a place is found by
bisection. What a kill cut is the last record. A record that was changed reads as zeros: checksums and the formats inside tell.
"""

import io
import os
import struct
from bisect import bisect_right
from collections.abc import Sequence
from typing import Any

from handscope.estimators.errors import InputError
from handscope.sessions.sealing.keys import (
    NONCE,
    SIZE,
    TAG,
    WRAPPED,
    DataKey,
    cipher,
    unwrap_by_any,
)

MAGIC = b"HSSEAL1\n"
NUMBER = 16
HEADER, SEGMENT = 256, 2**20  # bytes
HEAD = struct.Struct("<QI")
OVERHEAD = HEAD.size + NONCE + TAG  # bytes of a record besides its plaintext
LEAST = 64  # bytes of plaintext for which a record is begun at a segment's end
ABOUT = len(MAGIC) + NUMBER
EMPTY = bytes(WRAPPED)


def new_header(key: DataKey) -> tuple[bytes, bytes]:
    """Header of a new file, and the file's own key."""
    about, file_key = MAGIC + os.urandom(NUMBER), os.urandom(SIZE)
    return (about + key.wrap(file_key, about)).ljust(HEADER, b"\0"), file_key


def slots_of(header: bytes) -> list[bytes]:
    """The two wrapped keys of a header."""
    return [header[ABOUT + k * WRAPPED : ABOUT + (k + 1) * WRAPPED] for k in (0, 1)]


def key_of(header: bytes, keys: Sequence[DataKey], what: str) -> bytes:
    """The file's own key; InputError where no key fits."""
    if len(header) < HEADER or header[: len(MAGIC)] != MAGIC:
        raise InputError("sealing.header_damaged", file=what)
    return unwrap_by_any(keys, slots_of(header), header[:ABOUT], what)


class SealedWriter(io.RawIOBase):
    """Seals what is written into a new, unbuffered file; each write is whole on the system's side when it returns."""

    def __init__(self, raw: io.FileIO, key: DataKey) -> None:
        self._raw = raw
        header, file_key = new_header(key)
        self._cipher = cipher(file_key)
        self._end, self._plain = HEADER, 0
        _write_all(raw, header)

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._raw.fileno()

    def tell(self) -> int:
        return self._plain

    def write(self, data: Any) -> int:
        """All of it; where the disk takes only a part the file ends as before, and OSError is raised."""
        view = memoryview(data).cast("B")
        records, end, plain = bytearray(), self._end, self._plain
        while plain - self._plain < len(view):
            room = SEGMENT - end % SEGMENT
            if room < OVERHEAD + LEAST:
                records += bytes(room)
                end += room
                continue
            at = plain - self._plain
            piece = view[at : at + room - OVERHEAD]
            head, nonce = HEAD.pack(plain, len(piece)), os.urandom(NONCE)
            records += head + nonce + self._cipher.encrypt(nonce, bytes(piece), head)
            end, plain = end + OVERHEAD + len(piece), plain + len(piece)
        try:
            _write_all(self._raw, records)
        except OSError:
            self._raw.truncate(self._end)
            self._raw.seek(self._end)
            raise
        self._end, self._plain = end, plain
        return len(view)

    def close(self) -> None:
        if not self.closed:
            super().close()
            self._raw.close()


class SealedReader(io.RawIOBase):
    """The plaintext of a sealed file, read at any place; `raw` is open for reading in binary."""

    def __init__(self, raw: Any, keys: Sequence[DataKey], what: str) -> None:
        self._raw = raw
        self._cipher = cipher(key_of(raw.read(HEADER), keys, what))
        self._size = raw.seek(0, os.SEEK_END)
        self._at = 0
        self._segment: tuple[int, list[tuple[int, int, int]]] = (-1, [])
        self._opened: tuple[int, bytes] = (-1, b"")
        self._length = self._find_length()

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def fileno(self) -> int:
        return int(self._raw.fileno())

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._length}[whence]
        if base + offset < 0:
            raise OSError(22, "Invalid argument")
        self._at = base + offset
        return self._at

    def tell(self) -> int:
        return self._at

    def readinto(self, buffer: Any) -> int:
        view = memoryview(buffer).cast("B")
        wanted = max(0, min(len(view), self._length - self._at))
        done = 0
        while done < wanted:
            start, data = self._record_at(self._at)
            piece = data[self._at - start :][: wanted - done]
            view[done : done + len(piece)] = piece
            self._at, done = self._at + len(piece), done + len(piece)
        return done

    def close(self) -> None:
        if not self.closed:
            super().close()
            self._raw.close()

    def _record_at(self, place: int) -> tuple[int, bytes]:
        """Where the record with a place of the plaintext begins, and its plaintext; zeros where it cannot be read."""
        start, data = self._opened
        if start <= place < start + len(data):
            return self._opened
        k, records = self._segment
        if not (records and records[0][0] <= place < records[-1][0] + records[-1][2]):
            k = self._segment_with(place)
            records = self._records(k)
        i = bisect_right(records, place, key=_place_of) - 1
        if i >= 0 and place < records[i][0] + records[i][2]:
            self._opened = records[i][0], self._open(*records[i])
            return self._opened
        # lost: zeros up to what is known again
        end = min([self._first(k + 1, self._length), *(r[0] for r in records if r[0] > place)])
        return place, bytes(max(1, min(end - place, SEGMENT)))

    def _open(self, plain: int, at: int, length: int) -> bytes:
        self._raw.seek(at + HEAD.size)
        nonce, sealed = self._raw.read(NONCE), self._raw.read(length + TAG)
        try:
            return bytes(self._cipher.decrypt(nonce, sealed, HEAD.pack(plain, length)))
        except Exception:  # InvalidTag, of an optional package: the record was changed
            return bytes(length)

    def _segment_with(self, place: int) -> int:
        """The last segment that begins at or before a place of the plaintext."""
        low, high = 0, (self._size - 1) // SEGMENT
        while low < high:
            middle = (low + high + 1) // 2
            if self._first(middle, self._length + 1) <= place:
                low = middle
            else:
                high = middle - 1
        return low

    def _first(self, k: int, otherwise: int) -> int:
        """Where a segment's plaintext begins; `otherwise` where it has none."""
        if k == 0:
            return 0
        while k * SEGMENT < self._size:
            self._raw.seek(k * SEGMENT)
            head = self._raw.read(HEAD.size)
            plain, length = HEAD.unpack(head) if len(head) == HEAD.size else (0, 0)
            if 0 < length <= SEGMENT and 0 < plain < k * SEGMENT:
                return int(plain)
            k += 1  # its beginning is damaged
        return otherwise

    def _records(self, k: int) -> list[tuple[int, int, int]]:
        """Of a segment's whole records: place in the plaintext, place in the file, length."""
        if self._segment[0] == k:
            return self._segment[1]
        start = max(HEADER, k * SEGMENT)
        self._raw.seek(start)
        content = self._raw.read((k + 1) * SEGMENT - start)
        found, at = list[tuple[int, int, int]](), 0
        while at + OVERHEAD <= len(content):
            plain, length = HEAD.unpack_from(content, at)
            follows = not found or plain == found[-1][0] + found[-1][2]
            if not length or not follows or at + OVERHEAD + length > len(content):
                break
            found.append((plain, start + at, length))
            at += OVERHEAD + length
        self._segment = k, found
        return found

    def _find_length(self) -> int:
        """Bytes of the plaintext up to the end of the last whole record."""
        for k in range((self._size - 1) // SEGMENT, -1, -1):
            if records := self._records(k):
                return records[-1][0] + records[-1][2]
        return 0


def _place_of(record: tuple[int, int, int]) -> int:
    return record[0]


def _write_all(raw: io.FileIO, data: bytes | bytearray) -> None:
    view = memoryview(data)
    while view:
        view = view[raw.write(view) or 0 :]
