"""A real server on a folder that others could read, with a logged-in browser: what is tried here is tried from outside."""

import os
import sqlite3
import urllib.error
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from handscope.sessions.store.database import FILE
from tests.faults.victim import Victim


@pytest.fixture(scope="module")
def victim(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Victim]:
    data = tmp_path_factory.mktemp("outside") / "data"
    before = os.umask(0o022)
    try:
        (data / "recordings").mkdir(parents=True)
        (data / "recordings" / "earlier.mcap").write_bytes(b"of an earlier version")
    finally:
        os.umask(before)
    server = Victim(data).start()
    yield server
    server.stop()


def log_of(victim: Victim) -> str:
    """Everything that the server printed and logged."""
    return (victim.data.parent / "log").read_text()


@contextmanager
def locked(data: Path) -> Iterator[None]:
    """Another program holds SQLite's lock."""
    with closing(sqlite3.connect(data / FILE, timeout=30, isolation_level=None)) as other:
        other.execute("BEGIN EXCLUSIVE")
        yield
        other.execute("ROLLBACK")


def status_of(victim: Victim, method: str, path: str, body: Any = None) -> int:
    """The answer's status."""
    try:
        victim.call(method, path, body)
    except urllib.error.HTTPError as refusal:
        with refusal:
            return refusal.code
    return 200
