"""The process that writes a patient's export: it computes and reads for long, so the server only passes on what comes out of it.

On Linux it is forked from a process that has imported everything (app/workers/process.py). When nobody takes the zip any more, writing fails and the
process leaves.
"""

import contextlib
import io
import os
from collections.abc import Iterator, Mapping
from multiprocessing.connection import Connection
from pathlib import Path

from handscope.app.version import software_version
from handscope.app.workers.process import CONTEXT, heed_the_server_alone
from handscope.estimators.errors import InputError
from handscope.sessions.store import patient_export
from handscope.sessions.store.store import Store, store_at

PIECE = 2**16


def exported(store: Store, patient_id: int) -> Iterator[bytes]:
    """The zip piece by piece; InputError where it could not be begun, an error in the middle cuts it off so that nobody takes it for whole."""
    ours, theirs = CONTEXT.Pipe(duplex=False)
    order = (theirs, dict(os.environ), store.folder, store.url, patient_id)
    process = CONTEXT.Process(target=_write, args=order, name="handscope export", daemon=True)
    process.start()
    theirs.close()
    try:
        with contextlib.suppress(EOFError):
            while True:
                yield ours.recv_bytes()
        process.join()
        if process.exitcode != 0:
            raise InputError("the export could not be finished; the log has the details, try again")
    finally:
        ours.close()
        process.kill()
        process.join()


class _Pieces(io.RawIOBase):
    """A file that goes through a pipe."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe

    def writable(self) -> bool:
        return True

    def write(self, piece: object) -> int:
        sent = memoryview(piece)  # type: ignore[arg-type]
        self._pipe.send_bytes(sent)
        return sent.nbytes


def _write(
    pipe: Connection, environment: Mapping[str, str], folder: Path, url: str | None, patient_id: int
) -> None:
    """In the process, in the environment that its parent has now."""
    heed_the_server_alone()
    os.environ.clear()
    os.environ.update(environment)
    store = store_at(folder, url)
    with contextlib.suppress(BrokenPipeError), store.database() as db:
        out = io.BufferedWriter(_Pieces(pipe), PIECE)
        patient_export.write(db, store, patient_id, software_version(), out)
        out.flush()
