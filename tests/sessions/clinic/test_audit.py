"""The audit trail holds what happened, in the transaction in which it did, in one chain whoever writes at once; a forged line is found."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from sqlalchemy.exc import DatabaseError

from handscope.estimators.errors import InputError
from handscope.sessions.clinic import accounts, audit, notes, patients
from handscope.sessions.clinic.audit import AuditEvent, Verdict
from handscope.sessions.db.tables import AuditLine, Base, Patient
from handscope.sessions.store.database import connect, upgrade
from handscope.sessions.store.store import Store, open_store
from tests.postgres import empty_database, server

WRITERS, EACH = 4, 8


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return open_store(tmp_path)


def told(store: Store) -> list[tuple[str, str, str, int | None]]:
    with store.database() as db:
        return [
            (line.who, f"{line.what} {line.kind}", line.ref, line.patient)
            for line in reversed(audit.list_lines(db))
        ]


def verdict(store: Store, *against: tuple[int, str]) -> Verdict:
    with store.database() as db:
        return audit.verify(db, against)


def test_what_is_changed_is_told_by_itself_with_names_of_fields_and_never_a_value(
    store: Store,
) -> None:
    with store.database() as db:
        audit.set_actor(db, "anna", "10.0.0.1")
        quince = patients.create(db, "Quince-4711", note="fell from a ladder", year_of_birth=1953)
        patients.change(db, quince.id, quince.version, affected_hand="left", year_of_birth=1954)
        notes.write(db, quince, "from a horse")
    assert told(store) == [
        ("anna", "created patient", "1", 1),
        ("anna", "created note", "1", 1),
        ("anna", "changed patient", "1", 1),
        ("anna", "created note", "2", 1),
    ]
    with store.database() as db:
        assert audit.list_lines(db)[1].counts == {"fields": ["year_of_birth", "affected_hand"]}
        words = {c.key for c in AuditLine.__table__.columns} - {"at", "previous", "hash"}  # chance
        text = str([[getattr(line, key) for key in words] for line in audit.list_lines(db)])
    assert not any(secret in text for secret in ("Quince", "ladder", "horse", "1953", "1954"))


def test_what_did_not_happen_is_not_told(store: Store) -> None:
    with store.database() as db:
        patients.create(db, "P-1")
        with pytest.raises(InputError):
            patients.create(db, "P-1")
        db.add(Patient(pseudonym="P-2"))
        audit.record(db, AuditEvent("exported", "patient", "2"))
        db.flush()
        db.rollback()
        db.commit()
    assert told(store) == [("server", "created patient", "1", 1)]


@pytest.mark.parametrize("kind", ["sqlite", "postgresql"])
def test_many_who_write_at_once_make_one_chain(kind: str, tmp_path: Path) -> None:
    if kind == "sqlite":
        written(open_store(tmp_path), None)
        return
    with server() as running, empty_database(running) as url:
        written(open_store(tmp_path / "data", url), url)


def written(store: Store, url: str | None) -> None:
    def write(writer: int) -> None:
        for k in range(EACH):
            with store.database() as db:
                patients.create(db, f"P-{writer}-{k}")
                audit.record(db, AuditEvent("viewed", "patient", str(k)))
                db.commit()

    with ThreadPoolExecutor(WRITERS) as writers:
        list(writers.map(write, range(WRITERS)))
    found = verdict(store)
    assert (found.lines, found.broken) == (2 * WRITERS * EACH, "")
    with store.database() as db, pytest.raises(DatabaseError, match="only appended to"):
        db.execute(sa.update(AuditLine).values(who="nobody"))
    store.close()


FORGERIES: dict[str, tuple[Callable[[sa.Connection], Any], str]] = {
    "who": (lambda c: c.exec_driver_sql("UPDATE audit SET who = 'ben' WHERE id = 3"), "line 3 was changed"),
    "when": (lambda c: c.exec_driver_sql("UPDATE audit SET at = '2020-01-01 00:00:00.000000' WHERE id = 2"), "line 2 was changed"),
    "whose": (lambda c: c.exec_driver_sql("UPDATE audit SET patient = NULL WHERE id = 4"), "line 4 was changed"),
    "taken out": (lambda c: c.exec_driver_sql("DELETE FROM audit WHERE id = 2"), "line 2 is missing"),
    "the first": (lambda c: c.exec_driver_sql("DELETE FROM audit WHERE id = 1"), "line 1 is missing"),
    "all": (lambda c: c.exec_driver_sql("DELETE FROM audit"), "no line is there"),
    "exchanged": (
        lambda c: [c.exec_driver_sql(f"UPDATE audit SET id = {to} WHERE id = {one}") for one, to in ((2, 9), (3, 2), (9, 3))],
        "line 2 does not follow line 1",
    ),
    "closed up": (
        lambda c: [c.exec_driver_sql(f"{words} audit {more}") for words, more in (("DELETE FROM", "WHERE id = 2"), ("UPDATE", "SET id = id - 1 WHERE id > 2"))],
        "line 2 does not follow line 1",
    ),
}  # fmt: skip


@pytest.mark.parametrize("forgery", FORGERIES)
def test_the_first_line_that_was_forged_is_found(store: Store, forgery: str) -> None:
    forge, sentence = FORGERIES[forgery]
    with store.database() as db:
        for k in range(4):
            patients.create(db, f"P-{k}")
        accounts.add(db, "anna", ["scientist"])
    whole = verdict(store)
    assert (whole.lines, whole.broken) == (5, "")
    with connect(store.folder).begin() as connection:
        for action in ("update", "delete"):
            connection.exec_driver_sql(f"DROP TRIGGER audit_no_{action}")
        forge(connection)
    assert sentence in verdict(store).broken


def test_a_trail_cut_off_or_written_anew_does_not_fit_what_was_noted(store: Store) -> None:
    with store.database() as db:
        for k in range(3):
            patients.create(db, f"P-{k}")
        noted = (3, audit.verify(db).last)
        patients.create(db, "P-9")
    assert verdict(store, noted).broken == ""
    with connect(store.folder).begin() as connection:
        connection.exec_driver_sql("DROP TRIGGER audit_no_delete")
        connection.exec_driver_sql("DELETE FROM audit WHERE id > 2")
    assert verdict(store).broken == "", "by itself it holds"
    assert "was noted and is missing" in verdict(store, noted).broken
    with store.database() as db:
        patients.create(db, "P-10")
    assert "another hash than was noted" in verdict(store, noted).broken


def test_lines_from_before_the_chain_are_taken_into_it(tmp_path: Path) -> None:
    engine = connect(tmp_path)
    upgrade(engine, "0007")
    with engine.begin() as connection:
        for k in (3, 7):
            connection.exec_driver_sql(
                f"INSERT INTO audit (id, at, what, counts) VALUES ({k}, '2026-01-0{k} 10:00:00', 'patient erased', '{{\"notes\": {k}}}')"
            )
    store = open_store(tmp_path)
    assert verdict(store).lines == 2
    upgrade(engine, "0007")
    with connect(tmp_path).begin() as connection:
        assert connection.exec_driver_sql("SELECT count(*) FROM audit").scalar() == 2


def test_accounts_are_audited_without_their_passwords(store: Store) -> None:
    with store.database() as db:
        account = accounts.add(db, "anna", ["scientist"])
        accounts.set_password(db, account, "seven hands on a table")
        accounts.change(db, account, roles=["clinician"])
        assert [line.counts for line in audit.list_lines(db)] == [
            {"fields": ["roles"]},
            {"fields": ["password"]},
            {},
        ]


def test_no_table_of_patients_data_is_left_out_of_the_audit() -> None:
    machines = {
        "audit",
        "erased_file",
        "login",
        "attempt",
        "repeatability",
        "reference_edition",
        "server",
        "result_references",  # a choice is noted with its result by references.choose
        "ward_member",  # noted with its account by wards.assign
        "emergency_access",  # noted by emergency_access.py, without the reason
        "alembic_version",
    }  # derived, or no patient's
    assert {t.__tablename__ for t in audit.KINDS} == set(Base.metadata.tables) - machines


def test_a_line_of_an_earlier_time_is_told_and_the_trail_holds(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    with store.database() as db:
        for k, day in enumerate((3, 1, 2)):
            monkeypatch.setattr(audit, "now", lambda day=day: datetime(2026, 1, day, tzinfo=UTC))
            patients.create(db, f"P-{k}")
    assert (verdict(store).broken, verdict(store).back) == ("", 2)
