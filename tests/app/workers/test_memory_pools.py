"""The threads of a server share few pools of memory."""

import platform
import subprocess
import sys

import pytest

from handscope.app.workers.memory_pools import POOLS

THREADS = """
import ctypes, threading
from handscope.app.workers.memory_pools import limit_memory_pools
{limit}
libc, together = ctypes.CDLL(None), threading.Barrier(8)
libc.fdopen.restype = libc.malloc.restype = ctypes.c_void_p
def take():
    libc.malloc(10_000)
    together.wait()
threads = [threading.Thread(target=take) for _ in range(8)]
[t.start() for t in threads], [t.join() for t in threads]
out = ctypes.c_void_p(libc.fdopen(1, b"w"))
libc.malloc_info(0, out), libc.fflush(out)
"""


def pools_of(limit: str) -> int:
    command = [sys.executable, "-P", "-c", THREADS.format(limit=limit)]
    return subprocess.run(command, check=True, capture_output=True).stdout.count(b"<heap nr=")


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc has such pools")
def test_threads_share_pools_of_memory() -> None:
    assert pools_of("") > POOLS
    assert pools_of("limit_memory_pools()") <= POOLS
