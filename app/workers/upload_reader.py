"""Reads uploaded recordings in a process of its own, so that live views do not wait.

The process of app/job_queue.py would make an upload wait for everything that is computed there.
"""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

from handscope.app.workers.process import DiedError, WorkerProcess, no_context
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.store import records
from handscope.sessions.store.records import Upload

T = TypeVar("T")
DIED = phrase("recording.reader_ended")


class UploadReader:
    """A context manager; leaving it stops the reading."""

    def __init__(self) -> None:
        self._process = WorkerProcess(no_context)
        # its thread waits for the process
        self._queue = ThreadPoolExecutor(1, thread_name_prefix="opening")

    def __enter__(self) -> "UploadReader":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._queue.shutdown(wait=True, cancel_futures=True)
        self._process.__exit__()

    async def read(self, upload: Path, name: str, hand: Hand | None) -> Upload:
        """Content of an uploaded recording; InputError where it cannot be opened."""
        return await self.call(records.read_upload, upload, name, hand)

    async def call(self, work: Callable[..., T], *arguments: Any) -> T:
        """Call `work` in the process; InputError where it refuses, or the process ends."""
        try:
            return await asyncio.wrap_future(
                self._queue.submit(lambda: self._process.do(_call, work, arguments))
            )
        except DiedError:
            raise InputError(DIED) from None


def _call(_: None, work: Callable[..., T], arguments: tuple[Any, ...]) -> T:
    return work(*arguments)
