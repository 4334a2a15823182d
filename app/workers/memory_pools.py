"""How many pools of memory the threads of a server share.

glibc gives up to eight pools for each core; each keeps what its threads have freed. A station has
five threads that come and go, and its samples of the last 90 s lie scattered over their pools.
"""

import contextlib
import ctypes
import sys

POOLS = 2
_ARENA_MAX = -8  # of mallopt, in malloc.h


def limit_memory_pools() -> None:
    """From now on; elsewhere than with glibc nothing is changed."""
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):  # another C library
            ctypes.CDLL(None).mallopt(_ARENA_MAX, POOLS)
