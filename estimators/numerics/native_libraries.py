"""What numerics ask of BLAS while they work.

In      a piece of work with threads of its own
Out     the same values in less time
Source  threads of OpenBLAS wait by turning round, for those of ours, too
Limits  for the whole process
"""

from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def single_threaded_blas() -> Iterator[None]:
    """BLAS works in the thread that calls it until the block is left."""
    with threadpool_limits(1, user_api="blas"):
        yield
