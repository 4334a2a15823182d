"""One kernel at a time is translated, or loaded, by all processes that keep their code in the same place.

numba keeps a row kernel in two files: the loop over rows is found by a name that the other one holds, and that differs between processes.
Where two of them translate the same kernel at once, each may write one of the files; the loop is then nowhere, and its first call ends the process,
now and whenever the kernel is loaded.
"""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from numba.core.caching import FunctionCache

from handscope.estimators.numerics.optional_imports import system_module

THREADS = threading.Lock()
FILE = "translation.lock"
fcntl, msvcrt = system_module("fcntl"), system_module("msvcrt")


@contextmanager
def translating() -> Iterator[None]:
    """Hold other threads and processes back from translating kernels."""
    with THREADS:
        try:
            file = os.open(kept_in() / FILE, os.O_RDWR | os.O_CREAT, 0o600)
        except OSError:  # numba cannot write there either: nothing is kept
            yield
            return
        try:
            _wait_for(file)
            yield
        finally:
            os.close(file)  # lets go of it, as the end of a process does


def _wait_for(file: int) -> None:
    if fcntl is not None:
        fcntl.flock(file, fcntl.LOCK_EX)
    elif msvcrt is not None:
        while True:
            with suppress(OSError):  # after ten seconds
                msvcrt.locking(file, msvcrt.LK_LOCK, 1)
                return


@cache
def kept_in() -> Path:
    """Where numba keeps kernels of this package's folder: beside it, or in the user's own cache where that is not writable."""
    return Path(FunctionCache(_wait_for).cache_path)
