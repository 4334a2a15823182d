"""Write a native recording: what the glove sent, as it came, before anything else happens to it.

One MCAP file (docs/recording.md): channel `wire` holds the port's bytes with their arrival times, `command` what was sent to the glove, `event` and
`metadata` JSON, `original` what a source of another protocol gave. Every message is numbered and a chunk of its own with its channel and CRC, handed to the operating system at once and to the disk
every second, by a thread of its own, since what came meanwhile is not to wait for the disk; what has piled up behind a slow disk goes there in one write. Channel `checkpoint` repeats events and metadata every CHECKPOINT_EVERY, so that
what a crash left is listed from its end (recording_ends.py). (mcap's own writer is not used: it keeps an index entry of every chunk in memory, 0.4 GB after a million.)
"""

import contextlib
import json
import os
import zlib
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Chunk, DataEnd, Footer, Header, McapRecord, Message
from mcap.writer import MCAP0_MAGIC

from handscope.estimators.data.events import Event
from handscope.sessions.sealing.stored import create_stored

try:
    import fcntl
except ImportError:  # Windows: nobody else can open a file that is being written
    fcntl = None  # type: ignore[assignment]

FORMAT_VERSION = 1
SYNC_EVERY = 1.0  # s between syncs to the disk
CHECKPOINT_EVERY = 10.0  # s between two checkpoints: 4 MB of 17 sensors at 1 kHz
BUFFER = 2**22  # bytes that go to the file in one write: half a minute of 17 sensors at 1 kHz
PROFILE = "handscope"
CHECKPOINT = "checkpoint"  # channel of what stands so far
ORIGINAL = "original"  # channel of what a source gave; its messages are numbered by themselves
# times at most that a message of it may shrink: a reader refuses files that shrink more
SHRINKS = 10
CHANNELS = {
    topic: Channel(id=k, topic=topic, message_encoding=encoding, metadata={}, schema_id=0)
    for k, (topic, encoding) in enumerate(
        {
            "wire": "handscope-wire",
            "command": "handscope-wire",
            "event": "json",
            "metadata": "json",
            CHECKPOINT: "json",
            ORIGINAL: "handscope-original",
        }.items(),
        start=1,
    )
}


@dataclass(frozen=True)
class Continuation:
    """Where a recording that lacks its end goes on."""

    file: IO[bytes]  # at its end
    number: int  # of the next message
    originals: int  # of the next message of channel `original`
    began: float  # s of the monotonic clock, of the first message
    utc: datetime  # at that moment
    newest: float  # s of the monotonic clock, of the last message
    facts: Mapping[str, Any]  # metadata that stand
    events: Mapping[str, Any]  # by id, those that stand


class Recorder:
    """A recording being written: a context manager; leaving it finishes the file."""

    _syncing: Future[None] | None = None  # the newest that was asked for

    def __init__(
        self,
        path: Path,
        metadata: Mapping[str, Any],
        now: float,
        utc: datetime | None = None,
        file: IO[bytes] | None = None,
        stored: bool = False,
    ) -> None:
        """`now` is the host's monotonic clock in s, the clock of every `arrival`; `file` replaces the opened path in tests.

        One that is stored in a data folder is sealed where this process has a key (sessions/sealing).
        """
        self._file = file if file is not None else _create_locked(path, stored)
        self._began, self._utc = now, utc or datetime.now(UTC)
        self._synced = self._newest = self._checkpointed = now
        self._number = self._originals = 0
        self._facts: dict[str, Any] = {}
        self._events: dict[str, Any] = {}  # by id, those that stand
        self._together = False
        self._synced_by = ThreadPoolExecutor(1)
        self.bytes_written = 0
        self._file.write(MCAP0_MAGIC + _bytes_of(Header(PROFILE, PROFILE)))
        self.metadata(
            {"format_version": FORMAT_VERSION, "start_utc": self._utc.isoformat(), **metadata}, now
        )

    @classmethod
    def go_on(cls, at: Continuation) -> "Recorder":
        """A recorder that goes on with a file."""
        recorder = cls.__new__(cls)
        recorder._file, recorder._began, recorder._utc = at.file, at.began, at.utc
        recorder._synced = recorder._newest = recorder._checkpointed = at.newest
        recorder._facts, recorder._events = dict(at.facts), dict(at.events)
        recorder._number, recorder._together, recorder.bytes_written = at.number, False, 0
        recorder._originals = at.originals
        recorder._synced_by = ThreadPoolExecutor(1)
        return recorder

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @contextlib.contextmanager
    def together(self) -> Iterator[None]:
        """What is kept meanwhile goes to the file in one write at the end: a disk that is slow for each write keeps up."""
        self._together = True
        try:
            yield
        finally:
            self._together = False
            self._flush()

    def write(self, chunk: bytes, arrival: float) -> None:
        """Keep bytes that came from the glove; raises OSError when the disk does not take them."""
        self._put("wire", chunk, arrival)

    def command(self, sent: bytes, at: float) -> None:
        """Keep bytes that were sent to the glove."""
        self._put("command", sent, at)

    def original(self, data: bytes, at: float) -> None:
        """Keep what a source of another protocol gave, as it came (original_messages.py)."""
        self._file_message(ORIGINAL, data, at, self._originals)
        self._originals = (self._originals + 1) % 2**32
        self._advance(at)

    def event(self, event_id: str, event: Event | None, at: float) -> None:
        """Keep an event; the same id again replaces it, None takes it back. The earlier ones stay in the file."""
        value = {"id": event_id, **(asdict(event) if event is not None else {"retracted": True})}
        data = _json(value)
        if event is None:
            self._events.pop(event_id, None)
        else:
            self._events[event_id] = value
        self._put("event", data, at)

    def metadata(self, changed: Mapping[str, Any], at: float) -> None:
        """Keep facts about the recording; a later value of a name replaces the earlier."""
        data = _json(changed)
        self._facts |= changed
        self._put("metadata", data, at)

    def sync(self) -> None:
        """Everything so far is on the disk when this returns."""
        self._file.flush()
        if hasattr(self._file, "fileno"):
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Finish the file and put it on the disk."""
        if self._file.closed:
            return
        try:
            if self._checkpointed > self._began:
                self._checkpoint()
            self._file.write(
                _bytes_of(
                    DataEnd(0), Footer(summary_start=0, summary_offset_start=0, summary_crc=0)
                )
                + MCAP0_MAGIC
            )
            self.sync()
        finally:
            self._synced_by.shutdown()
            self._file.close()

    def _put(self, topic: str, data: bytes, at: float) -> None:
        number, self._number = self._number, (self._number + 1) % 2**32
        self._file_message(topic, data, at, number)
        self.bytes_written += len(data)
        self._advance(at)

    def _file_message(self, topic: str, data: bytes, at: float, number: int) -> None:
        utc = round(self._utc.timestamp() * 1e9 + (at - self._began) * 1e9)
        channel = CHANNELS[topic]
        message = Message(
            channel_id=channel.id,
            log_time=utc,
            data=data,
            publish_time=round(at * 1e9),
            sequence=number,
        )
        self._file.write(_chunk(_bytes_of(channel, message), utc, topic == ORIGINAL))

    def _advance(self, at: float) -> None:
        """A message of this moment is in the file's buffer."""
        self._newest = at
        if not self._together:
            self._flush()

    def _checkpoint(self) -> None:
        """Repeat what stands so far; a checkpoint has the number of the message that follows, and takes none itself."""
        value = {"metadata": self._facts, "events": list(self._events.values())}
        self._file_message(CHECKPOINT, _json(value), self._newest, self._number)
        self._checkpointed = self._newest

    def _flush(self) -> None:
        """Hand what waits to the operating system, and to the disk every SYNC_EVERY."""
        if self._newest - self._checkpointed >= CHECKPOINT_EVERY:
            self._checkpoint()
        self._file.flush()
        if self._newest - self._synced >= SYNC_EVERY:
            self._synced = self._newest
            self._sync_meanwhile()

    def _sync_meanwhile(self) -> None:
        """Bring what was handed over to the disk while recording goes on; raises what the time before met."""
        if not hasattr(self._file, "fileno") or (self._syncing and not self._syncing.done()):
            return
        if self._syncing:
            self._syncing.result()
        self._syncing = self._synced_by.submit(os.fsync, self._file.fileno())


def is_being_written(path: Path) -> bool:
    """Whether a recorder has the file open: one may outlive the server that started it. (Always False on Windows, where nobody else can open it.)"""
    if fcntl is None:
        return False
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:  # a file system without locks
            return False
    return False


def _create_locked(path: Path, stored: bool) -> IO[bytes]:
    file = create_stored(path, BUFFER) if stored else path.open("xb", buffering=BUFFER)
    if fcntl is not None:
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    return file


def _chunk(records: bytes, utc: int, may_shrink_far: bool) -> bytes:
    """A chunk; one that would shrink more than a reader takes is left as it is (a stream that rests is all zeros)."""
    packed = zstandard.compress(records)
    is_packed = not may_shrink_far or SHRINKS * len(packed) >= len(records)
    return _bytes_of(
        Chunk(
            compression="zstd" if is_packed else "",
            data=packed if is_packed else records,
            message_start_time=utc,
            message_end_time=utc,
            uncompressed_crc=zlib.crc32(records),
            uncompressed_size=len(records),
        )
    )


def _bytes_of(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())


def _json(value: Mapping[str, Any]) -> bytes:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, default=_to_plain).encode()


def _to_plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else dict(value)
