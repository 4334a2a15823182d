"""What a browser sends of its port: numbered messages with the browser's time, and the limits that hold for them.

In      binary web socket messages: number u64, time f64 (ms since 1970 by the browser's clock), bytes of the port; little-endian
Out     values; arrival times on this machine's monotonic clock
"""

import json
import math
import struct
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

HEAD = struct.Struct("<Qd")
LARGEST = 65536  # bytes of the port in one message
LONGEST_WORDS = 1000  # characters of a JSON message
LATEST = 1e15  # ms since 1970 that a clock may say, before or after
MOST_WAITING = 8 * 2**20  # bytes taken and not yet on the disk; then nothing more is read
BYTES_PER_S, MOST_BYTES = 4e6, 16e6  # on average, and at once: a glove sends 0.5 MB/s at most
MESSAGES_PER_S, MOST_MESSAGES = 500.0, 4000.0


class MalformedError(Exception):
    """A message that is none."""


class TooLargeError(Exception):
    """A message with more bytes than one may have."""


@dataclass(frozen=True)
class Hello:
    """A browser's first message."""

    token: str
    now: float  # s since 1970, browser's clock


@dataclass(frozen=True)
class Chunk:
    """Bytes of one message."""

    number: int  # of the message in its session, from 0
    time: float  # s since 1970, browser's clock
    data: bytes


def parse_chunk(message: bytes) -> Chunk:
    """A binary message taken apart; MalformedError, TooLargeError."""
    if len(message) > HEAD.size + LARGEST:
        raise TooLargeError
    if len(message) <= HEAD.size:
        raise MalformedError
    number, ms = HEAD.unpack_from(message)
    return Chunk(number, _seconds(ms), message[HEAD.size :])


def parse_words(text: str | None) -> Mapping[str, Any]:
    """A JSON message, an object; MalformedError."""
    if text is None or len(text) > LONGEST_WORDS:
        raise MalformedError
    try:
        words = json.loads(text)
    except (ValueError, RecursionError):
        raise MalformedError from None
    if not isinstance(words, dict):
        raise MalformedError
    return words


def parse_hello(words: Mapping[str, Any]) -> Hello:
    """The first message; MalformedError where its clock is no number."""
    try:
        ms = float(words.get("now", 0.0))
    except (ValueError, TypeError, OverflowError):
        raise MalformedError from None
    return Hello(str(words.get("token", "")), _seconds(ms))


def _seconds(ms: float) -> float:
    """A browser's time; MalformedError where no clock says it."""
    if not abs(ms) <= LATEST:
        raise MalformedError
    return ms * 1e-3


class BrowserClock:
    """The browser's times on this machine's monotonic clock, for one connection.

    The least delayed message sets the offset: what waited while the connection was away keeps the time at which it was read.
    """

    def __init__(self, sent: float, now: float, newest: float = -math.inf) -> None:
        """`sent` s by the browser's clock arrived at `now`; no time comes before `newest`."""
        self._offset, self._newest = now - sent, newest

    def arrival(self, sent: float, now: float) -> float:
        """When bytes that the browser read at `sent` would have arrived here, s in whole ns."""
        self._offset = min(self._offset, now - sent)
        self._newest = max(self._newest, min(sent + self._offset, now))
        return round(self._newest * 1e9) * 1e-9


@dataclass
class Pace:
    """How long a sender has to wait so that bytes and messages a second stay bounded (token bucket)."""

    clock: Callable[[], float] = time.monotonic
    _bytes: float = MOST_BYTES
    _messages: float = MOST_MESSAGES
    _since: float = field(init=False)

    def __post_init__(self) -> None:
        self._since = self.clock()

    def wait(self, size: int) -> float:
        """Seconds until the next message may be read, after one of `size` bytes."""
        now = self.clock()
        passed, self._since = now - self._since, now
        self._bytes = min(MOST_BYTES, self._bytes + BYTES_PER_S * passed) - size
        self._messages = min(MOST_MESSAGES, self._messages + MESSAGES_PER_S * passed) - 1
        return max(0.0, -self._bytes / BYTES_PER_S, -self._messages / MESSAGES_PER_S)
