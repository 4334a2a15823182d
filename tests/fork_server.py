"""Processes of the tests that are forked from the fork server, which has imported everything, and have processes of their own.

The processes that run the tests have one fork server between them, of the process that hands the tests out: each its own would
import everything as often. multiprocessing has no way of saying either. A command is run in one as a program is, without importing everything anew.
"""

import os
import signal
from multiprocessing import forkserver
from multiprocessing.connection import Connection

ADDRESS = "HANDSCOPE_TESTS_FORK_SERVER"


def offer() -> None:
    """In the process that starts the others: they fork from this one's server."""
    forkserver.ensure_running()
    os.environ[ADDRESS] = forkserver._forkserver._forkserver_address  # type: ignore[attr-defined]


def take() -> None:
    """In a process that runs tests: from the server that is offered, where one is."""
    if ADDRESS in os.environ:
        server = forkserver._forkserver  # type: ignore[attr-defined]
        server._forkserver_address = os.environ[ADDRESS]
        # what keeps it alive is the process that started it
        server._forkserver_alive_fd = os.open(os.devnull, os.O_WRONLY)
        share()


def share() -> None:
    """In a forked process: its own are forked from the same server. It would start another, which imports everything anew."""
    forkserver._forkserver.ensure_running = lambda: None  # type: ignore[attr-defined]


def run(words: list[str], out: Connection, errors: Connection) -> None:
    """In a forked process: `handscope` as a program with these words, what it prints goes into the pipes; Ctrl-C and SIGTERM end it as they end a program."""
    from handscope.app.cli import main

    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    share()
    for stream, pipe in ((1, out), (2, errors)):
        os.dup2(pipe.fileno(), stream)
        pipe.close()
    raise SystemExit(main(words))
