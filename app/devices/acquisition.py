"""The process that records: it reads the port, writes the recording, then passes the bytes on. Nothing the server does can make it lose a sample.

Run as `python -m app.devices.acquisition`; it talks to the server over its standard input and output in frames of `pipes`. Four threads: the port's
reader only reads; the writer records and passes on; passing on never waits (the oldest bytes are dropped and counted); commands come in last.
When the server dies the input ends: the recording is finished properly and the process leaves.
"""

import contextlib
import json
import queue
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from handscope.app.devices.pipes import Kind, read_frame, write_frame
from handscope.app.devices.ports import is_network, is_relay, open_port
from handscope.app.devices.sources.addresses import is_source
from handscope.estimators.data.events import Event
from handscope.estimators.errors import InputError
from handscope.estimators.messages.system import describe
from handscope.sessions.files.original_messages import pack
from handscope.sessions.files.recorder import Recorder

FORWARD = 4096  # chunks that wait for a slow server, about 16 MB; then the oldest go
TOGETHER = 1024  # chunks that go to the disk in one write where it is slow
RETRY = 0.5  # s between two tries to open a port that went away
KEEP_EVERY = 0.5  # s between two syncs to the disk that a browser's relay is notified of
SHOW_EVERY = 0.3  # s between two pictures of a source's sensors
PLACES = "tracker_places"  # name of this metadata
SILENCE = 5.0  # s without a byte after which a network connection counts as lost: a cable that was cut says nothing


@dataclass
class RelayedCount:
    """Messages of a relay."""

    written: int = 0
    kept: int = 0  # on the disk
    synced: float = 0.0  # s, monotonic
    is_broken: bool = False  # one could not be written: none behind it may be


class Acquisition:
    """State shared by the threads of the process."""

    def __init__(self, port: str, recorder: Recorder, out: IO[bytes]) -> None:
        self._path, self._recorder, self._out = port, recorder, out
        self._port: Any = None
        self._read: queue.SimpleQueue[tuple[str, Any, float]] = queue.SimpleQueue()
        self._forward: queue.Queue[tuple[Kind, float, bytes]] = queue.Queue(FORWARD)
        self._stop = threading.Event()
        self._failed = False
        self._is_relayed = is_relay(port)
        self._relayed = RelayedCount()
        self._places: dict[str, str] = {}  # segments by sensor of a source
        self._shown = 0.0  # s, newest rows of a source's sensors
        self.dropped = 0

    def run(self, commands: IO[bytes]) -> None:
        """Until the server says quit or goes away."""
        threads = [threading.Thread(target=t, daemon=True) for t in (self._reader, self._passer)]
        listener = threading.Thread(target=self._listen, args=(commands,), daemon=True)
        for thread in (*threads, listener):
            thread.start()
        while not (self._stop.is_set() and self._read.empty()):
            try:
                self._record([self._read.get(timeout=0.1), *self._take_waiting()])
            except queue.Empty:
                pass
            self._acknowledge(time.monotonic())
        self._stop.set()
        self._recorder.close()
        self._say_kept()
        self._say(state="finished", bytes_written=self._recorder.bytes_written)
        self._forward.put((Kind.END, 0.0, b""))
        threads[1].join(timeout=2.0)

    def _take_waiting(self) -> Iterator[tuple[str, Any, float]]:
        """What has piled up while the disk was busy, up to TOGETHER."""
        with contextlib.suppress(queue.Empty):
            for _ in range(TOGETHER - 1):
                yield self._read.get_nowait()

    def _record(self, items: Sequence[tuple[str, Any, float]]) -> None:
        """Keep first, then pass on."""
        try:
            with self._recorder.together():
                for item in items:
                    self._keep(*item)
        except OSError as problem:
            self._say_failed(describe(problem))
        for what, value, at in items:
            if what == "wire":
                self._pass_on(Kind.CHUNK, at, value)

    def _keep(self, what: str, value: Any, at: float) -> None:
        """One that fails takes none of the others with it."""
        try:
            if what == "wire":
                self._keep_wire(value, at)
            elif what == "original":
                self._recorder.original(pack(value), at)
            elif what == "command":
                self._recorder.command(value, at)
            elif what == "event":
                event = None if value.get("retracted") else Event(**value["event"])
                self._recorder.event(value["id"], event, at)
            elif what == "metadata":
                self._recorder.metadata(value, at)
        except (OSError, ValueError) as problem:
            self._say_failed(describe(problem))

    def _keep_wire(self, value: bytes, at: float) -> None:
        """Of a relay nothing behind a message that failed: the browser still has it and sends it later."""
        if self._relayed.is_broken:
            return
        self._relayed.is_broken = self._is_relayed
        self._recorder.write(value, at)
        self._relayed.is_broken = False
        self._relayed.written += 1

    def _acknowledge(self, now: float) -> None:
        """Bring a relay's messages to the disk and say how many are there."""
        r = self._relayed
        if self._is_relayed and r.written > r.kept and now - r.synced >= KEEP_EVERY:
            r.synced = now
            try:
                self._recorder.sync()
            except OSError as problem:
                self._say_failed(describe(problem))
            else:
                self._say_kept()

    def _say_kept(self) -> None:
        if self._is_relayed:
            self._relayed.kept = self._relayed.written
            kept = json.dumps({"kept": self._relayed.kept}).encode()
            self._pass_on(Kind.KEPT, time.monotonic(), kept)

    def _say_failed(self, reason: str) -> None:
        if not self._failed:
            self._failed = True
            self._say(state="recording_failed", reason=reason)

    def _reader(self) -> None:
        """Read the port; when it goes away, say so and try to open it again. A browser's port comes with the commands."""
        if self._is_relayed:
            return
        while not self._stop.is_set():
            try:
                self._port = open_port(self._path)
                self._place_sensors(self._places)
                self._say(state="opened", port=self._path)
                self._read_all()
            except InputError as problem:
                self._say(state="port_closed", reason=str(problem))
            except (OSError, ValueError) as problem:
                self._say(state="port_lost", reason=str(problem))
            self._close_port()
            self._stop.wait(RETRY)
        self._close_port()

    def _read_all(self) -> None:
        newest = time.monotonic()
        while not self._stop.is_set():
            chunk, now = self._port.read(65536), time.monotonic_ns() * 1e-9
            self._show_sensors(now)
            self._take_originals(self._port, now)
            if chunk:
                newest = now
                self._read.put(("wire", bytes(chunk), now))
            elif now - newest > SILENCE and is_network(self._path) and not is_source(self._path):
                raise OSError(f"nothing came for {SILENCE:g} s")

    def _take_originals(self, port: Any, now: float) -> None:
        """What a source of another protocol gave as it came goes to the file too."""
        if is_source(self._path):
            for original in port.take_originals():
                self._read.put(("original", original, now))

    def place(self, places: Mapping[str, str]) -> None:
        """Where sensors of a source sit, kept for every time that it is opened."""
        self._places = dict(places)
        self._place_sensors(self._places)

    def _place_sensors(self, places: Mapping[str, str]) -> None:
        port = self._port
        if port is not None and is_source(self._path):
            port.place(places)

    def _show_sensors(self, now: float) -> None:
        """A source's sensors with where they sit, from time to time."""
        if is_source(self._path) and now - self._shown >= SHOW_EVERY:
            self._shown = now
            self._pass_on(Kind.TRACKERS, now, json.dumps(self._port.trackers()).encode())

    def _close_port(self) -> None:
        port, self._port = self._port, None
        if port is not None and is_source(self._path):
            self._take_originals(port, time.monotonic_ns() * 1e-9)
            counts = {"source_counts": dict(port.counts())}
            self._read.put(("metadata", counts, time.monotonic_ns() * 1e-9))
        if port is not None:
            try:
                port.close()
            except OSError:
                pass  # it is gone already: that is why it is closed

    def _listen(self, commands: IO[bytes]) -> None:
        while (frame := read_frame(commands)) is not None:
            kind, at, data = frame
            if kind is Kind.QUIT:
                break
            if kind is Kind.SEND:
                self._send(data)
            elif kind is Kind.PLACES:
                self.place(json.loads(data))
                self._read.put(("metadata", {PLACES: self._places}, at))
            elif kind is Kind.RELAYED:
                self._read.put(("wire", data, at))
            elif kind is Kind.RELAY_LINE:
                is_open = json.loads(data)["is_open"]
                self._say(state="opened" if is_open else "port_lost", port=self._path)
            else:
                self._read.put((kind.name.lower(), json.loads(data), at))
        time.sleep(0.05)  # what is on its way from the port still belongs to the recording
        self._stop.set()

    def _send(self, data: bytes) -> None:
        port = self._port
        if self._is_relayed:
            self._pass_on(Kind.TO_PORT, time.monotonic(), data)
            self._read.put(("command", data, time.monotonic_ns() * 1e-9))
        if port is None:
            return
        try:
            port.write(data)
            self._read.put(("command", data, time.monotonic_ns() * 1e-9))
        except OSError:
            pass  # the reader meets the same fault and says it

    def _say(self, **state: Any) -> None:
        self._pass_on(
            Kind.STATE,
            time.monotonic_ns() * 1e-9,
            json.dumps({**state, "dropped": self.dropped}).encode(),
        )

    def _pass_on(self, kind: Kind, at: float, data: bytes) -> None:
        while True:
            try:
                return self._forward.put_nowait((kind, at, data))
            except queue.Full:
                try:
                    self._forward.get_nowait()
                    self.dropped += 1
                except queue.Empty:
                    pass

    def _passer(self) -> None:
        while (item := self._forward.get())[0] is not Kind.END:
            try:
                write_frame(self._out, *item)
            except (BrokenPipeError, OSError, ValueError):
                return  # the server is gone; the recording goes on until the input ends


def main() -> int:
    """Wait for the order on standard input, then record."""
    commands, out = sys.stdin.buffer, sys.stdout.buffer
    frame = read_frame(commands)
    if frame is None or frame[0] is not Kind.OPEN:
        return 2
    order = json.loads(frame[2])
    try:
        recorder = Recorder(
            Path(order["recording"]),
            order["metadata"],
            time.monotonic_ns() * 1e-9,
            stored=order.get("stored", False),
        )
    except (OSError, InputError) as problem:
        reason = describe(problem)
        write_frame(
            out,
            Kind.STATE,
            time.monotonic_ns() * 1e-9,
            json.dumps({"state": "recording_failed", "reason": reason, "dropped": 0}).encode(),
        )
        return 1
    acquisition = Acquisition(order["port"], recorder, out)
    acquisition.place(order["metadata"].get(PLACES) or {})
    acquisition.run(commands)
    return 0


if __name__ == "__main__":
    sys.exit(main())
