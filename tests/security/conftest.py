"""A real server on a folder that others could read, with a logged-in browser: what is tried here is tried from outside."""

import copy
import json
import os
import sqlite3
import urllib.error
import urllib.request
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


def logged_in_as(victim: Victim, name: str, *roles: str) -> Victim:
    """Another browser on the server, logged in as an account of these roles (a clinician)."""
    other = copy.copy(victim)
    made = victim.call("POST", "/api/accounts", {"name": name, "roles": roles or ("clinician",)})
    request = other._request("POST", "/api/login", {"token": made["code"]})
    del request.headers["Cookie"]
    with urllib.request.urlopen(request) as answer:
        other.cookie = str(answer.headers["Set-Cookie"]).split(";")[0]
    return other


def answer_of(victim: Victim, method: str, path: str, body: Any = None) -> tuple[int, Any]:
    """The answer's status and JSON, also of a refusal."""
    try:
        with urllib.request.urlopen(victim._request(method, path, body)) as answer:
            return answer.status, json.loads(answer.read() or b"null")
    except urllib.error.HTTPError as refusal:
        with refusal:
            return refusal.code, json.loads(refusal.read() or b"null")


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
