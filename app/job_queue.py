"""Results are computed in one process, in order; the database is the queue, so a restart continues it.

Every computation ends with a settled result: done, failed with a sentence, or queued again.
"""

import contextlib
import logging
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from sqlalchemy.exc import DBAPIError

from handscope.app.private_log import describe_error
from handscope.app.workers.process import DiedError, WorkerProcess
from handscope.sessions.clinic import results
from handscope.sessions.store.store import Store, store_at

log = logging.getLogger(__name__)
NO_ROOM_WAIT = 5.0  # s between two tries to settle a result while the database takes nothing
# s for the running job to end when the server stops; else the next start repeats it
CLOSE_WAIT = 10.0


class Jobs:
    """A context manager; leaving it lets the running job end and drops the rest, which the next start repeats."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._process = WorkerProcess(prepare_store, store.folder, store.url)
        # its thread waits for the process
        self._queue = ThreadPoolExecutor(1, thread_name_prefix="jobs")
        self._leaving = threading.Event()

    def __enter__(self) -> "Jobs":
        self._queue.submit(self._process.do, _warm)
        with self._store.database() as db:
            for result_id in results.unfinished(db, self._store.server):
                self.process(result_id)
        return self

    def __exit__(self, *_: object) -> None:
        patience = threading.Timer(CLOSE_WAIT, self._process.kill)
        self._leaving.set()
        patience.start()
        self._queue.shutdown(wait=True, cancel_futures=True)
        patience.cancel()
        self._process.__exit__()

    def process(self, result_id: int) -> None:
        """Queue a result; while the server stops it is left to the next start."""
        with contextlib.suppress(RuntimeError):
            self._queue.submit(self._settle, result_id)

    def _settle(self, result_id: int) -> None:
        """In the queue's thread: make the result; an unfinished one does not stay 'running'."""
        try:
            self._process.do(_make, result_id)
            return
        except DiedError as end:
            log.error("result %s: %s", result_id, end)
            ended_by_others = end.was_terminated or self._leaving.is_set()
        except Exception:
            log.exception("result %s", result_id)
            ended_by_others = False
        while not self._conclude(result_id, ended_by_others) and not self._leaving.wait(
            NO_ROOM_WAIT
        ):
            pass

    def _conclude(self, result_id: int, ended_by_others: bool) -> bool:
        """Settle an unfinished result; False where the database cannot be written: a full disk."""
        try:
            with self._store.database() as db:
                if not ended_by_others:
                    results.fail(db, result_id)
                elif results.requeue(db, result_id) and not self._leaving.is_set():
                    self.process(result_id)
        except DBAPIError as problem:
            log.error("result %s: %s", result_id, describe_error(problem))
            return False
        return True


def prepare_store(folder: Path, url: str | None) -> Store:
    """First in a process that works on the store: numerics with one thread."""
    with contextlib.suppress(ImportError):
        from threadpoolctl import threadpool_limits

        threadpool_limits(1)
    return store_at(folder, url)


def _warm(_: Store) -> None:
    """Import what every job needs before the first one is asked for."""
    from handscope.app.results import make as results_make
    from handscope.app.results import report as results_report

    assert results_report and results_make


def _make(store: Store, result_id: int) -> None:
    from handscope.app.results.make import make

    make(store, result_id)
