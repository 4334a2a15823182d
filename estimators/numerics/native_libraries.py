"""What numerics ask of BLAS while they work, and of the C library behind it.

In      a piece of work with threads of its own
Out     the same values in less time, or with less memory left behind
Source  threads of OpenBLAS wait by turning round, for those of ours, too; malloc_trim(3) of glibc
Limits  for the whole process
"""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from threadpoolctl import threadpool_limits


@contextmanager
def single_threaded_blas() -> Iterator[None]:
    """BLAS works in the thread that calls it until the block is left."""
    with threadpool_limits(1, user_api="blas"):
        yield


@contextmanager
def freed_memory_returned() -> Iterator[None]:
    """The system gets back what was freed when the block is left: glibc keeps it, in a pool of each thread that worked. Some milliseconds."""
    try:
        yield
    finally:
        with suppress(OSError, AttributeError, TypeError):  # another C library
            ctypes.CDLL(None).malloc_trim(0)
