"""The viewers of a station, notified of every change."""

import threading
from collections.abc import Callable


class Viewers:
    """Callbacks, called from any thread whenever something changed."""

    def __init__(self) -> None:
        self._notices: list[Callable[[], object]] = []
        self._lock = threading.Lock()
        self.changes = 0  # counts notifications
        self._newest: object = None  # pose at the tick before

    def __bool__(self) -> bool:
        return bool(self._notices)

    def add(self, notice: Callable[[], object]) -> Callable[[], None]:
        """Add a callback; returns a function that removes it."""
        with self._lock:
            self._notices.append(notice)

        def leave() -> None:
            with self._lock:
                self._notices.remove(notice)

        return leave

    def notify(self) -> None:
        """Call every callback."""
        self.changes += 1
        for notice in list(self._notices):
            notice()

    def notify_at_tick(self, newest: object) -> None:
        """At every tick, with the newest pose: where poses come, viewers get the tick's news with the next one; else now."""
        before, self._newest = self._newest, newest
        if newest is before:
            self.notify()
