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
from collections.abc import Callable, Iterator, Mapping
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar

log = logging.getLogger(__name__)
C = TypeVar("C")  # what every call of a process works on, such as the store
P = ParamSpec("P")
T = TypeVar("T")
Send = Callable[[Any], None]
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
        # by a request: the call is not the cause
        self.was_terminated = exit_code == -signal.SIGTERM


class WorkerProcess(Generic[C]):
    """A context manager. `prepare(*arguments)` runs first in every process; every call gets what it returned. One thread calls `do` or `stream`,
    any may call `kill`.
    """

    def __init__(self, prepare: Callable[..., C], *arguments: Any) -> None:
        self._prepare, self._arguments = prepare, arguments
        self._starting = threading.Lock()
        self._process: BaseProcess | None = None
        self._was_killed = False

    def __enter__(self) -> "WorkerProcess[C]":
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._pipe.close()
            self._process.join()

    def do(self, work: Callable[Concatenate[C, P], T], *given: P.args, **named: P.kwargs) -> T:
        """Call `work(context, ...)` in the process; its value or its error, DiedError where the process ended."""
        for _, value in self._answers(_call, work, given, named):
            done: T = value
        return done

    def stream(
        self, work: Callable[Concatenate[C, Send, P], None], *given: P.args, **named: P.kwargs
    ) -> Iterator[Any]:
        """What `work(context, send, ...)` sends, as it comes; then its error, DiedError where the process ended."""
        for is_message, value in self._answers(_call_with_send, work, given, named):
            if is_message:
                yield value

    def _answers(self, call: Callable[..., Any], *request: Any) -> Iterator[tuple[bool, Any]]:
        """Messages, then what the work returned."""
        self.start()
        assert self._process is not None
        try:
            self._pipe.send((call, request))
            is_message = True
            while is_message:
                is_message, value, error = self._pipe.recv()
                if error is not None:
                    raise error
                yield is_message, value
        except (EOFError, OSError):
            self._process.join()
            raise DiedError(self._process.exitcode) from None

    @property
    def alive(self) -> bool:
        return self._process is not None and self._process.is_alive()

    def kill(self) -> None:
        """End the process at once."""
        with self._starting:
            if self._process is not None:
                self._was_killed = True
                self._process.kill()

    def start(self) -> None:
        """Have a process that waits for calls."""
        with self._starting:
            if self.alive:
                return
            if self._process is not None:
                log.log(
                    logging.INFO if self._was_killed else logging.ERROR,
                    "the process for long work ended (%s); another is started",
                    self._process.exitcode,
                )
                self.__exit__()
            self._was_killed = False
            self._pipe, theirs = CONTEXT.Pipe()
            given = (theirs, dict(os.environ), self._prepare, self._arguments)
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


def stand_back(by: int) -> None:
    """Leave the processor to others first: by so much of a process's priority, as `nice` has it (19 at most); not on Windows."""
    if hasattr(os, "nice"):
        os.nice(by)


def no_context() -> None:
    """For a process whose calls need nothing but their arguments."""


def _serve(
    pipe: Connection,
    environment: Mapping[str, str],
    prepare: Callable[..., Any],
    arguments: tuple[Any, ...],
) -> None:
    """In the process: run calls until the pipe ends, with the present environment of its parent."""
    ignore_terminal_signals()
    os.environ.clear()
    os.environ.update(environment)
    context = prepare(*arguments)
    with contextlib.suppress(EOFError, OSError):
        while True:
            call, request = pipe.recv()
            pipe.send(_outcome(call, context, pipe, *request))


def _call(context: Any, _: Connection, work: Callable[..., T], given: Any, named: Any) -> T:
    return work(context, *given, **named)


def _call_with_send(
    context: Any, pipe: Connection, work: Callable[..., T], given: Any, named: Any
) -> T:
    return work(context, lambda message: pipe.send((True, message, None)), *given, **named)


def _outcome(call: Callable[..., T], *given: Any) -> tuple[bool, T | None, Exception | None]:
    try:
        return False, call(*given), None
    except Exception as error:  # raised by `do` and `stream`
        error.add_note(traceback.format_exc())  # a traceback cannot be pickled
        return False, None, error
