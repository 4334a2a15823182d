"""Long work runs in one process, in order; the database is the queue, so a restart continues it.

Every computation ends with a settled result: done, failed with a sentence, or queued again.
"""

import asyncio
import contextlib
import logging
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Concatenate, ParamSpec, TypeVar

from sqlalchemy.exc import DBAPIError

from handscope.app.private_log import describe_error
from handscope.app.report import Paper
from handscope.app.workers.process import DiedError, WorkerProcess
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.sessions.clinic import results
from handscope.sessions.clinic.results import ENDED
from handscope.sessions.store.store import Store, store_at

log = logging.getLogger(__name__)
P = ParamSpec("P")
T = TypeVar("T")
NO_ROOM_WAIT = 5.0  # s between two tries to settle a result while the database takes nothing
CLOSE_WAIT = (
    10.0  # s for the running job to end when the server stops; else the next start repeats it
)


class Jobs:
    """A context manager; leaving it lets the running job end and drops the rest, which the next start repeats."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._process = WorkerProcess(_prepare, store.folder, store.url)
        self._queue = ThreadPoolExecutor(
            1, thread_name_prefix="jobs"
        )  # its thread waits for the process
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

    async def run(
        self, work: Callable[Concatenate[Store, P], T], *given: P.args, **named: P.kwargs
    ) -> T:
        """Run other work there (a report, an export) on the store, and wait for it."""
        waiting = self._queue.submit(lambda: self._process.do(work, *given, **named))
        try:
            return await asyncio.wrap_future(waiting)
        except DiedError:
            raise InputError(ENDED) from None

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


def _prepare(folder: Path, url: str | None) -> Store:
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


def make_report(
    store: Store,
    result_id: int,
    form: str,
    language: str = "en",
    paper: Paper = "a4",
    grading: str = "",
    references: int | None = None,
) -> bytes:
    """In the worker process: the report of a result as pdf, csv or json."""
    from handscope.app.language import languages
    from handscope.app.report import FORMS, Style
    from handscope.app.report.gradings import DEFAULT, grade_content
    from handscope.app.results.report import report

    with store.database() as db:
        content = grade_content(
            report(store, results.get(db, result_id), references), grading or DEFAULT
        )
        return FORMS[form](content, Style(languages()[language], paper))


def make_progress_report(
    store: Store, patient_id: int, hand: Hand, language: str = "en", paper: Paper = "a4"
) -> bytes:
    """In the worker process: a patient's progress as pdf; InputError where nothing of the hand was measured twice."""
    from handscope.app.language import languages
    from handscope.app.report.progress.stored import progress_report

    with store.database() as db:
        return progress_report(db, store, patient_id, hand, languages()[language], paper)


def make_replay_file(store: Store, result_id: int, named: bool, language: str = "en") -> bytes:
    """In the worker process: the replay of a result as one file."""
    from handscope.app.language import languages
    from handscope.app.replay_file.stored import of_result

    with store.database() as db:
        return of_result(store, results.get(db, result_id), named, languages()[language])


def make_derivative(store: Store, result_id: int, reasons: bool = True) -> bytes:
    """In the worker process: the derivative of a result as a zip."""
    from handscope.app.results.make import derivative_files
    from handscope.sessions.motion_bids.writer import pack

    with store.database() as db:
        return pack(derivative_files(store, results.get(db, result_id), reasons))


def make_export(store: Store, result_id: int, name: str, sees_all: bool = True) -> bytes:
    """In the worker process: a result in a format of sessions/exports; several files as a zip.

    What people typed (reasons of corrections, the report) is left out unless the account `sees_all`.
    """
    from handscope.app.exporting.measured import export_processed, gather, without_text
    from handscope.app.exporting.saving import packed
    from handscope.app.results.make import params_of, process_result
    from handscope.sessions.exports import format_of

    with store.database() as db:
        result = results.get(db, result_id)
        recording, processed = process_result(store, result, reasons=sees_all)
        params = params_of(result)
        measured = gather(recording, processed, result.method, params, software=result.version)
    if not sees_all:
        measured = without_text(measured)
    made = export_processed(measured, name, processed, params, with_report=sees_all)
    return packed(made.files, format_of(name), f"handscope-{name}")
