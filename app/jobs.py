"""Work that takes long runs in one process of its own, in order; the database is the queue, so a restart goes on where it was."""

import asyncio
import contextlib
import logging
import multiprocessing
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

from sessions import results
from sessions.store import Store

log = logging.getLogger(__name__)
T = TypeVar("T")


class Jobs:
    """A context manager; leaving it lets the running job end and forgets the rest, which the next start takes up."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._pool = self._new_pool()

    def __enter__(self) -> "Jobs":
        self._submit(_warm)
        with self._store.database() as db:
            for result_id in results.unfinished(db):
                self.process(result_id)
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(wait=True, cancel_futures=True)

    def process(self, result_id: int) -> "Future[None]":
        """Queue a result."""
        return self._submit(_make, result_id)

    async def run(self, work: Callable[..., T], *arguments: Any) -> T:
        """Do other work there (a report, an export) and wait for it."""
        return await asyncio.wrap_future(self._submit(work, *arguments))

    def _submit(self, work: Callable[..., T], *arguments: Any) -> "Future[T]":
        try:
            return self._pool.submit(work, *arguments)
        except RuntimeError:  # the process died (killed from outside): start another, the queue is in the database
            log.exception("the process for long work is started again")
            self._pool = self._new_pool()
            return self._pool.submit(work, *arguments)

    def _new_pool(self) -> ProcessPoolExecutor:
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(1, mp_context=context, initializer=_begin, initargs=(self._store.folder, self._store.url))


_store: Store | None = None  # of the working process; set once when it begins


def _begin(folder: Path, url: str | None) -> None:
    global _store
    from sessions.database import open_database

    with contextlib.suppress(ImportError):
        from threadpoolctl import threadpool_limits

        threadpool_limits(1)
    _store = Store(folder, open_database(folder, url), url)


def _warm() -> None:
    """Load what every job needs before the first person waits for one."""
    from app import reporting, results

    assert reporting and results


def _make(result_id: int) -> None:
    from app.results import make

    assert _store is not None
    make(_store, result_id)


def make_report(result_id: int, form: str) -> bytes:
    """In the working process: the report of a result as pdf, csv or json."""
    from app.report import FORMS
    from app.reporting import report

    assert _store is not None
    with _store.database() as db:
        return FORMS[form](report(_store, results.get(db, result_id)))


def make_derivative(result_id: int) -> bytes:
    """In the working process: the derivative of a result as a zip."""
    from app.results import derivative_files
    from sessions.motion_bids.writer import packed

    assert _store is not None
    with _store.database() as db:
        return packed(derivative_files(_store, results.get(db, result_id)))
