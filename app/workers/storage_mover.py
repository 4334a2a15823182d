"""Moves closed files into the object storage in a process of its own, and tries again until that works."""

import logging
import threading

from handscope.app.workers.process import DiedError, WorkerProcess
from handscope.sessions.store import stored_files
from handscope.sessions.store.store import Store, store_at
from handscope.sessions.store.stored_files import Round

log = logging.getLogger(__name__)
PAUSE = 10.0  # s between two rounds


class StorageMover:
    """A context manager; leaving it ends the current round: its files are still in the data folder."""

    def __init__(self, store: Store, cache_bytes: int) -> None:
        assert store.away is not None
        self._process = WorkerProcess(store_at, store.folder, store.url)
        self._cache_bytes = cache_bytes
        self._leaving = threading.Event()
        self._thread = threading.Thread(target=self._run, name="moving out", daemon=True)
        self.latest = Round()

    def __enter__(self) -> "StorageMover":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._leaving.set()
        self._process.kill()
        self._thread.join()
        self._process.__exit__()

    def _run(self) -> None:
        while not self._leaving.is_set():
            try:
                latest = self._process.do(stored_files.move_out, self._cache_bytes)
            except DiedError:
                latest = Round(
                    problem="the process that moves recordings ended; it is started again"
                )
            except Exception as problem:
                log.exception("moving recordings into the object storage")
                latest = Round(problem=f"{type(problem).__name__}; the log has the details")
            if (
                latest.problem
                and latest.problem != self.latest.problem
                and not self._leaving.is_set()
            ):
                log.error("%s; %d files wait in the data folder", latest.problem, latest.waiting)
            self.latest = latest
            self._leaving.wait(PAUSE)
