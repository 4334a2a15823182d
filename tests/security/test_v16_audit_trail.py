"""ASVS 5, 16.4: the audit trail is only appended to, and what somebody did to its protection is found."""

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
import sqlalchemy as sa
from sqlalchemy.exc import DBAPIError

from handscope.app.cli import main
from handscope.sessions.clinic import audit, patients
from handscope.sessions.store.database import FILE
from handscope.sessions.store.store import Store, open_store
from tests import postgres


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
        store.close()


@pytest.mark.parametrize(
    ("done", "sentence"),
    [
        (lambda db: db.execute("DROP TRIGGER audit_no_delete"), "audit_no_delete are gone"),
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
