"""The relay of a session that runs: a browser's messages go to the recording process, its acknowledgements and the glove's commands back."""

import threading
from collections import deque
from collections.abc import Callable
from typing import Protocol

from handscope.app.devices.relay.messages import Chunk

FINISH_WAIT = 10.0  # s that a browser gets to send what it still keeps when the session ends
MOST_COMMANDS = 256  # for a port that is away; then the oldest go


class RelayEnd(Protocol):
    """Where a browser's messages go: a recording that is being made, or one that lacks its end."""

    @property
    def next_number(self) -> int:
        """Of the message that is expected next."""
        ...

    @property
    def on_disk(self) -> int:
        """Messages that are on the disk."""
        ...

    @property
    def is_ending(self) -> bool:
        """Whether no more bytes of the port are wanted than the browser has now."""
        ...

    @property
    def newest(self) -> float:
        """Arrival of the newest message, s of the monotonic clock."""
        ...

    def attach(self, notify: Callable[[], object]) -> None:
        """A browser is there; `notify` is called from any thread when something changed. The one before is replaced."""
        ...

    def detach(self, notify: Callable[[], object]) -> None:
        """The browser has left."""
        ...

    def is_attached(self, notify: Callable[[], object]) -> bool: ...

    def set_port(self, is_open: bool) -> None:
        """The browser opened its port, or lost it."""
        ...

    def take(self, chunk: Chunk, at: float) -> None:
        """Record a message if it is the next one; it may block."""
        ...

    def commands(self) -> list[bytes]:
        """Bytes for the port that wait."""
        ...

    def finish(self, total: int) -> None:
        """The browser has no more than `total` messages."""
        ...


class LiveRelay:
    """Shared by the web socket's thread and the glove's."""

    def __init__(
        self, record: Callable[[float, bytes], None], line: Callable[[bool], None]
    ) -> None:
        """`record` passes bytes to the recording process, `line` says whether the port is open."""
        self._record, self._line = record, line
        self._changed, self._taking = threading.Condition(), threading.Lock()
        self._notify: Callable[[], object] | None = None
        self._commands: deque[bytes] = deque(maxlen=MOST_COMMANDS)
        self._total: int | None = None
        self.next_number, self.on_disk = 0, 0
        self.newest = float("-inf")
        self.is_ending = False

    @property
    def is_complete(self) -> bool:
        """Whether all that the browser had is on the disk."""
        return self._total is not None and self.on_disk >= self._total

    def attach(self, notify: Callable[[], object]) -> None:
        with self._changed:
            before, self._notify = self._notify, notify
        if before is not None:
            before()

    def detach(self, notify: Callable[[], object]) -> None:
        with self._changed:
            if self._notify is not notify:
                return
            self._notify = None
            self._changed.notify_all()
        self._line(False)

    def is_attached(self, notify: Callable[[], object]) -> bool:
        return self._notify is notify

    def set_port(self, is_open: bool) -> None:
        self._line(is_open)

    def take(self, chunk: Chunk, at: float) -> None:
        with self._taking:
            if chunk.number == self.next_number:
                self._record(at, chunk.data)
                self.next_number, self.newest = chunk.number + 1, at

    def commands(self) -> list[bytes]:
        with self._changed:
            found = list(self._commands)
            self._commands.clear()
        return found

    def finish(self, total: int) -> None:
        self._set(total=total)

    def command(self, data: bytes) -> None:
        """Bytes for the glove."""
        with self._changed:
            self._commands.append(data)
        self._tell()

    def acknowledge(self, on_disk: int) -> None:
        """So many messages are on the disk."""
        self._set(on_disk=on_disk)
        self._tell()

    def end(self, wait: float = FINISH_WAIT) -> bool:
        """Ask the browser for what it still keeps; False where not all of it came."""
        self.is_ending = True
        self._tell()
        with self._changed:
            self._changed.wait_for(lambda: self.is_complete or self._notify is None, wait)
        return self.is_complete

    def _set(self, on_disk: int | None = None, total: int | None = None) -> None:
        with self._changed:
            self.on_disk = max(self.on_disk, on_disk or 0)
            self._total = self._total if total is None else total
            self._changed.notify_all()

    def _tell(self) -> None:
        if (notify := self._notify) is not None:
            notify()
