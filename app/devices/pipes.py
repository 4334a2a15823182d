"""Frames between the server and the process that records: a kind, a time and bytes."""

import struct
from collections.abc import Iterator
from enum import IntEnum
from io import BufferedReader
from typing import IO


class Kind(IntEnum):
    """What a frame between the processes holds."""

    OPEN = 0  # server: JSON with port, recording, metadata
    SEND = 1  # server: bytes for the glove
    EVENT = 2  # server: JSON of an event to keep
    METADATA = 3  # server: JSON to keep
    QUIT = 4  # server: finish
    RELAYED = 5  # server: bytes that a browser read from its port, with their arrival
    PLACES = 7  # server: JSON of which sensor of a source sits on which segment
    RELAY_LINE = 6  # server: JSON with whether the browser's port is open
    CHUNK = 10  # recorder: bytes from the glove, already recorded
    STATE = 11  # recorder: JSON with what became of port and file
    END = 12  # recorder, inside: nothing more to pass on
    KEPT = 13  # recorder: JSON with how many RELAYED are on the disk
    TRACKERS = 15  # recorder: JSON of a source's sensors, a row each
    TO_PORT = 14  # recorder: bytes for the browser's port, already recorded


HEAD = struct.Struct("<BdI")
AT_ONCE = 65536  # bytes, what a pipe holds
Frame = tuple[Kind, float, bytes]


def read_frame(stream: IO[bytes]) -> Frame | None:
    """The next frame; None when the other side is gone."""
    head = stream.read(HEAD.size)
    if head is None or len(head) < HEAD.size:
        return None
    kind, at, size = HEAD.unpack(head)
    data = stream.read(size)
    return (Kind(kind), at, data) if len(data) == size else None


def frames_that_wait(stream: BufferedReader) -> Iterator[list[Frame]]:
    """All frames that are there, as soon as there is one; ends when the other side is gone. Nobody else may read the stream."""
    rest = b""
    while data := stream.read1(AT_ONCE):
        frames, rest = _cut(rest + data)
        if frames:
            yield frames


def _cut(data: bytes) -> tuple[list[Frame], bytes]:
    """Whole frames, and the beginning of the one behind them."""
    frames: list[Frame] = []
    first = 0
    while len(data) - first >= HEAD.size:
        kind, at, size = HEAD.unpack_from(data, first)
        begin, end = first + HEAD.size, first + HEAD.size + size
        if end > len(data):
            break
        frames.append((Kind(kind), at, data[begin:end]))
        first = end
    return frames, data[first:]


def write_frame(stream: IO[bytes], kind: Kind, at: float, data: bytes = b"") -> None:
    """Send a frame at once."""
    stream.write(HEAD.pack(kind, at, len(data)) + data)
    stream.flush()
