"""Processes of the tests that are forked from the fork server, which has imported everything, and have processes of their own."""

from multiprocessing import forkserver


def share() -> None:
    """In such a process: its own are forked from the same server. multiprocessing has no way of saying so; it would start another, which imports everything anew."""
    forkserver._forkserver.ensure_running = lambda: None  # type: ignore[attr-defined]
