"""ASVS 5, 16.4: the audit trail is only appended to, and what somebody did to its protection is found."""

import json
import socket
import sqlite3
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
import sqlalchemy as sa
from sqlalchemy.exc import DBAPIError

from handscope.app.cli import main
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import audit, patients
from handscope.sessions.store.database import AUDIT_COPY, FILE
from handscope.sessions.store.store import Store, open_store
from tests import postgres

POWERLESS = "DROP TRIGGER audit_no_update; CREATE TRIGGER audit_no_update BEFORE UPDATE ON audit BEGIN SELECT 1; END"
NO_COUNTS = "DROP TRIGGER audit_no_update; ALTER TABLE audit DROP COLUMN counts"


def _filled(folder: Path, url: str | None = None) -> Store:
    store = open_store(folder, url)
    with store.database() as db:
        for k in range(3):
            patients.create(db, f"P-{k}")
    return store


def test_a_line_cannot_be_replaced(tmp_path: Path) -> None:
    _filled(tmp_path).close()
    forged = "INSERT OR REPLACE INTO audit SELECT id, at, 'nobody', address, what, kind, ref, patient, counts, previous, hash FROM audit WHERE id = 2"
    with closing(sqlite3.connect(tmp_path / FILE)) as other:
        with pytest.raises(sqlite3.DatabaseError, match="only appended to"):
            other.execute(forged)
        assert other.execute("SELECT count(*) FROM audit WHERE who = 'nobody'").fetchone() == (0,)


@pytest.mark.process
def test_the_table_cannot_be_emptied_on_postgresql(tmp_path: Path) -> None:
    with postgres.server() as server, postgres.empty_database(server) as url:
        store = _filled(tmp_path, url)
        for words in ("TRUNCATE audit", "DELETE FROM audit"):
            with store.database() as db, pytest.raises(DBAPIError, match="only appended to"):
                db.execute(sa.text(words))
        with store.database() as db:
            assert audit.verify(db).unguarded == ()
            db.execute(sa.text("ALTER TABLE audit DISABLE TRIGGER audit_no_truncate"))
            db.commit()
            assert audit.verify(db).unguarded == ("audit_no_truncate",)
            db.execute(sa.text("ALTER TABLE audit ENABLE REPLICA TRIGGER audit_no_truncate"))
            db.execute(sa.text("CREATE OR REPLACE FUNCTION audit_refuse() RETURNS trigger LANGUAGE plpgsql AS 'BEGIN RETURN NEW; END'"))  # fmt: skip
            db.commit()
            assert audit.verify(db).unguarded == ("audit_no_change", "audit_no_truncate")
        store.close()


@pytest.mark.parametrize(
    ("done", "sentence"),
    [
        (lambda db: db.execute("DROP TRIGGER audit_no_delete"), "audit_no_delete are gone"),
        (lambda db: db.executescript(POWERLESS), "audit_no_update are gone or changed"),
        (lambda db: db.executescript(NO_COUNTS), "columns of the trail's table are gone: counts"),
        (lambda db: db.execute("DROP TABLE audit"), "the table of the trail is gone"),
    ],
)
def test_verifying_finds_what_was_removed(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    done: Callable[[sqlite3.Connection], object],
    sentence: str,
) -> None:
    _filled(tmp_path).close()
    with closing(sqlite3.connect(tmp_path / FILE)) as other:
        done(other)
        other.commit()
    assert main(["audit", "verify", "--data", str(tmp_path)]) == 1
    said = capsys.readouterr()
    assert sentence in said.out and "Traceback" not in said.err


def test_a_copy_outside_finds_an_end_that_was_cut_off(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    copy, data = tmp_path / "trail.jsonl", tmp_path / "data"
    monkeypatch.setenv(AUDIT_COPY, f"file:{copy}")
    store = _filled(data)
    with store.database() as db:
        audit.record(db, audit.AuditEvent("viewed", "patient", "1"))
        db.rollback()
    store.close()
    words = ["audit", "verify", "--data", str(data), "--copy", str(copy)]
    assert [json.loads(line)["id"] for line in copy.read_text().splitlines()] == [1, 2, 3]
    assert (copy.stat().st_mode & 0o077, main(words)) == (0, 0)
    with closing(sqlite3.connect(data / FILE)) as other:
        trigger = "SELECT sql FROM sqlite_master WHERE name = 'audit_no_delete'"
        (made,) = other.execute(trigger).fetchone()
        other.execute("DROP TRIGGER audit_no_delete")
        other.execute("DELETE FROM audit WHERE id = 3")
        other.execute(made)
        other.commit()
    assert main(words[:-2]) == 0, "by itself it holds"
    assert main(words) == 1
    assert "cut off after line 2" in capsys.readouterr().out


def test_a_copy_goes_to_syslog_as_rfc_5424_has_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as server:
        server.bind(("127.0.0.1", 0))
        server.settimeout(10)
        monkeypatch.setenv(AUDIT_COPY, f"syslog:127.0.0.1:{server.getsockname()[1]}")
        _filled(tmp_path).close()
        head, _, line = server.recv(65536).decode().partition(" audit - ")
    assert head.startswith("<109>1 20") and " handscope " in head
    assert (json.loads(line)["id"], json.loads(line)["what"]) == (1, "created")


@pytest.mark.parametrize("kind", ["tcp", "unix"])
def test_a_copy_goes_to_a_collector_and_one_that_is_away_holds_nobody_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    family = socket.AF_UNIX if kind == "unix" else socket.AF_INET
    with closing(socket.socket(family)) as server:
        server.bind(str(tmp_path / "s") if kind == "unix" else ("127.0.0.1", 0))
        server.listen()
        server.settimeout(10)
        place = str(tmp_path / "s") if kind == "unix" else f"127.0.0.1:{server.getsockname()[1]}"
        monkeypatch.setenv(AUDIT_COPY, f"{kind}:{place}")
        store = _filled(tmp_path / "data")
        connection, _ = server.accept()
        with closing(connection), connection.makefile() as lines:
            assert [json.loads(lines.readline())["id"] for _ in range(3)] == [1, 2, 3]
    began = time.monotonic()
    with store.database() as db:
        for k in range(3, 9):
            patients.create(db, f"P-{k}")
    assert time.monotonic() - began < 5.0
    store.close()


def test_the_newest_lines_hash_is_published_and_finds_a_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    head, data = tmp_path / "head", tmp_path / "data"
    monkeypatch.setenv(AUDIT_COPY, f"head:{head} file:{tmp_path / 'copy'}")
    _filled(data).close()
    words = ["audit", "verify", "--data", str(data), "--head", str(head)]
    assert head.read_text().startswith("3:") and main(words) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["copy", "data", "head"]
    with closing(sqlite3.connect(data / FILE)) as other:
        (made,) = other.execute("SELECT sql FROM sqlite_master WHERE name = 'audit_no_delete'").fetchone()  # fmt: skip
        other.executescript(f"DROP TRIGGER audit_no_delete; DELETE FROM audit WHERE id = 3; {made}")
    assert main(words) == 1
    assert "cut off after line 2" in capsys.readouterr().out


def test_a_place_that_is_none_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(AUDIT_COPY, "somewhere")
    with pytest.raises(InputError, match="no place for the audit trail"):
        open_store(tmp_path)
