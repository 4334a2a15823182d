"""A recording that would unpack to more than there is memory is refused or read around, in little memory and time."""

import struct
import tracemalloc
import zlib
from pathlib import Path

import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk, Message

from handscope.estimators.errors import InputError
from handscope.sessions.files import native
from handscope.sessions.files.recorder import CHANNELS, Recorder
from handscope.sessions.formats import recordings as formats_recordings

MB = 2**20


def record(*records: object) -> bytes:
    builder = RecordBuilder()
    for one in records:
        one.write(builder)  # type: ignore[attr-defined]
    return bytes(builder.end())


def chunk(packed: bytes, size: int, crc: int, compression: str = "zstd") -> bytes:
    return record(
        Chunk(
            compression=compression,
            data=packed,
            message_start_time=0,
            message_end_time=0,
            uncompressed_crc=crc,
            uncompressed_size=size,
        )
    )


def recorded(tmp_path: Path, inside: bytes) -> Path:
    path = tmp_path / f"{len(list(tmp_path.iterdir()))}.mcap"
    with Recorder(path, {"hand": "left"}, 100.0):
        pass
    whole = path.read_bytes()
    end = whole.rindex(b"\x0f" + struct.pack("<Q", 4))  # DataEnd
    path.write_bytes(whole[:end] + inside + whole[end:])
    return path


def peak(path: Path) -> int:
    tracemalloc.start()
    try:
        with pytest.raises(InputError):
            formats_recordings.load(path, "left")
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_message_of_a_gigabyte_of_nothing_is_not_unpacked(tmp_path: Path) -> None:
    pack = zstandard.ZstdCompressor(level=1).compressobj(size=1024 * MB)
    packed = b"".join(pack.compress(bytes(8 * MB)) for _ in range(128)) + pack.flush()
    assert len(packed) < MB
    assert peak(recorded(tmp_path, chunk(packed, 2**30, 0))) < 16 * MB
    assert (
        peak(recorded(tmp_path, chunk(packed, 100, 0))) < 16 * MB
    )  # the chunk says another size than its data


def test_a_frame_that_does_not_say_its_size_unpacks_to_no_more_than_the_chunk_says(
    tmp_path: Path,
) -> None:
    pack = zstandard.ZstdCompressor(level=1).compressobj()
    packed = b"".join(pack.compress(bytes(8 * MB)) for _ in range(32)) + pack.flush()
    assert peak(recorded(tmp_path, chunk(packed, 1000, 0))) < 16 * MB


def test_many_small_chunks_that_unpack_to_much_are_refused(tmp_path: Path) -> None:
    content = record(
        CHANNELS["wire"],
        Message(channel_id=1, log_time=0, data=bytes(8 * MB), publish_time=0, sequence=1),
    )
    one = chunk(zstandard.compress(content), len(content), zlib.crc32(content))
    with pytest.raises(InputError, match="no glove sends that, it was not opened"):
        native.read(recorded(tmp_path, one * 40))
