"""Closed files go into the object storage while the server runs: a process of its own does it, so that live views do not wait, and tries again for ever."""

import logging
import threading
from pathlib import Path

from handscope.app.workers.process import DiedError, WorkingProcess
from handscope.sessions.store import stored_files
from handscope.sessions.store.store import Store, store_at
from handscope.sessions.store.stored_files import Round

log = logging.getLogger(__name__)
PAUSE = 10.0  # s between two rounds


class MovingOut:
    """A context manager; leaving it ends the round that goes on: what it had in hand is still in the data folder."""

    def __init__(self, store: Store, cache_bytes: int) -> None:
        assert store.away is not None
        self._process = WorkingProcess(_begin, store.folder, store.url)
        self._cache_bytes = cache_bytes
        self._leaving = threading.Event()
        self._thread = threading.Thread(target=self._go_round, name="moving out", daemon=True)
        self.latest = Round()

    def __enter__(self) -> "MovingOut":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._leaving.set()
        self._process.kill()
        self._thread.join()
        self._process.__exit__()

    def _go_round(self) -> None:
        while not self._leaving.is_set():
            try:
                done = self._process.do(_round, self._cache_bytes)
            except DiedError:
                done = Round(problem="the process that moves recordings ended; it is started again")
            except Exception as problem:
                log.exception("moving recordings into the object storage")
                done = Round(problem=f"{type(problem).__name__}; the log has the details")
            if done.problem and done.problem != self.latest.problem and not self._leaving.is_set():
                log.error("%s; %d files wait in the data folder", done.problem, done.waiting)
            self.latest = done
            self._leaving.wait(PAUSE)


_store: Store | None = None  # of the process; set once when it begins


def _begin(folder: Path, url: str | None) -> None:
    global _store
    _store = store_at(folder, url)


def _round(cache_bytes: int) -> Round:
    assert _store is not None
    return stored_files.move_out(_store, cache_bytes)
