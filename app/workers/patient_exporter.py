"""Writes a patient's export in a process of its own; the server only passes its bytes on.

On Linux it is forked from a process that has imported everything (app/workers/process.py). When nobody reads the
zip any more, writing fails and the process ends.
"""

import io
from collections.abc import Iterator

from handscope.app.version import software_version
from handscope.app.workers.process import DiedError, Send, WorkerProcess
from handscope.estimators.errors import InputError
from handscope.sessions.store import patient_export
from handscope.sessions.store.store import Store, store_at

CHUNK = 2**16


def stream_patient_export(store: Store, patient_id: int) -> Iterator[bytes]:
    """The zip in chunks; InputError where it cannot start. A later error truncates it, so that no program reads it as complete."""
    with WorkerProcess(store_at, store.folder, store.url) as process:
        try:
            yield from process.stream(_write, patient_id)
        except DiedError:
            raise InputError("job.export_failed") from None
        finally:
            process.kill()


class _SendingFile(io.RawIOBase):
    """A file whose bytes are sent."""

    def __init__(self, send: Send) -> None:
        self._send = send

    def writable(self) -> bool:
        return True

    def write(self, chunk: object) -> int:
        written = bytes(chunk)  # type: ignore[call-overload]
        self._send(written)
        return len(written)


def _write(store: Store, send: Send, patient_id: int) -> None:
    """In the process."""
    with store.database() as db:
        out = io.BufferedWriter(_SendingFile(send), CHUNK)
        patient_export.write(db, store, patient_id, software_version(), out)
        out.flush()
