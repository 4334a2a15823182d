"""What numerics ask of BLAS and of the C library while they work.

In      a piece of work with threads of its own and arrays of some MB
Out     the same values in less time, in less memory
Source  threads of OpenBLAS wait by turning round, for those of ours, too. glibc's malloc.h: an array
        of a heap is given back where nothing lies above it only, one that is mapped at once
Limits  for the whole process. With another C library memory stays as it is. glibc raises the size
        from which arrays are mapped by itself until it was set once: after the work the largest that
        it would raise it to stays
"""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits

# of mallopt: how much is kept free above a heap, from which size arrays are mapped
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
MAPPED = 2 << 20  # bytes
USUAL_TRIM, LARGEST_TRIM, LARGEST_MAPPED = 128 << 10, 64 << 20, 32 << 20  # glibc's own


@contextmanager
def single_threaded_blas() -> Iterator[None]:
    """BLAS works in the thread that calls it until the block is left."""
    with threadpool_limits(1, user_api="blas"):
        yield


@contextmanager
def large_arrays_given_back() -> Iterator[None]:
    """Arrays of MAPPED and more return to the system as soon as they are free, until the block is left."""
    try:
        libc = ctypes.CDLL(None)
        adjust, trim = libc.mallopt, libc.malloc_trim
    except (OSError, AttributeError, TypeError):  # another C library
        yield
        return
    adjust(_MMAP_THRESHOLD, MAPPED)
    adjust(_TRIM_THRESHOLD, USUAL_TRIM)
    try:
        yield
    finally:
        adjust(_MMAP_THRESHOLD, LARGEST_MAPPED)
        adjust(_TRIM_THRESHOLD, LARGEST_TRIM)
        trim(0)
