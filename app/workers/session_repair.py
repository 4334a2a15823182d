"""Closes the sessions that the last server left open, in a process of its own while the server serves already.

First every session is closed from the end of its recording, which takes no longer for a long one. Then the recordings are read whole, one after the
other, for checksum and summary, and results follow.
"""

import logging
import threading
from collections.abc import Callable, Iterator, Sequence

from sqlalchemy.exc import DBAPIError

from handscope.app.workers.process import DiedError, WorkerProcess
from handscope.estimators.errors import InputError
from handscope.sessions.store import crash_repair
from handscope.sessions.store.crash_repair import UNREAD
from handscope.sessions.store.store import Store, store_at

log = logging.getLogger(__name__)


class SessionRepair:
    """A context manager; leaving it stops the repair, which the next start begins again.

    `finish(session)` follows in this process for each session whose recording was read whole.
    """

    def __init__(
        self,
        store: Store,
        left_open: Sequence[int],
        unread: Sequence[int],
        finish: Callable[[int], None],
    ) -> None:
        self._process = WorkerProcess(store_at, store.folder, store.url)
        self._finish = finish
        self._open = _Waiting(left_open)
        self._unread = _Waiting(unread)
        self._leaving = threading.Event()
        self._starting = threading.Lock()
        self._is_running = False
        self._thread: threading.Thread | None = None

    def __enter__(self) -> "SessionRepair":
        self._start()
        return self

    def __exit__(self, *_: object) -> None:
        self._leaving.set()
        self._process.kill()
        if self._thread is not None:
            self._thread.join()
        self._process.__exit__()

    def add(self, session: int) -> None:
        """Another session is to be closed."""
        self._open.add(session)
        self._start()

    def progress(self, session: int) -> tuple[int, int] | None:
        """Which of how many is being repaired, where this session is among those that are not yet; else None."""
        return self._open.progress(session)

    def reading(self, session: int) -> tuple[int, int] | None:
        """Which of how many is being read whole, where this session is among those that are not yet; else None."""
        return self._unread.progress(session)

    def _start(self) -> None:
        """Begin to work where there is work and nobody does it."""
        with self._starting:
            if not self._is_running and self._has_work():
                self._is_running = True
                self._thread = threading.Thread(target=self._run, name="repair", daemon=True)
                self._thread.start()

    def _has_work(self) -> bool:
        waiting = (self._open.first(), self._unread.first())
        return waiting != (None, None) and not self._leaving.is_set()

    def _goes_on(self) -> bool:
        """Whether there is work; who adds some later starts anew."""
        with self._starting:
            self._is_running = self._has_work()
            return self._is_running

    def _run(self) -> None:
        while self._goes_on():
            self._work_through()

    def _work_through(self) -> None:
        for session in self._open.each(self._leaving):
            state = self._do(_close, session)
            if state == UNREAD:
                self._unread.add(session)
            elif state == "recorded":
                self._do_here(session)
        for session in self._unread.each(self._leaving):
            if self._do(_read, session) == "recorded":
                self._do_here(session)

    def _do(self, work: Callable[[Store, int], str], session: int) -> str:
        """What came of it in the process; "" where it failed."""
        try:
            return self._process.do(work, session)
        except (InputError, DBAPIError, DiedError) as problem:
            if not self._leaving.is_set():
                log.warning("session %s is not repaired: %s", session, type(problem).__name__)
        except Exception:
            log.exception("session %s is not repaired", session)
        return ""

    def _do_here(self, session: int) -> None:
        try:
            self._finish(session)
        except (InputError, DBAPIError) as problem:
            log.warning("session %s is not processed: %s", session, type(problem).__name__)
        except Exception:
            log.exception("session %s is not processed", session)


class _Waiting:
    """Sessions in a row, taken by one thread and looked at by others; the first stays until it is done."""

    def __init__(self, sessions: Sequence[int]) -> None:
        self._waiting, self._total = list(sessions), len(sessions)
        self._lock = threading.Lock()

    def add(self, session: int) -> None:
        with self._lock:
            self._waiting.append(session)
            self._total += 1

    def first(self) -> int | None:
        with self._lock:
            return self._waiting[0] if self._waiting else None

    def each(self, leaving: threading.Event) -> Iterator[int]:
        while (session := self.first()) is not None and not leaving.is_set():
            yield session
            with self._lock:
                self._waiting.pop(0)

    def progress(self, session: int) -> tuple[int, int] | None:
        with self._lock:
            if session not in self._waiting:
                return None
            return self._total - len(self._waiting) + 1, self._total


def _close(store: Store, session: int) -> str:
    """Close a session; its state then, UNREAD where the ends of its recording alone were read."""
    with store.database() as db:
        closed = crash_repair.close_from_ends(db, store, session)
        return UNREAD if any(map(crash_repair.is_unread, closed.recordings)) else closed.state


def _read(store: Store, session: int) -> str:
    """Read a session's recordings whole; its state then."""
    with store.database() as db:
        return crash_repair.read_whole(db, store, session).state
