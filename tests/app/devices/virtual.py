"""A virtual glove as a process of its own, for tests that need a real port."""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

WAIT = 30.0  # s until a test gives up


@contextmanager
def virtual_glove(path: Path, *words: str) -> Iterator[Path]:
    """`handscope glove` at a path; ends with the test."""
    process = subprocess.Popen(
        [sys.executable, "-m", "app.cli", "glove", "--pty", str(path), *words], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL
    )
    try:
        wait_for(path.is_symlink)
        yield path
    finally:
        process.terminate()
        process.wait()


def wait_for(condition: Callable[[], Any]) -> Any:
    """The condition's value as soon as it is true; the test fails after WAIT."""
    until = time.monotonic() + WAIT
    while not (value := condition()):
        assert time.monotonic() < until, "what the test waits for did not happen"
        time.sleep(0.01)
    return value
