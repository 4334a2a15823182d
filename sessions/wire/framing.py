"""Frames on the wire: bytes cut anywhere become messages, and whatever goes wrong is counted.

A frame is COBS(type u8, sequence u16, payload, CRC-32) and a zero byte. After garbage the next zero byte is the next chance: nothing needs a restart.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, fields

from cobs import cobs

from handscope.sessions.wire.messages import BadPayloadError, Identity, Message, decode, encode
from handscope.sessions.wire.stuffing import unstuff

LONGEST = 4096  # bytes of a frame on the wire; more without a zero byte is garbage. A burst of 3 sensors, 6 axes of 4 bytes, has 72 a sample
LONGEST_REFUSAL = 200  # letters
REORDER = 1000  # a sequence number further back than this is a gap forward, not an old frame


@dataclass(frozen=True)
class Counters:
    """What the decoder has met since it began."""

    frames: int = 0  # good ones
    lost: int = 0  # missing by their sequence numbers
    repeated: int = 0  # came again or late, dropped
    corrupt: int = 0  # COBS, length or CRC wrong
    malformed: int = 0  # CRC right, but no message of this version
    garbage_bytes: int = 0  # bytes of corrupt frames and of what was no frame at all


class Decoder:
    """Takes bytes cut anywhere, gives messages in order; a frame that came before is dropped."""

    def __init__(self, ordered: bool = True) -> None:
        """A device's end is not `ordered`: a host that began again numbers its commands anew, and a command may come twice without harm."""
        self._counts = dict.fromkeys((f.name for f in fields(Counters)), 0)
        self._ordered = ordered
        self.refusal = ""  # why the newest malformed message was left out
        self._rest = b""
        self._skipping = False
        self._sequence: int | None = None
        self._boot: int | None = None

    @property
    def counters(self) -> Counters:
        return Counters(**self._counts)

    def feed(self, chunk: bytes) -> Iterator[Message]:
        """Messages completed by this chunk."""
        *frames, self._rest = (self._rest + chunk).split(b"\0")
        for frame in frames:
            if self._skipping:  # the tail of something too long to be a frame
                self._count(garbage_bytes=len(frame) + 1)
                self._skipping = False
            elif frame:
                message = self._open(frame)
                if message is not None:
                    yield message
        if len(self._rest) > LONGEST:
            self._count(corrupt=0 if self._skipping else 1, garbage_bytes=len(self._rest))
            self._rest, self._skipping = b"", True

    def _open(self, frame: bytes) -> Message | None:
        body = unstuff(frame) if len(frame) <= LONGEST else None
        if (
            body is None
            or len(body) < 7
            or zlib.crc32(body[:-4]) != struct.unpack("<I", body[-4:])[0]
        ):
            self._count(corrupt=1, garbage_bytes=len(frame) + 1)
            return None
        code, sequence = struct.unpack_from("<BH", body)
        try:
            message = decode(code, body[3:-4])
        except BadPayloadError as problem:
            self.refusal = str(problem)[:LONGEST_REFUSAL]
            self._count(malformed=1)
            message = None
        if isinstance(message, Identity) and message.boot_id != self._boot:
            self._boot, self._sequence = message.boot_id, None  # the device began again
        if self._ordered and not self._in_order(sequence):
            return None
        if message is not None:
            self._count(frames=1)
        return message

    def _in_order(self, sequence: int) -> bool:
        if self._sequence is not None:
            ahead = (sequence - self._sequence) % 65536
            if ahead == 0 or ahead >= 65536 - REORDER:
                self._count(repeated=1)
                return False
            self._count(lost=ahead - 1)
        self._sequence = sequence
        return True

    def _count(self, **more: int) -> None:
        for name, n in more.items():
            self._counts[name] += n


class Encoder:
    """Gives frames to messages, numbered in order."""

    def __init__(self) -> None:
        self._sequence = 0

    def frame(self, message: Message) -> bytes:
        """The bytes to send, zero byte included."""
        code, payload = encode(message)
        body = struct.pack("<BH", code, self._sequence) + payload
        self._sequence = (self._sequence + 1) % 65536
        return bytes(cobs.encode(body + struct.pack("<I", zlib.crc32(body)))) + b"\0"
