"""Reads uploaded recordings in a process of its own, so that live views do not wait.

The process of app/job_queue.py would make an upload wait for everything that is computed there.
"""

import asyncio
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from handscope.app.workers.process import DiedError, WorkerProcess
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.sessions.store import records
from handscope.sessions.store.records import Upload

DIED = "the recording could not be opened: the process that read it ended, perhaps for want of memory; split the recording and try again"


class UploadReader:
    """A context manager; leaving it stops the reading."""

    def __init__(self) -> None:
        self._process = WorkerProcess(_initialise)
        self._queue = ThreadPoolExecutor(
            1, thread_name_prefix="opening"
        )  # its thread waits for the process

    def __enter__(self) -> "UploadReader":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._queue.shutdown(wait=True, cancel_futures=True)
        self._process.__exit__()

    async def read(self, upload: Path, name: str, hand: Hand | None) -> Upload:
        """Content of an uploaded recording; InputError where it cannot be opened."""
        try:
            return await asyncio.wrap_future(
                self._queue.submit(self._process.do, records.read_upload, upload, name, hand)
            )
        except DiedError:
            raise InputError(DIED) from None


def _initialise() -> None:
    """Reading needs no preparation."""
