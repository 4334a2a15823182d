"""Feeds a session's outlets (LSL, OSC) from a thread of their own, so that none of them holds back recording or tracking.

The queue is bounded: when it is full, the oldest entries are dropped and counted. An outlet that fails is closed and named.
"""

import logging
import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import Protocol

from handscope.estimators.data.samples import Block
from handscope.estimators.data.trajectory import Trajectory

log = logging.getLogger(__name__)
QUEUE = 500  # entries, some seconds
CLOSE_WAIT = 2.0  # s


class Outlet(Protocol):
    """Sends samples, poses and markers to other programs."""

    name: str

    def send_samples(self, block: Block) -> None: ...

    def send_poses(self, rows: Trajectory) -> None: ...

    def send_marker(self, t: float, text: str) -> None: ...

    def close(self) -> None: ...


class Outlets:
    """A context manager; the `send_...` functions never wait."""

    def __init__(self, outlets: Sequence[Outlet]) -> None:
        self._outlets = list(outlets)
        self.dropped = 0  # entries that the outlets missed; the recording has them
        self.problems: list[str] = []
        self._queue: deque[Callable[[Outlet], None]] = deque()
        self._wake = threading.Condition()
        self._stop = False
        self._thread: threading.Thread | None = None

    def __enter__(self) -> "Outlets":
        if self._outlets:
            self._thread = threading.Thread(target=self._run, name="outlets", daemon=True)
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        with self._wake:
            self._stop = True
            self._wake.notify()
        if self._thread is not None:
            self._thread.join(CLOSE_WAIT)

    def send_samples(self, blocks: Sequence[Block]) -> None:
        for block in blocks:
            self._put(lambda outlet, block=block: outlet.send_samples(block))  # type: ignore[misc]

    def send_poses(self, rows: Trajectory) -> None:
        if len(rows):
            self._put(lambda outlet: outlet.send_poses(rows))

    def send_marker(self, t: float, text: str) -> None:
        """What happens in the session at `t` s of the recording."""
        self._put(lambda outlet: outlet.send_marker(t, text))

    def _put(self, entry: Callable[[Outlet], None]) -> None:
        if self._thread is None:
            return
        with self._wake:
            self._queue.append(entry)
            if len(self._queue) > QUEUE:
                self._queue.popleft()
                self.dropped += 1
            self._wake.notify()

    def _run(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._queue or self._stop)
                if self._stop:
                    break
                entries = list(self._queue)
                self._queue.clear()
            for entry in entries:
                self._send(entry)
        for outlet in self._outlets:
            outlet.close()

    def _send(self, entry: Callable[[Outlet], None]) -> None:
        for outlet in list(self._outlets):
            try:
                entry(outlet)
            except Exception:  # a library of another program must not end the session
                log.exception("outlet %s", outlet.name)
                self._outlets.remove(outlet)
                self.problems.append(outlet.name)
                outlet.close()
