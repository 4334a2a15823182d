"""Two processes that translate the same row kernel at once: what is kept must serve a third."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process
KERNEL = """
from handscope.estimators.numerics.jit import rowwise

@rowwise("(n)->()")
def sum_of(a, out):
    s = 0.0
    for k in range(len(a)):
        s += a[k]
    out[0] = s
"""
WORKER = """
import sys, time
from pathlib import Path
from numba import njit
from numba.core.caching import FunctionCache
from numba.np.ufunc.wrappers import GufWrapperCache

first, folder = sys.argv[1] == "first", Path(sys.argv[2])

def wait_for(name, seconds):
    until = time.monotonic() + seconds
    while not (folder / name).exists() and time.monotonic() < until:
        time.sleep(0.01)

save, save_loop = FunctionCache.save_overload, GufWrapperCache.save_overload

def keep(self, *what):
    wait_for("second began" if first else "first kept its row", 30)
    save(self, *what)
    if first:
        (folder / "first kept its row").touch()

def keep_loop(self, *what):
    if first:
        wait_for("second is ready", 2)  # for ever where the second waits for its turn
    save_loop(self, *what)

FunctionCache.save_overload, GufWrapperCache.save_overload = keep, keep_loop
import kernel
if not first:
    njit(lambda: 0)()  # its names are counted otherwise
    (folder / "second began").touch()
kernel.sum_of([1.0, 2.0])
(folder / f"{sys.argv[1]} is ready").touch()
"""


def test_what_two_processes_keep_at_once_serves_a_third(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text(KERNEL)
    (tmp_path / "worker.py").write_text(WORKER)
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(tmp_path / "kept"),
        "PYTHONPATH": str(tmp_path),
    }

    def started(*words: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, *words], env=environment, stdout=-1, stderr=-1, text=True
        )

    for worker in [
        started(str(tmp_path / "worker.py"), name, str(tmp_path)) for name in ("first", "second")
    ]:
        worker.communicate()
        assert worker.returncode == 0
    third = started("-c", "import kernel; print(kernel.sum_of([1.0, 2.0]))")
    said, complained = third.communicate()
    assert (said, third.returncode) == ("3.0\n", 0), complained
