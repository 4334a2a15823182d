"""A process that does one piece of work after the other; another is started when it has died.

A pool of processes gives up everything that waits when its process dies and cannot say which piece of work it died of. Here one piece is sent at a
time, so a death belongs to it alone. The process leaves by itself when its parent is gone.

On Linux it is forked from a process that has imported what work needs (app/preload.py); elsewhere it imports all that itself. It begins with the
first piece of work, in the thread that waits for that: until those imports are done, nobody else waits.
"""

import contextlib
import logging
import multiprocessing
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

log = logging.getLogger(__name__)
T = TypeVar("T")
CONTEXT = (
    multiprocessing.get_context("forkserver")
    if sys.platform == "linux"
    else multiprocessing.get_context("spawn")
)
CONTEXT.set_forkserver_preload(["handscope.app.preload"])


class DiedError(Exception):
    """The process ended while it worked."""

    def __init__(self, exit_code: int | None) -> None:
        super().__init__(f"the working process ended with {exit_code}")
        self.told = (
            exit_code == -signal.SIGTERM
        )  # somebody asked it to end: the work is not to blame


class WorkingProcess:
    """A context manager; `begin(*arguments)` runs first in every process. One thread calls `do`, any may call `kill`."""

    def __init__(self, begin: Callable[..., None], *arguments: Any) -> None:
        self._begin, self._arguments = begin, arguments
        self._starting = threading.Lock()
        self._process: BaseProcess | None = None

    def __enter__(self) -> "WorkingProcess":
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._pipe.close()
            self._process.join()

    def do(self, work: Callable[..., T], *arguments: Any) -> T:
        """Have the work done there; gives its value or raises its error, DiedError where the process ended instead."""
        if not self.alive:
            self._start()
        assert self._process is not None
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
        return self._process is not None and self._process.is_alive()

    def kill(self) -> None:
        """End the process at once, whatever it does."""
        with self._starting:
            if self._process is not None:
                self._process.kill()

    def _start(self) -> None:
        with self._starting:
            if self._process is not None:
                log.error(
                    "the process for long work ended (%s); another is started",
                    self._process.exitcode,
                )
                self.__exit__()
            self._pipe, theirs = CONTEXT.Pipe()
            given = (theirs, dict(os.environ), self._begin, self._arguments)
            process = CONTEXT.Process(target=_serve, args=given, name="handscope work", daemon=True)
            process.start()
            theirs.close()  # the process has the only other end: when it dies, the pipe ends
            self._process = process


def heed_the_server_alone() -> None:
    """First in every process of this CONTEXT: it may be told to end, and Ctrl-C, which goes to everyone at the terminal, is the server's to answer."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def heed_the_terminal() -> None:
    """First in a process of this CONTEXT that works for a command: Ctrl-C and a request to end reach it as well."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _serve(
    pipe: Connection,
    environment: Mapping[str, str],
    begin: Callable[..., None],
    arguments: tuple[Any, ...],
) -> None:
    """In the process: work until the pipe ends, in the environment that its parent has now: what it was forked from may be older."""
    heed_the_server_alone()
    os.environ.clear()
    os.environ.update(environment)
    begin(*arguments)
    with contextlib.suppress(EOFError, OSError):
        while True:
            work, given = pipe.recv()
            pipe.send(_outcome(work, given))


def _outcome(
    work: Callable[..., T], arguments: tuple[Any, ...]
) -> tuple[T | None, Exception | None]:
    try:
        return work(*arguments), None
    except Exception as error:  # goes to whoever waits for the work
        error.add_note(traceback.format_exc())  # a traceback does not travel
        return None, error
