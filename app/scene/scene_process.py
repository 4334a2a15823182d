"""A HandScene in a process of its own: drawing the hand and telling viewers of it takes no turn of the interpreter from whoever tracks the hand.

Every method leaves a wish and waits for nobody. While the process is busy, newer wishes take the place of older ones of the same kind, so viewers see
what was wished last. When it dies, another is started and is told everything anew; viewers' pages connect again by themselves.
"""

import logging
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing.connection import Connection
from typing import Any

from handscope.app.scene.hand_scene import HandScene
from handscope.app.workers.process import CONTEXT, ignore_terminal_signals
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array

log = logging.getLogger(__name__)
AHEAD = 2  # pictures that the process may be behind before wishes wait; what is on its way then fits into any pipe
AGAIN = 0.5  # s before another process takes the place of one that died
CLOSE_WAIT = 5.0  # s


class SceneProcess:
    """A context manager; `port` and `secret` are what bridge.bridge needs, 0 and empty while no process is there. Methods are HandScene's."""

    def __init__(self, hand: Hand, geometry: HandGeometry) -> None:
        self.port, self.secret = 0, ""
        self._about = hand, geometry
        self._newest: dict[str, tuple[Any, ...]] = {}  # the newest wish of each kind, in order
        self._waiting: dict[
            str, tuple[Any, ...]
        ] = {}  # of them, those that the process was not told
        self._lock = threading.RLock()
        self._gathering = 0  # pictures that are being put together
        self._pipe: Connection | None = None
        self._behind = 0  # pictures that the process was told and has not drawn
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="scene", daemon=True)

    def __enter__(self) -> "SceneProcess":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the process; viewers are disconnected."""
        self._closed.set()
        self._disconnect()
        self._thread.join(CLOSE_WAIT)

    def show(self, angles: Array, q_GH: Array | None) -> None:
        self._request("show", angles, q_GH)

    def face_ahead(self) -> None:
        self._request("face_ahead")

    def measured(self, fingers: Iterable[str]) -> None:
        self._request("measured", tuple(fingers))

    def ghost(self, angles: Array | None, whole: bool = False) -> None:
        self._request("ghost", angles, whole)

    def trail(self, places: Array) -> None:
        self._request("trail", places)

    def place(self, place: Array, sd: Array, doubtful: bool) -> None:
        self._request("place", place, sd, doubtful)

    def forces(self, forces: Array | None) -> None:
        if (
            forces is not None or self._newest.get("forces", (None,))[0] is not None
        ):  # no arrows there are anyhow
            self._request("forces", forces)

    def highlight(self, segment: str | None) -> None:
        self._request("highlight", segment)

    @contextmanager
    def picture(self) -> Iterator[None]:
        """What is wished within is drawn together."""
        with self._lock:
            self._gathering += 1
            try:
                yield
            finally:
                self._gathering -= 1
                self._send_waiting()

    def _request(self, kind: str, *arguments: Any) -> None:
        with self._lock:
            for requests in (self._newest, self._waiting):
                requests.pop(
                    kind, None
                )  # the newest goes last: what faces ahead is the hand shown after that
                requests[kind] = arguments
            self._send_waiting()

    def _send_waiting(self) -> None:
        """Send what waits, unless the process is behind; the next wish tries again, and a station has one in every tick."""
        if self._gathering or self._pipe is None or not self._waiting:
            return
        with suppress(OSError, EOFError):  # it died: another will be told everything
            while self._behind and self._pipe.poll():
                self._pipe.recv_bytes()
                self._behind -= 1
            if self._behind < AHEAD:
                self._pipe.send(list(self._waiting.items()))
                self._behind += 1
                self._waiting.clear()

    def _run(self) -> None:
        """In a thread of its own: a process is there until this is closed."""
        while not self._closed.is_set():
            pipe, theirs = CONTEXT.Pipe()
            process = CONTEXT.Process(
                target=_draw, args=(theirs, *self._about), name="handscope scene", daemon=True
            )
            process.start()
            theirs.close()  # the process has the only other end: when it dies, the pipe ends
            with suppress(OSError, EOFError):
                self._connect(pipe, *pipe.recv())
            process.join()
            self._disconnect()
            if not self._closed.wait(AGAIN):
                log.error(
                    "the process of a 3-D scene ended (%s); another is started", process.exitcode
                )

    def _connect(self, pipe: Connection, port: int, secret: str) -> None:
        with self._lock:
            self._pipe, self._behind, self._waiting = pipe, 0, dict(self._newest)
            self.port, self.secret = port, secret
            if self._closed.is_set():
                self._disconnect()
            self._send_waiting()

    def _disconnect(self) -> None:
        with self._lock:
            self.port, self.secret = 0, ""
            pipe, self._pipe = self._pipe, None
            if pipe is not None:
                pipe.close()


def _draw(pipe: Connection, hand: Hand, geometry: HandGeometry) -> None:
    """In the process: draw what is wished until the pipe ends."""
    ignore_terminal_signals()
    with HandScene(hand, geometry) as scene, suppress(EOFError, OSError):
        pipe.send((scene.port, scene.secret))
        while True:
            scene.in_its_thread(partial(_carry_out, scene, pipe.recv()))
            pipe.send_bytes(b"drawn")


def _carry_out(scene: HandScene, requests: list[tuple[str, tuple[Any, ...]]]) -> None:
    try:
        with scene.picture():
            for kind, arguments in requests:
                getattr(scene, kind)(*arguments)
    except Exception:  # one picture less
        log.exception("a picture could not be drawn")
