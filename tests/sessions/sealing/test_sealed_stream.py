"""A sealed file reads as what was written, at any place, cut anywhere, and only by its key."""

import errno
import io
import random
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handscope.estimators.errors import InputError
from handscope.sessions.sealing.keys import DataKey
from handscope.sessions.sealing.sealed_stream import HEADER, SEGMENT, SealedReader, SealedWriter

KEY = DataKey(bytes(range(32)))
SIZES = st.sampled_from([0, 1, 50, 3000, SEGMENT - 400, SEGMENT - 300, SEGMENT, 2 * SEGMENT + 7])


class Disk(io.BytesIO):
    """A file that takes `room` bytes and then says that the disk is full."""

    room = 10**9

    def write(self, data: object) -> int:
        piece = bytes(memoryview(data))[: max(0, self.room - self.tell())]  # type: ignore[arg-type]
        if not piece and len(memoryview(data)):  # type: ignore[arg-type]
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(piece)


def _sealed(pieces: list[bytes]) -> bytes:
    disk = Disk()
    writer = SealedWriter(disk, KEY)  # type: ignore[arg-type]
    for piece in pieces:
        assert writer.write(piece) == len(piece)
    return disk.getvalue()


def _reader(data: bytes, key: DataKey = KEY) -> io.BufferedReader:
    return io.BufferedReader(SealedReader(io.BytesIO(data), [key], "a file"), 4096)


def _pieces(sizes: list[int]) -> list[bytes]:
    rng = random.Random(17)
    return [rng.randbytes(size) for size in sizes]


@settings(max_examples=30, deadline=None)
@given(st.lists(SIZES, max_size=6), st.randoms(use_true_random=False))
def test_what_was_written_is_read_at_any_place(sizes: list[int], rng: random.Random) -> None:
    pieces = _pieces(sizes)
    whole, reader = b"".join(pieces), _reader(_sealed(pieces))
    assert reader.read() == whole
    for _ in range(5):
        start = rng.randint(0, len(whole))
        reader.seek(start)
        assert reader.read(5000) == whole[start : start + 5000]


@settings(max_examples=30, deadline=None)
@given(st.floats(0.0, 1.0))
def test_a_cut_file_reads_up_to_its_last_whole_record(share: float) -> None:
    pieces = _pieces([400] * 20 + [SEGMENT] + [400] * 20)
    data, ends = _sealed(pieces), {sum(map(len, pieces[:k])) for k in range(len(pieces) + 1)}
    kept = HEADER + round(share * (len(data) - HEADER))
    found = _reader(data[:kept]).read()
    assert b"".join(pieces).startswith(found)
    assert len(found) >= kept - HEADER - SEGMENT - 2000
    if kept < SEGMENT // 2:
        assert len(found) in ends


def test_a_record_that_was_changed_reads_as_zeros_and_the_others_as_they_are() -> None:
    pieces = _pieces([1000] * 5)
    data = bytearray(_sealed(pieces))
    data[HEADER + 2 * (1000 + 40) + 300] ^= 1
    pieces[2] = bytes(1000)
    assert _reader(bytes(data)).read() == b"".join(pieces)


def test_a_damaged_segment_costs_no_other() -> None:
    pieces = _pieces([100_000] * 40)
    data = bytearray(_sealed(pieces))
    data[SEGMENT : SEGMENT + 12] = bytes(12)
    found, whole = _reader(bytes(data)).read(), b"".join(pieces)
    assert len(found) == len(whole)
    assert found[: SEGMENT // 2] == whole[: SEGMENT // 2]
    assert found[-SEGMENT:] == whole[-SEGMENT:]


def test_another_key_opens_nothing_and_no_plaintext_lies_there() -> None:
    data = _sealed([b"zinnober" * 1000])
    assert b"zinnober" not in data
    with pytest.raises(InputError, match="key"):
        _reader(data, DataKey(bytes(32)))


def test_after_a_full_disk_the_file_goes_on_where_it_was(tmp_path: Path) -> None:
    disk = Disk()
    writer = SealedWriter(disk, KEY)  # type: ignore[arg-type]
    writer.write(b"a" * 500)
    disk.room = disk.tell() + 100
    with pytest.raises(OSError, match="No space"):
        writer.write(b"b" * 500)
    disk.room = 10**9
    writer.write(b"c" * 500)
    assert _reader(disk.getvalue()).read() == b"a" * 500 + b"c" * 500
