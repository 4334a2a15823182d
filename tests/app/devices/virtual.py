"""A virtual glove as a process of its own, for tests that need a real port."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from handscope.app.cli import main
from handscope.app.workers.process import CONTEXT, ignore_terminal_signals

WAIT = 120.0  # s until a test gives up


@contextmanager
def virtual_glove(path: Path, *words: str) -> Iterator[Path]:
    """`handscope glove` at a path; ends with the test."""
    process = CONTEXT.Process(
        target=_run, args=(["glove", "--pty", str(path), *words],), daemon=True
    )
    process.start()
    try:
        wait_for(path.is_symlink)
        yield path
    finally:
        process.terminate()
        process.join()


def wait_for(condition: Callable[[], Any]) -> Any:
    """The condition's value as soon as it is true; the test fails after WAIT."""
    until = time.monotonic() + WAIT
    while not (value := condition()):
        assert time.monotonic() < until, "what the test waits for did not happen"
        time.sleep(0.01)
    return value


def _run(words: list[str]) -> None:
    ignore_terminal_signals()
    silent = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(silent, stream)
    raise SystemExit(main(words))
