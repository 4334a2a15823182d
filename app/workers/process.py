"""A process that runs one call after the other; another is started when it has died.

A pool drops every waiting call when a process dies, and cannot tell which call was the cause. Here one call is sent
at a time. The process ends by itself when its parent is gone.

On Linux it is forked from a process that has imported what the calls need (app/preload.py); elsewhere it imports all
that itself. It starts with the first call, in the thread that waits for it.
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
        self.was_terminated = (
            exit_code == -signal.SIGTERM
        )  # by a request: the call is not the cause


class WorkerProcess:
    """A context manager; `initialise(*arguments)` runs first in every process. One thread calls `do`, any may call `kill`."""

    def __init__(self, initialise: Callable[..., None], *arguments: Any) -> None:
        self._initialise, self._arguments = initialise, arguments
        self._starting = threading.Lock()
        self._process: BaseProcess | None = None

    def __enter__(self) -> "WorkerProcess":
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._pipe.close()
            self._process.join()

    def do(self, work: Callable[..., T], *arguments: Any) -> T:
        """Call `work` in the process; returns its value or raises its error, DiedError where the process ended."""
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
        """End the process at once."""
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
            given = (theirs, dict(os.environ), self._initialise, self._arguments)
            process = CONTEXT.Process(target=_serve, args=given, name="handscope work", daemon=True)
            process.start()
            theirs.close()  # the pipe ends when the process, which has the only other end, dies
            self._process = process


def ignore_terminal_signals() -> None:
    """First in every process of this CONTEXT: SIGTERM ends it, Ctrl-C at the terminal is left to the server."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def restore_terminal_signals() -> None:
    """First in a process of this CONTEXT that works for a command: SIGTERM and Ctrl-C end it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _serve(
    pipe: Connection,
    environment: Mapping[str, str],
    initialise: Callable[..., None],
    arguments: tuple[Any, ...],
) -> None:
    """In the process: run calls until the pipe ends, with the present environment of its parent."""
    ignore_terminal_signals()
    os.environ.clear()
    os.environ.update(environment)
    initialise(*arguments)
    with contextlib.suppress(EOFError, OSError):
        while True:
            work, given = pipe.recv()
            pipe.send(_outcome(work, given))


def _outcome(
    work: Callable[..., T], arguments: tuple[Any, ...]
) -> tuple[T | None, Exception | None]:
    try:
        return work(*arguments), None
    except Exception as error:  # raised by `do`
        error.add_note(traceback.format_exc())  # a traceback cannot be pickled
        return None, error
