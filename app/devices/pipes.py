"""Frames between the server and the process that records: a kind, a time and bytes."""

import struct
from enum import IntEnum
from typing import IO


class Kind(IntEnum):
    OPEN = 0  # server: JSON with port, recording, metadata
    SEND = 1  # server: bytes for the glove
    EVENT = 2  # server: JSON of an event to keep
    METADATA = 3  # server: JSON to keep
    QUIT = 4  # server: finish
    CHUNK = 10  # recorder: bytes from the glove, already recorded
    STATE = 11  # recorder: JSON with what became of port and file
    END = 12  # recorder, inside: nothing more to pass on


HEAD = struct.Struct("<BdI")


def read_frame(stream: IO[bytes]) -> tuple[Kind, float, bytes] | None:
    """The next frame; None when the other side is gone."""
    head = stream.read(HEAD.size)
    if head is None or len(head) < HEAD.size:
        return None
    kind, at, size = HEAD.unpack(head)
    data = stream.read(size)
    return (Kind(kind), at, data) if len(data) == size else None


def write_frame(stream: IO[bytes], kind: Kind, at: float, data: bytes = b"") -> None:
    """Send a frame at once."""
    stream.write(HEAD.pack(kind, at, len(data)) + data)
    stream.flush()
