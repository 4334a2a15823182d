"""Processes of the tests that are forked from the fork server, which has imported everything, and have processes of their own.

The processes that run the tests have one fork server between them, of the process that hands the tests out: each its own would
import everything as often. multiprocessing has no way of saying either.
"""

import os
from multiprocessing import forkserver

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
