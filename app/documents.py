"""What is made when somebody asks for it (a report, an export, a replay file), in a process of its own or on the administrator's cluster: it waits for no computation.

Whoever leaves (closes the window, presses Stop) ends the work: what waits is dropped, what is being made is ended with its process (on a cluster: see workers/cluster.py).
"""

import asyncio
import threading
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Concatenate, ParamSpec, TypeVar

from handscope.app.job_queue import prepare_store
from handscope.app.report import Paper
from handscope.app.workers.cluster import worker
from handscope.app.workers.process import DiedError
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.sessions.clinic import results
from handscope.sessions.clinic.results import ENDED
from handscope.sessions.store.store import Store

P = ParamSpec("P")
T = TypeVar("T")
LOOK = 0.25  # s between two looks whether the one who asked is still there


class LeftError(Exception):
    """Whoever asked is not there any more."""


class Documents:
    """A context manager; leaving it ends what is being made."""

    def __init__(self, store: Store, scheduler: str | None = None) -> None:
        self._process = worker(scheduler, prepare_store, store.folder.absolute(), store.url)
        self._queue = ThreadPoolExecutor(1, thread_name_prefix="documents")
        self._turn = threading.Lock()
        self._made: object = None  # what the process works for

    def __enter__(self) -> "Documents":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._queue.shutdown(wait=True, cancel_futures=True)
        self._process.__exit__()

    async def run(
        self,
        gone: Callable[[], Awaitable[bool]],
        work: Callable[Concatenate[Store, P], T],
        *given: P.args,
        **named: P.kwargs,
    ) -> T:
        """Run `work` there on the store and wait for it; as soon as whoever asked is `gone`, it ends with LeftError."""
        wish = object()

        def make() -> T:
            self._now_for(wish)
            try:
                return self._process.do(work, *given, **named)
            finally:
                self._now_for(None)

        waiting = self._queue.submit(make)
        done = asyncio.wrap_future(waiting)
        try:
            while not (await asyncio.wait({done}, timeout=LOOK))[0]:
                if await gone():
                    raise LeftError
            return done.result()
        except DiedError:
            raise InputError(ENDED) from None
        finally:
            done.cancel()  # else a cancelled task would be logged as an error that was never retrieved
            if not waiting.cancel():
                self._stop(wish)

    def _now_for(self, wish: object) -> None:
        with self._turn:
            self._made = wish

    def _stop(self, wish: object) -> None:
        with self._turn:  # else the next one's work might be ended
            if self._made is wish:
                self._process.kill()


@dataclass(frozen=True)
class Asked:
    """The documents, for one who asks and may leave."""

    documents: Documents
    gone: Callable[[], Awaitable[bool]]

    async def run(
        self, work: Callable[Concatenate[Store, P], T], *given: P.args, **named: P.kwargs
    ) -> T:
        """As Documents.run."""
        return await self.documents.run(self.gone, work, *given, **named)


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
