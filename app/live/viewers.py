"""Who watches a station, and that there is something new for them."""

import threading
from collections.abc import Callable


class Viewers:
    """Notices to be called, from any thread, whenever something changed."""

    def __init__(self) -> None:
        self._notices: list[Callable[[], object]] = []
        self._lock = threading.Lock()
        self.changes = 0  # another number, something new

    def __bool__(self) -> bool:
        return bool(self._notices)

    def add(self, notice: Callable[[], object]) -> Callable[[], None]:
        """Have `notice` called; gives back how to stop that."""
        with self._lock:
            self._notices.append(notice)

        def leave() -> None:
            with self._lock:
                self._notices.remove(notice)

        return leave

    def notify(self) -> None:
        """There is something new."""
        self.changes += 1
        for notice in list(self._notices):
            notice()
