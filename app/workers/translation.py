"""Translating the estimators to machine code beside a server that serves already: a source brings none (estimators/numerics/jit.py).

What is needed earlier is translated where it is needed; a session then follows the hand late, and records everything.
"""

import hashlib
import platform
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numba

from handscope import estimators
from handscope.estimators.numerics.translation.packaged_code import is_for_this_machine
from handscope.estimators.numerics.translation.translation_lock import kept_in

COMMAND = (sys.executable, "-P", "-m", "handscope.app.compile_kernels", "--behind")
FILE = "translated"


@contextmanager
def beside() -> Iterator[None]:
    """Translate in a process of its own, behind other work, unless all of this version is kept; it ends with the block."""
    if is_kept():
        yield
        return
    with subprocess.Popen(COMMAND, stdout=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.terminate()


def is_kept() -> bool:
    """Whether every kernel of this version has been translated on this machine, or came with the package."""
    if is_for_this_machine(Path(estimators.__path__[0]).parent):
        return True
    try:
        return (kept_in() / FILE).read_text() == _version()
    except OSError:
        return False


def note_kept() -> None:
    """Every kernel of this version is translated."""
    with suppress(OSError):  # where nothing can be kept, it is translated each time
        (kept_in() / FILE).write_text(_version())


def _version() -> str:
    """Of the estimators' files, of what translates them, and of the machine."""
    root = Path(estimators.__path__[0])
    files = sorted((str(f.relative_to(root)), f.stat()) for f in root.rglob("*.py"))
    known = (
        *((name, about.st_mtime_ns, about.st_size) for name, about in files),
        platform.python_version(),
        numba.__version__,
        platform.machine(),
    )
    return hashlib.sha256(repr(known).encode()).hexdigest()
