"""A HandScene in a process of its own, so that drawing does not delay the tracker.

Every method stores a request and never waits. While the process is busy, a newer request replaces an older one of the
same kind. When the process dies, another is started and gets the newest request of each kind; pages reconnect by
themselves.
"""

import logging
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing.connection import Connection
from typing import Any

from handscope.app.scene.angle_arc import Measured
from handscope.app.scene.camera.sides import Side
from handscope.app.scene.hand_scene import HandScene
from handscope.app.workers.process import CONTEXT, ignore_terminal_signals, stand_back
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array

log = logging.getLogger(__name__)
AHEAD = 2  # pictures sent and not yet drawn; so few fit into any pipe
AGAIN = 0.5  # s before another process replaces one that died
CLOSE_WAIT = 5.0  # s
LESS_URGENT = 5  # of the process's priority: tracking comes first


class SceneProcess:
    """A context manager with the methods of HandScene; `port` and `secret` for bridge.bridge are 0 and empty without a process."""

    def __init__(self, hand: Hand, geometry: HandGeometry) -> None:
        self.port, self.secret = 0, ""
        self._about = hand, geometry
        self._newest: dict[str, tuple[Any, ...]] = {}  # newest request of each kind, in order
        self._waiting: dict[str, tuple[Any, ...]] = {}  # requests not sent yet
        self._lock = threading.RLock()
        self._gathering = 0  # open `picture` contexts
        self._pipe: Connection | None = None
        self._behind = 0  # pictures sent and not yet drawn
        self.viewers = 0  # pages that were connected when the last picture was drawn
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

    def show(self, angles: Array, q_GH: Array | None, followed: bool = True) -> None:
        self._request("show", angles, q_GH, followed)

    def face_ahead(self) -> None:
        self._request("face_ahead")

    def measured(self, fingers: Iterable[str]) -> None:
        self._request("measured", tuple(fingers))

    def ghost(self, angles: Array | None, whole: bool = False) -> None:
        self._request("ghost", angles, whole)

    def measure(self, measured: Measured | None) -> None:
        self._request("measure", measured)

    def mirror(self, mirrored: bool) -> None:
        self._request("mirror", mirrored)

    def look(self, side: Side | None, framed: Sequence[Array] = ()) -> None:
        self._request("look", side, tuple(framed))

    def trail(self, places: Array) -> None:
        self._request("trail", places)

    def place(self, place: Array, sd: Array, doubtful: bool) -> None:
        self._request("place", place, sd, doubtful)

    def forces(self, forces: Array | None) -> None:
        if (
            forces is not None or self._newest.get("forces", (None,))[0] is not None
        ):  # without forces before there is nothing to remove
            self._request("forces", forces)

    def highlight(self, segment: str | None) -> None:
        self._request("highlight", segment)

    @contextmanager
    def picture(self) -> Iterator[None]:
        """Requests made within are drawn together."""
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
                # the newest goes last: `face_ahead` applies to the hand shown after it
                requests.pop(kind, None)
                requests[kind] = arguments
            self._send_waiting()

    def _send_waiting(self) -> None:
        """Send the waiting requests unless the process is behind; the next request tries again, at every tick."""
        if self._gathering or self._pipe is None or not self._waiting:
            return
        with suppress(OSError, EOFError):  # it died: another will get everything
            while self._behind and self._pipe.poll():
                self.viewers = int(self._pipe.recv_bytes())
                self._behind -= 1
            if self._behind < AHEAD:
                self._pipe.send(list(self._waiting.items()))
                self._behind += 1
                self._waiting.clear()

    def _run(self) -> None:
        """In a thread of its own: keep a process running until this is closed."""
        while not self._closed.is_set():
            pipe, theirs = CONTEXT.Pipe()
            process = CONTEXT.Process(
                target=_draw, args=(theirs, *self._about), name="handscope scene", daemon=True
            )
            process.start()
            theirs.close()  # the pipe ends when the process, which has the only other end, dies
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
            self.port, self.secret, self.viewers = 0, "", 0
            pipe, self._pipe = self._pipe, None
            if pipe is not None:
                pipe.close()


def _draw(pipe: Connection, hand: Hand, geometry: HandGeometry) -> None:
    """In the process: draw requests until the pipe ends."""
    ignore_terminal_signals()
    stand_back(LESS_URGENT)
    with HandScene(hand, geometry) as scene, suppress(EOFError, OSError):
        pipe.send((scene.port, scene.secret))
        while True:
            scene.in_its_thread(partial(_carry_out, scene, pipe.recv()))
            pipe.send_bytes(b"%d" % scene.viewers)


def _carry_out(scene: HandScene, requests: list[tuple[str, tuple[Any, ...]]]) -> None:
    try:
        with scene.picture():
            for kind, arguments in requests:
                getattr(scene, kind)(*arguments)
    except Exception:  # this picture is lost
        log.exception("a picture could not be drawn")
