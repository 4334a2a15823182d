"""A glove in use: its recording process, its samples as blocks, commands to it.

port -> bytes -> recording process (first, always) -> decoder -> blocks -> `on_blocks`, called in the glove's own thread
"""

import json
import logging
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass
from io import BufferedReader
from itertools import groupby
from pathlib import Path
from types import TracebackType
from typing import Any, cast

from handscope.app.devices.pipes import Kind, frames_that_wait, write_frame
from handscope.app.devices.ports import is_relay
from handscope.app.devices.relay.live_relay import LiveRelay
from handscope.estimators.data.samples import Block, Event
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.tables_io import force_calibrations
from handscope.sessions.tables_io.tracker_places import PLACES, with_changed
from handscope.sessions.wire import messages as wire
from handscope.sessions.wire.assembly import Assembler
from handscope.sessions.wire.framing import Encoder

log = logging.getLogger(__name__)
FOREIGN = 200  # bytes without a frame that are no glove's; a first frame has 60
CLOSE_WAIT = 10.0  # s that the recording process gets to finish its file


@dataclass(frozen=True)
class GloveState:
    """What became of port and recording."""

    state: str = "opening"  # opening, opened, port_closed, port_lost, recording_failed, finished
    reason: str = ""
    dropped: int = 0  # chunks that the live view missed; the recording has them


class Glove:
    """A context manager: entering starts the recording process, leaving finishes the recording."""

    def __init__(
        self,
        port: str,
        recording: Path,
        metadata: Mapping[str, Any],
        on_blocks: Callable[[list[Block]], object],
        stored: bool = False,
        turn: Callable[[], AbstractContextManager[object]] = nullcontext,
    ) -> None:
        """A recording that is `stored` lies in a data folder: sealed where there is a key (sessions/sealing). Bytes are decoded within a `turn`."""
        self._stored, self._turn = stored, turn
        self.recording, self._port, self._metadata, self._on_blocks = (
            recording,
            port,
            metadata,
            on_blocks,
        )
        self.assembler = Assembler(stored_forces=force_calibrations.of_recording(metadata))
        self.state = GloveState()
        self._places: dict[str, str] = dict(metadata.get(PLACES) or {})
        self.trackers: list[dict[str, Any]] = []  # sensors of a source, a row each
        self.decoding_failures = 0
        self.received = 0  # bytes, of a glove or of anything else
        # to be passed to the assembler with the next chunk
        self._worn_on: Mapping[str, str] | None = None
        self._encoder = Encoder()
        self._sending = threading.Lock()
        self.relay = LiveRelay(self._record_relayed, self._set_line) if is_relay(port) else None
        self._changed = threading.Condition()

    def __enter__(self) -> "Glove":
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "handscope.app.devices.acquisition"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        self._tell(
            Kind.OPEN,
            json.dumps(
                {
                    "port": self._port,
                    "recording": str(self.recording),
                    "metadata": dict(self._metadata),
                    "stored": self._stored,
                }
            ).encode(),
        )
        self._thread = threading.Thread(
            target=self._receive, name=f"glove {self._port}", daemon=True
        )
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.send(wire.Stop())
        if self.relay is not None:
            self.relay.end()
        self._tell(Kind.QUIT)
        try:
            self._process.wait(CLOSE_WAIT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._thread.join(CLOSE_WAIT)
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                try:
                    pipe.close()
                except OSError:
                    pass  # the process was killed with our last words unread

    @property
    def pid(self) -> int:
        """The recording process."""
        return self._process.pid

    def send(self, command: wire.Message) -> None:
        """Tell the glove; the reply arrives in `assembler.replies`."""
        with self._sending:
            self._tell(Kind.SEND, self._encoder.frame(command))

    def keep_event(self, event_id: str, event: Event | None) -> None:
        """Write an event into the recording; the same id replaces, None takes back."""
        value = (
            {"id": event_id, "retracted": True}
            if event is None
            else {"id": event_id, "event": asdict(event)}
        )
        self._tell(Kind.EVENT, json.dumps(value).encode())

    def keep_metadata(self, metadata: Mapping[str, Any]) -> None:
        self._tell(Kind.METADATA, json.dumps(dict(metadata)).encode())

    def exchange(self, worn_on: Mapping[str, str], begin: Callable[[], None]) -> None:
        """Strips are on other fingers than they say; `begin` is called before the first samples that are read so. The recording says it, too."""
        self._begin, self._worn_on = begin, dict(worn_on)
        self.keep_metadata({"exchanged_strips": dict(worn_on)})

    def place_trackers(self, changed: Mapping[str, str]) -> Mapping[str, str]:
        """Sensors of a source sit on these segments, by the sensors' names; gives where all sit, as the recording says it, too."""
        with self._sending:
            self._places = with_changed(self._places, self.trackers, changed)
            self._tell(Kind.PLACES, json.dumps(self._places).encode())
            return self._places

    def now(self) -> float | None:
        """The recording's time at this moment; None before the first sample."""
        return self.assembler.recording_time(time.monotonic())

    @property
    def is_foreign(self) -> bool:
        """Whether what comes from the port is no glove's: many bytes, and not one frame among them."""
        return self.received > FOREIGN and not self.assembler.counters.frames

    def wait_for(self, condition: Callable[["Glove"], bool], timeout: float) -> bool:
        """Wait until the condition holds (looked at whenever something arrives); False after the timeout."""
        with self._changed:
            return self._changed.wait_for(lambda: condition(self), timeout)

    def _record_relayed(self, at: float, data: bytes) -> None:
        self._tell(Kind.RELAYED, data, at)

    def _set_line(self, is_open: bool) -> None:
        self._tell(Kind.RELAY_LINE, json.dumps({"is_open": is_open}).encode())

    def _tell(self, kind: Kind, data: bytes = b"", at: float | None = None) -> None:
        assert self._process.stdin is not None
        try:
            write_frame(self._process.stdin, kind, time.monotonic() if at is None else at, data)
        except (OSError, ValueError):
            self._set_state(
                GloveState("recording_failed", phrase("device.recording_ended"), self.state.dropped)
            )

    def _receive(self) -> None:
        for frames in frames_that_wait(cast(BufferedReader, self._process.stdout)):
            for is_wire, some in groupby(frames, key=lambda frame: frame[0] is Kind.CHUNK):
                if is_wire:
                    self._take_chunks([(at, data) for _, at, data in some])
                else:
                    for kind, _, data in some:
                        self._take_word(kind, data)
            with self._changed:
                self._changed.notify_all()
        if self.state.state != "finished":
            self._set_state(
                GloveState(
                    "recording_failed",
                    self.state.reason or phrase("device.recording_ended"),
                    self.state.dropped,
                )
            )

    def _take_word(self, kind: Kind, data: bytes) -> None:
        """A frame of the recording process that holds no samples."""
        if kind is Kind.STATE:
            self._take_state(json.loads(data))
        elif kind is Kind.TRACKERS:
            self.trackers = json.loads(data)
        elif self.relay is not None and kind is Kind.KEPT:
            self.relay.acknowledge(json.loads(data)["kept"])
        elif self.relay is not None and kind is Kind.TO_PORT:
            self.relay.command(data)

    def _take_state(self, message: dict[str, Any]) -> None:
        self._set_state(
            GloveState(message["state"], message.get("reason", ""), message.get("dropped", 0))
        )
        if message["state"] == "opened":
            self.send(wire.Identify())
            self.send(wire.Start())

    def _take_chunks(self, chunks: list[tuple[float, bytes]]) -> None:
        """All that waited is decoded together: a few samples of a stream cost little more than one."""
        self.received += sum(len(chunk) for _, chunk in chunks)
        try:
            if self._worn_on is not None:  # in this thread: nothing else touches the assembler
                worn_on, self._worn_on = self._worn_on, None
                self.assembler.exchange(worn_on)
                self._begin()
            with self._turn():
                blocks = self.assembler.feed_all(chunks, self._count_view_failure)
            if blocks:
                self._on_blocks(blocks)
        except Exception as fault:
            self._count_view_failure(fault)

    def _count_view_failure(self, fault: Exception) -> None:
        """The view may fail, the recording goes on: count it, the station shows it."""
        if not self.decoding_failures:  # the first stands for all: there may be a hundred a second
            log.error(
                "what the glove at %s sent is not shown; the recording has it",
                self._port,
                exc_info=fault,
            )
        self.decoding_failures += 1

    def _set_state(self, state: GloveState) -> None:
        with self._changed:
            self.state = state
            self._changed.notify_all()
