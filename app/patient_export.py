"""The process that writes a patient's export: it computes and reads for long, so the server only passes on what comes out of it.

Run as `python -m app.patient_export` with its order as JSON on standard input; the zip goes to standard output. When nobody takes the zip any more,
writing fails and the process leaves.
"""

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from app.version import software_version
from estimators.errors import InputError
from sessions import patient_export
from sessions.store import Store, store_at

PIECE = 2**16


def exported(store: Store, patient_id: int) -> Iterator[bytes]:
    """The zip piece by piece; InputError where it could not be begun, an error in the middle cuts it off so that nobody takes it for whole."""
    order = {"folder": str(store.folder), "url": store.url, "patient": patient_id}
    with subprocess.Popen([sys.executable, "-m", "app.patient_export"], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin is not None and process.stdout is not None
        try:
            process.stdin.write(json.dumps(order).encode())
            process.stdin.close()
            while piece := os.read(process.stdout.fileno(), PIECE):
                yield piece
            if process.wait() != 0:
                raise InputError("the export could not be finished; the log has the details, try again")
        finally:
            process.kill()


def main() -> int:
    order = json.load(sys.stdin)
    store = store_at(Path(order["folder"]), order["url"])
    with contextlib.suppress(BrokenPipeError), store.database() as db:
        patient_export.write(db, store, order["patient"], software_version(), sys.stdout.buffer)
        sys.stdout.buffer.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
