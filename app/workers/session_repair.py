"""Closes the sessions that the last server left open, in a process of its own while the server serves already.

A recording is read whole for its summary, which takes longer the longer it is. A session stays open until then; what is recorded in it is
on the disk.
"""

import logging
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from sqlalchemy.exc import DBAPIError

from handscope.app.workers.process import DiedError, WorkerProcess
from handscope.estimators.errors import InputError
from handscope.sessions.store import records
from handscope.sessions.store.store import Store, store_at

log = logging.getLogger(__name__)


class SessionRepair:
    """A context manager; leaving it stops the repair, which the next start begins again.

    `finish(session)` follows in this process for each session that is closed.
    """

    def __init__(
        self, store: Store, sessions: Sequence[int], finish: Callable[[int], None]
    ) -> None:
        self._process = WorkerProcess(_initialise, store.folder, store.url)
        self._finish = finish
        self._waiting = list(sessions)  # the first is being repaired
        self._total = len(sessions)
        self._lock = threading.Lock()
        self._leaving = threading.Event()
        self._thread = threading.Thread(target=self._run, name="repair", daemon=True)

    def __enter__(self) -> "SessionRepair":
        if self._waiting:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._leaving.set()
        self._process.kill()
        if self._thread.ident is not None:
            self._thread.join()
        self._process.__exit__()

    def progress(self, session: int) -> tuple[int, int] | None:
        """Which of how many is being repaired, where this session is among those that are not yet; else None."""
        with self._lock:
            if session not in self._waiting:
                return None
            return self._total - len(self._waiting) + 1, self._total

    def _run(self) -> None:
        while self._waiting and not self._leaving.is_set():
            session = self._waiting[0]
            try:
                if self._process.do(_close, session) == "recorded":
                    self._finish(session)
            except (InputError, DBAPIError, DiedError) as problem:
                if not self._leaving.is_set():
                    log.warning("session %s stays open: %s", session, type(problem).__name__)
            except Exception:
                log.exception("session %s stays open", session)
            with self._lock:
                self._waiting.pop(0)


_store: Store | None = None  # of the process, set once at its start


def _initialise(folder: Path, url: str | None) -> None:
    global _store
    _store = store_at(folder, url)


def _close(session: int) -> str:
    """Close a session; its state then."""
    assert _store is not None
    with _store.database() as db:
        return records.close(db, _store, session).state
