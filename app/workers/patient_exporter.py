"""Writes a patient's export in a process of its own; the server only passes its bytes on.

On Linux it is forked from a process that has imported everything (app/workers/process.py). When nobody reads the
zip any more, writing fails and the process ends.
"""

import contextlib
import io
import os
from collections.abc import Iterator, Mapping
from multiprocessing.connection import Connection
from pathlib import Path

from handscope.app.version import software_version
from handscope.app.workers.process import CONTEXT, ignore_terminal_signals
from handscope.estimators.errors import InputError
from handscope.sessions.store import patient_export
from handscope.sessions.store.store import Store, store_at

CHUNK = 2**16


def stream_patient_export(store: Store, patient_id: int) -> Iterator[bytes]:
    """The zip in chunks; InputError where it cannot start. A later error truncates it, so that no program reads it as complete."""
    ours, theirs = CONTEXT.Pipe(duplex=False)
    arguments = (theirs, dict(os.environ), store.folder, store.url, patient_id)
    process = CONTEXT.Process(target=_write, args=arguments, name="handscope export", daemon=True)
    process.start()
    theirs.close()
    try:
        with contextlib.suppress(EOFError):
            while True:
                yield ours.recv_bytes()
        process.join()
        if process.exitcode != 0:
            raise InputError("job.export_failed")
    finally:
        ours.close()
        process.kill()
        process.join()


class _PipeFile(io.RawIOBase):
    """A file that goes through a pipe."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe

    def writable(self) -> bool:
        return True

    def write(self, chunk: object) -> int:
        sent = memoryview(chunk)  # type: ignore[arg-type]
        self._pipe.send_bytes(sent)
        return sent.nbytes


def _write(
    pipe: Connection, environment: Mapping[str, str], folder: Path, url: str | None, patient_id: int
) -> None:
    """In the process, with the present environment of its parent."""
    ignore_terminal_signals()
    os.environ.clear()
    os.environ.update(environment)
    store = store_at(folder, url)
    with contextlib.suppress(BrokenPipeError), store.database() as db:
        out = io.BufferedWriter(_PipeFile(pipe), CHUNK)
        patient_export.write(db, store, patient_id, software_version(), out)
        out.flush()
