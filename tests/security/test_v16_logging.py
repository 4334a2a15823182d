"""ASVS 5, 16.2.5 and 16.5: logs hold nothing that people typed; a database that is locked stops neither reading nor the server."""

import logging
import threading
import time
import urllib.error
from pathlib import Path

import pytest
from sqlalchemy import text, update
from sqlalchemy.exc import IntegrityError

from handscope.app.private_log import LINE, PrivateFormatter
from handscope.sessions.clinic import patients
from handscope.sessions.db.tables import Login, now
from handscope.sessions.login.logins import TOUCH_EVERY
from handscope.sessions.store.store import open_store, store_at
from tests.faults.victim import Victim
from tests.security.conftest import locked, log_of, status_of

SENTINEL = "SENTINEL-4711"


def test_no_log_holds_what_people_typed(victim: Victim) -> None:
    made = victim.call("POST", "/api/patients", {"pseudonym": SENTINEL, "note": SENTINEL})
    for method, path, body in (
        ("POST", "/api/patients", {"pseudonym": SENTINEL}),
        ("POST", "/api/login", {"name": SENTINEL, "password": SENTINEL}),
        ("POST", "/api/login", {"token": SENTINEL}),
        ("GET", f"/api/patients?search={SENTINEL}%00", None),
        ("GET", f"/{SENTINEL}", None),
        ("PATCH", f"/api/patients/{made['id']}", {SENTINEL: SENTINEL}),
    ):
        assert status_of(victim, method, path, body) >= 400
    with pytest.raises(urllib.error.HTTPError) as refused:
        victim.upload(made["id"], SENTINEL.encode())
    refused.value.close()
    with locked(victim.data):
        new = {"pseudonym": f"{SENTINEL}-2"}
        assert status_of(victim, "POST", "/api/patients", new) == 503
    assert SENTINEL not in log_of(victim)


def test_an_error_of_the_database_is_logged_without_its_row(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    with store.database() as db:
        patients.create(db, SENTINEL)
        statement = text("INSERT INTO patient (pseudonym, archived) VALUES (:p, 0)")
        with pytest.raises(IntegrityError) as raised:
            db.execute(statement, {"p": SENTINEL})
    store.close()
    assert SENTINEL not in str(raised.value)
    record = logging.LogRecord("x", logging.ERROR, "", 0, "failed", None, (type(raised.value), raised.value, raised.value.__traceback__))  # fmt: skip
    line = PrivateFormatter().format(record)
    assert "IntegrityError (SQLITE_CONSTRAINT" in line and "INSERT" not in line


def test_a_line_of_the_log_says_when_in_utc(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    time.tzset()
    record = logging.LogRecord("x", logging.ERROR, "", 0, "failed", None, None)
    record.created, record.msecs = 0.0, 7.0
    line = PrivateFormatter(LINE).format(record)
    monkeypatch.undo()
    time.tzset()
    assert line.startswith("1970-01-01 00:00:00.007Z x ERROR")


def test_reads_go_on_while_the_database_is_locked_and_writes_are_refused_with_words(
    victim: Victim,
) -> None:
    store = store_at(victim.data)
    with store.database() as db:  # every login is due to be kept alive
        db.execute(update(Login).values(seen=now() - 2 * TOUCH_EVERY))
        db.commit()
    store.close()
    with locked(victim.data):
        began = time.monotonic()
        statuses = [status_of(victim, "GET", "/api/patients") for _ in range(5)]
        assert statuses == [200] * 5 and time.monotonic() - began < 3
        assert status_of(victim, "GET", "/api/health") == 503
        writes: list[int] = []
        threads = [threading.Thread(target=_write, args=(victim, k, writes)) for k in range(8)]
        for thread in threads:
            thread.start()
        began = time.monotonic()
        assert status_of(victim, "GET", "/api/patients") == 200
        assert time.monotonic() - began < 3
        for thread in threads:
            thread.join()
    assert writes == [503] * 8
    assert victim.call("GET", "/api/health")["status"] == "ok"
    assert "Traceback" not in log_of(victim)


def _write(victim: Victim, k: int, statuses: list[int]) -> None:
    statuses.append(status_of(victim, "POST", "/api/patients", {"pseudonym": f"W-{k}"}))


def test_a_code_that_lets_in_is_not_printed_into_a_log(victim: Victim) -> None:
    assert "Handscope is at" in log_of(victim) and "token=" not in log_of(victim)
