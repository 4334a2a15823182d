"""The messages of a recorder's file in order, as far as they can be read: a cut or a flipped byte costs only the message that it hits.

A record counts when its lengths agree and a chunk's CRC is right; behind one that does not, reading goes on at the next chunk that can be found.
(mcap's own stream reader trusts every length that it meets: one flipped bit and the rest of the file is lost.)
"""

import os
import struct
import threading
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from io import BytesIO
from typing import IO, Any

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, Message
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC as MAGIC

from handscope.estimators.errors import InputError
from handscope.sessions.files.recorder import CHANNELS, CHECKPOINT, ORIGINAL, PROFILE

LARGEST = 64 * 2**20  # bytes of a record; a recorder's are a few kB
LZ4_MOST = 255  # bytes that one of lz4 becomes at most
# of unpacked to packed in a whole file, and bytes of it: a recorder's chunks hardly shrink, hours
# are less than a GB
RATIO, MOST = 20, 4 * 2**30
HEAD = 9  # bytes of a record before its content: opcode and length
RECORD = struct.Struct("<BQ")  # of every record
# of a chunk's content: times, size unpacked, CRC, letters that name its packing
CHUNK = struct.Struct("<QQQII")
LENGTH = struct.Struct("<Q")
MESSAGE = struct.Struct("<HIQQ")  # of a message's content: channel, number, times
# what stands in every chunk record of a recorder, and where
CHUNK_MARK, MARK_AT = b"\x04\0\0\0zstd", 37
_OWN = threading.local()  # of each thread
SIZES = {Opcode.DATA_END: 4, Opcode.FOOTER: 20}


@dataclass
class Findings:
    """What reading a file found out about it."""

    ours: bool = False  # a recorder began the file
    finished: bool = False  # and closed it
    damaged: int = 0  # messages missing within it
    unread: int = 0  # bytes behind the last good record
    end: int = 0  # bytes up to the end of the newest message


def read_messages(
    file: IO[bytes], found: Findings, start: int = 0
) -> Iterator[tuple[str, Message]]:
    """Messages with their topics; `found` is complete when they have been gone through.

    From the first chunk at or behind `start` on, where it is not the file's beginning: what is missing is counted from there.
    """
    size, failed = file.seek(0, os.SEEK_END), 0
    # of the next message, by whether it is an original
    numbers = {} if start else {False: 0, True: 0}
    topics: dict[int, str] = {}
    for inside in _records(file, size, found, start):
        failed += inside is None
        for record in inside or ():
            if isinstance(record, Header):
                found.ours = record.profile == PROFILE
            elif isinstance(record, Channel) and record.topic in CHANNELS:
                topics[record.id] = record.topic
            elif isinstance(record, Message) and record.channel_id in topics:
                topic = topics[record.channel_id]
                number = numbers.get(topic == ORIGINAL, record.sequence)
                missing = (record.sequence - number) % 2**32  # messages are numbered
                found.damaged += missing if missing < 2**31 else 0
                numbers[topic == ORIGINAL], failed = record.sequence + (topic != CHECKPOINT), 0
                yield topic, record
    found.damaged += failed if found.finished else 0


def find_last_chunk(file: IO[bytes], topic: str, start: int, end: int) -> int | None:
    """Where the last good chunk of a topic begins, of those that begin from `start` to before `end`."""
    size, last = file.seek(0, os.SEEK_END), None
    at = _next_chunk(file, start)
    while at is not None and at < end:
        _, after, inside = _record(file, at, size)
        if any(isinstance(record, Channel) and record.topic == topic for record in inside or ()):
            last = at
        at = after if inside is not None else _next_chunk(file, at + 1)
    return last


def _records(
    file: IO[bytes], size: int, found: Findings, start: int = 0
) -> Iterator[list[Any] | None]:
    """What each good record holds, None for one that is damaged."""
    unpacked = 0
    file.seek(0)
    begins = start == 0 and file.read(len(MAGIC)) == MAGIC
    at: int | None = len(MAGIC) if begins else _next_chunk(file, start)
    while at is not None and at < size:
        opcode, end, inside = _record(file, at, size)
        unpacked += sum(len(record.data) for record in inside or () if isinstance(record, Message))
        if unpacked > min(RATIO * size, MOST) + LARGEST:
            raise InputError(
                "recording.unpacks_too_large",
                unpacked=unpacked / 2**20,
                packed=size / 2**20,
            )
        if inside and end is not None:
            found.end = end
        yield inside
        if inside is None:
            after = _next_chunk(file, at + 1)
            at = after if after is not None or end is None else end
        else:
            assert end is not None
            at, found.unread = end, size - end
            if opcode == Opcode.FOOTER:
                found.finished, found.unread = True, 0
                return


def _record(file: IO[bytes], at: int, size: int) -> tuple[int, int | None, list[Any] | None]:
    """Opcode, where the next record begins (None where the length cannot be right) and what is inside (None where damaged)."""
    file.seek(at)
    head = file.read(HEAD)
    if len(head) < HEAD:
        return 0, None, None
    opcode, length = RECORD.unpack(head)
    if length > LARGEST or at + HEAD + length > size or length != SIZES.get(opcode, length):
        return opcode, None, None
    try:
        inside = _inside(opcode, file.read(length))
    except Exception:  # damage can fail in any length, in the CRC, the decompressor or the parser: all mean the same
        inside = None
    return opcode, at + HEAD + length, inside


def _inside(opcode: int, content: bytes) -> list[Any] | None:
    if opcode == Opcode.CHUNK:
        chunk = _chunk(content)
        if chunk is None or _unpacked_size(chunk) > LARGEST:
            return None
        records = _records_inside(chunk)
        return list(breakup_chunk(chunk, validate_crc=True)) if records is None else records
    if opcode == Opcode.HEADER:
        stream = ReadDataStream(BytesIO(content))
        header = Header.read(stream)
        return [header] if stream.count == len(content) else None
    return [] if opcode in list(Opcode) else None


def _chunk(content: bytes) -> Chunk | None:
    """The chunk record whose lengths agree with its content's."""
    start, end, unpacked, crc, letters = CHUNK.unpack_from(content)
    compression = str(content[CHUNK.size : CHUNK.size + letters], "utf-8")
    (length,) = LENGTH.unpack_from(content, CHUNK.size + letters)
    data = content[CHUNK.size + letters + LENGTH.size :]
    return Chunk(compression, data, end, start, crc, unpacked) if len(data) == length else None


def _records_inside(chunk: Chunk) -> list[Any] | None:
    """The records of a packed chunk that holds whole channels and messages and nothing else, as `breakup_chunk` has them; None for any other.

    A wrong CRC raises ValueError.
    """
    if chunk.compression != "zstd":
        return None
    data, at, found = _unpack(chunk), 0, list[Any]()
    if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise ValueError("CRC")
    while at < len(data):
        if len(data) - at < HEAD:
            return None
        opcode, length = RECORD.unpack_from(data, at)
        content = data[at + HEAD : at + HEAD + length]
        at += HEAD + length
        if at > len(data):
            return None
        if opcode == Opcode.MESSAGE and length >= MESSAGE.size:
            channel, number, logged, published = MESSAGE.unpack_from(content)
            found.append(Message(channel, logged, content[MESSAGE.size :], published, number))
        elif opcode == Opcode.CHANNEL and (known := _channel(content)) is not None:
            found.append(known)
        else:
            return None
    return found


def _unpack(chunk: Chunk) -> bytes:
    """The data of a chunk packed by zstd; a decompressor is made once a thread, which takes forty times as long as to unpack a message."""
    if not hasattr(_OWN, "decompressor"):
        _OWN.decompressor = zstandard.ZstdDecompressor()
    return bytes(_OWN.decompressor.decompress(chunk.data, chunk.uncompressed_size))


@lru_cache(maxsize=64)  # a recorder repeats the channel before every message
def _channel(content: bytes) -> Channel | None:
    """A channel whose lengths agree with its record's."""
    stream = ReadDataStream(BytesIO(content))
    channel = Channel.read(stream)
    return channel if stream.count == len(content) else None


def _unpacked_size(chunk: Chunk) -> int:
    """Bytes that the data may unpack to: a decompressor believes what the data says, were it more than there is memory."""
    if chunk.compression == "zstd":
        declared_size = zstandard.frame_content_size(chunk.data)
        # it does not say: then no more is unpacked than the chunk says
        return chunk.uncompressed_size if declared_size < 0 else int(declared_size)
    return LZ4_MOST * len(chunk.data) if chunk.compression == "lz4" else len(chunk.data)


def _next_chunk(file: IO[bytes], start: int) -> int | None:
    """Where the next chunk record begins at or behind `start`."""
    file.seek(start)
    window = b""
    while piece := file.read(2**16):
        window = window[-MARK_AT - len(CHUNK_MARK) :] + piece
        if (k := window.find(CHUNK_MARK, MARK_AT)) >= 0:
            return file.tell() - len(window) + k - MARK_AT
    return None
