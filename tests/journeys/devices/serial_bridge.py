"""What a browser needs for a glove at its port, in a test: the port, and a line to the server that can be cut.

The browser's `navigator.serial` is replaced in page and worker. Its port is a web socket to a virtual glove: the bridge goes on reading the glove
while nobody has the port open, and sends a piece again that nobody took: a real port loses what is in the system's buffer when its page ends.
"""

import os
import select
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import serialx
from playwright.sync_api import BrowserContext, Error, Route
from websockets.sync.server import ServerConnection, serve

PIECE = 16384  # bytes
BETWEEN = 0.05  # s between two pieces: one for each of the glove's frames would cost three processes some hundred messages a second
SAME = 200  # bytes by which a place in the glove's bytes is found again
DEVICE = "{ usbVendorId: 0x1209, usbProductId: 0x0001 }"
IN_PAGE = f"""
Object.defineProperty(navigator, "serial", {{ value: {{
  requestPort: async () => ({{ getInfo: () => ({DEVICE}) }}),
  getPorts: async () => [],
}} }});
"""
IN_WORKER = """
const bridge = (address, device) => {
  const port = { getInfo: () => device };
  port.open = () => new Promise((resolve, reject) => {
    const socket = new WebSocket(address);
    const waiting = [];
    let given = null, wake = null;
    socket.binaryType = "arraybuffer";
    socket.onerror = () => reject(new Error("no glove"));
    socket.onclose = () => { waiting.push(null); wake?.(); };
    socket.onmessage = ({ data }) => { waiting.push(data); wake?.(); };
    port.readable = new ReadableStream({
      async pull(controller) {
        if (given !== null) socket.send(String(given));
        if (!waiting.length) await new Promise((ready) => (wake = ready));
        const data = waiting.shift();
        if (data === null) return controller.close();
        given = Number(new DataView(data).getBigUint64(0, true)) + data.byteLength - 8;
        controller.enqueue(new Uint8Array(data, 8));
      },
      cancel: () => { if (given !== null) socket.send(String(given)); },
    }, { highWaterMark: 0 });
    port.writable = new WritableStream({ write: (bytes) => socket.send(bytes) });
    port.close = async () => socket.close();
    socket.onopen = resolve;
  });
  return port;
};
Object.defineProperty(navigator, "serial", { value: { getPorts: async () => [bridge("ADDRESS", DEVICE)] } });
"""


@dataclass
class Bridge:
    """A glove behind a web socket; `sent` is all that it ever gave."""

    port: Any
    url: str = ""
    sent: bytearray = field(default_factory=bytearray)
    taken: int = 0  # bytes that the browser has
    openings: list[int] = field(default_factory=list)  # where each browser went on, bytes
    _changed: threading.Condition = field(default_factory=threading.Condition)
    _stop: threading.Event = field(default_factory=threading.Event)

    def read_glove(self) -> None:
        while not self._stop.is_set():
            with suppress(OSError):
                data = self.port.read(65536)
                with self._changed:
                    self.sent += data
                    self._changed.notify_all()

    def serve(self, browser: ServerConnection) -> None:
        """One browser that has the port open."""
        self.openings.append(self.taken)
        left = threading.Event()
        sender = threading.Thread(target=self._send, args=(browser, left), daemon=True)
        sender.start()
        with suppress(Exception):
            for message in browser:
                if isinstance(message, str):
                    self.taken = int(message)
                else:
                    self.port.write(message)
        left.set()
        sender.join()

    def _send(self, browser: ServerConnection, left: threading.Event) -> None:
        at = self.taken
        while not (left.wait(BETWEEN) or self._stop.is_set()):
            with self._changed:
                self._changed.wait(0.1)
                piece = bytes(self.sent[at : at + PIECE])
            if piece:
                with suppress(Exception):
                    browser.send(at.to_bytes(8, "little") + piece)
                at += len(piece)

    def stop(self) -> None:
        self._stop.set()

    def require_all_of(self, wire: bytes) -> int:
        """Fail unless these bytes are all that the glove sent, up to the position that is given back.

        Of what a page had taken when it ended, the last piece may come a second time: the word that it had it was on its way. Nothing
        may be missing, and nothing else may come again.
        """
        sent, end = bytes(self.sent), 0
        for again in [*self.openings[1:], None]:
            pairs = enumerate(zip(wire, sent[end:]))
            same = next((k for k, (one, other) in pairs if one != other), len(wire))
            if same == len(wire):
                return end + same
            assert again is not None, f"byte {end + same} is missing or another"
            rest = (
                k for k in range(same, 0, -1) if wire[k : k + SAME] == sent[again : again + SAME]
            )
            k = next(rest, None)
            assert k is not None and end + k >= again, f"bytes behind {end + same} are missing"
            repeated = end + k - again
            assert repeated <= PIECE, f"{repeated} bytes before {end + k} came a second time"
            wire, end = wire[k:], again
        raise AssertionError

    def into(self, context: BrowserContext) -> None:
        """Replace `navigator.serial` in the pages of a browser and in the worker that reads the port."""
        prelude = IN_WORKER.replace("ADDRESS", self.url).replace("DEVICE", DEVICE)

        def worker(route: Route) -> None:
            answer = route.fetch()
            route.fulfill(body=prelude + answer.text(), content_type="text/javascript")

        with suppress(Error):  # a Chromium that asks for it: the worker's file comes from the test
            context.grant_permissions(["local-network-access"])
        context.add_init_script(IN_PAGE)
        context.route("**/static/relay/worker.js", worker)


@contextmanager
def bridged(address: Path | str) -> Iterator[Bridge]:
    """A bridge to the glove at a serial port or socket://HOST:PORT."""
    port = serialx.serial_for_url(str(address), baudrate=115200, read_timeout=0.05)
    if not port.is_open:
        port.open()
    bridge = Bridge(port)
    reader = threading.Thread(target=bridge.read_glove, daemon=True)
    reader.start()
    try:
        with serve(bridge.serve, "127.0.0.1", 0, compression=None) as server:
            bridge.url = f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
            running = threading.Thread(target=server.serve_forever, daemon=True)
            running.start()
            try:
                yield bridge
            finally:
                bridge.stop()
                server.shutdown()
                running.join(10)
    finally:  # a glove whose port stays open is nobody else's
        bridge.stop()
        reader.join(10)
        port.close()


class Line:
    """A TCP line to a server that can be cut: who is connected is cut off, who calls is hung up on."""

    def __init__(self, host: str, port: int, scheme: str = "http") -> None:
        self._to = host, port
        self._listener = socket.create_server(("127.0.0.1", 0))
        name = "127.0.0.1" if scheme == "http" else "localhost"  # certificates name hosts
        self.base = f"{scheme}://{name}:{self._listener.getsockname()[1]}"
        self._pairs: dict[socket.socket, socket.socket] = {}
        self._is_cut = False
        self._wake, self._poke = os.pipe()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._stopped = False
        self._thread.start()

    def cut(self) -> None:
        self._is_cut = True
        os.write(self._poke, b"x")

    def mend(self) -> None:
        self._is_cut = False

    def close(self) -> None:
        self._stopped = True
        os.write(self._poke, b"x")
        self._thread.join(10)
        self._listener.close()
        os.close(self._wake)
        os.close(self._poke)

    def _run(self) -> None:
        while not self._stopped:
            ready = select.select([self._wake, self._listener, *self._pairs], [], [])[0]
            for one in ready:
                if one is self._wake:
                    os.read(self._wake, 1)
                elif one is self._listener:
                    self._accept()
                elif one in self._pairs:
                    self._pass_on(one)
            if self._is_cut or self._stopped:
                for one in list(self._pairs):
                    self._hang_up(one)

    def _accept(self) -> None:
        caller, _ = self._listener.accept()
        try:
            if self._is_cut:
                raise OSError
            server = socket.create_connection(self._to)
        except OSError:
            caller.close()
            return
        self._pairs |= {caller: server, server: caller}

    def _pass_on(self, one: socket.socket) -> None:
        try:
            data = one.recv(65536)
            if not data:
                raise OSError
            self._pairs[one].sendall(data)
        except OSError:
            self._hang_up(one)

    def _hang_up(self, one: socket.socket) -> None:
        other = self._pairs.pop(one, None)
        if other is not None:
            self._pairs.pop(other, None)
            other.close()
        one.close()
