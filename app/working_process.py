"""A process that does one piece of work after the other; another is started when it has died.

A pool of processes gives up everything that waits when its process dies and cannot say which piece of work it died of. Here one piece is sent at a
time, so a death belongs to it alone. The process leaves by itself when its parent is gone.
"""

import contextlib
import logging
import multiprocessing
import signal
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any, TypeVar

log = logging.getLogger(__name__)
T = TypeVar("T")
CONTEXT = multiprocessing.get_context("spawn")


class DiedError(Exception):
    """The process ended while it worked."""

    def __init__(self, exit_code: int | None) -> None:
        super().__init__(f"the working process ended with {exit_code}")
        self.told = exit_code == -signal.SIGTERM  # somebody asked it to end: the work is not to blame


class WorkingProcess:
    """A context manager; `begin(*arguments)` runs first in every process. One thread calls `do`, any may call `kill`."""

    def __init__(self, begin: Callable[..., None], *arguments: Any) -> None:
        self._begin, self._arguments = begin, arguments

    def __enter__(self) -> "WorkingProcess":
        self._pipe, theirs = CONTEXT.Pipe()
        self._process = CONTEXT.Process(target=_serve, args=(theirs, self._begin, self._arguments), name="handscope work", daemon=True)
        self._process.start()
        theirs.close()  # the process has the only other end: when it dies, the pipe ends
        return self

    def __exit__(self, *_: object) -> None:
        self._pipe.close()
        self._process.join()

    def do(self, work: Callable[..., T], *arguments: Any) -> T:
        """Have the work done there; gives its value or raises its error, DiedError where the process ended instead."""
        if not self.alive:
            log.error("the process for long work ended (%s); another is started", self._process.exitcode)
            self.__exit__()
            self.__enter__()
        try:
            self._pipe.send((work, arguments))
            value, error = self._pipe.recv()
        except (EOFError, OSError):
            self._process.join()
            raise DiedError(self._process.exitcode) from None
        if error is not None:
            raise error
        done: T = value
        return done

    @property
    def alive(self) -> bool:
        return self._process.is_alive()

    def kill(self) -> None:
        """End the process at once, whatever it does."""
        self._process.kill()


def _serve(pipe: Connection, begin: Callable[..., None], arguments: tuple[Any, ...]) -> None:
    """In the process: work until the pipe ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to everyone at the terminal; the server decides when we end
    begin(*arguments)
    with contextlib.suppress(EOFError, OSError):
        while True:
            work, given = pipe.recv()
            pipe.send(_outcome(work, given))


def _outcome(work: Callable[..., T], arguments: tuple[Any, ...]) -> tuple[T | None, Exception | None]:
    try:
        return work(*arguments), None
    except Exception as error:  # goes to whoever waits for the work
        error.add_note(traceback.format_exc())  # a traceback does not travel
        return None, error
