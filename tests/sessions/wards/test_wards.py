"""Wards narrow what a database session sees; emergency access widens it for some hours, with a reason that is kept."""

from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import pytest
from sqlalchemy import select
from sqlalchemy.orm import Session

from handscope.app.cli import main
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import accounts, audit, notes, patients
from handscope.sessions.db import visible_rows
from handscope.sessions.db.tables import (
    HOUSE,
    AuditLine,
    Base,
    Note,
    Patient,
    PatientSession,
    RecordingFile,
    Result,
    Ward,
    now,
)
from handscope.sessions.db.visible_rows import Visibility, unrestricted
from handscope.sessions.store.store import Store, open_store
from handscope.sessions.wards import emergency_access, wards

WHY = "fell off the ladder in ward B at night"


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Store]:
    """Patients P-1 of the house, P-2 of ward 2 and P-3 of ward 3, each with a note and a session; anna belongs to ward 2."""
    store = open_store(tmp_path_factory.mktemp("wards"))
    with store.database() as db:
        anna = accounts.add(db, "anna", ["clinician"])
        for name in ("Hand surgery", "Neurology"):
            wards.add(db, name)
        for number in (1, 2, 3):
            made = patients.create(db, f"P-{number}", note="x", ward_id=number)
            file = RecordingFile(format="native", file=f"recordings/{number}")
            db.add(PatientSession(patient=made, hand="left", recordings=[file]))
        wards.assign(db, anna, [2])
    yield store
    store.close()


@pytest.fixture
def db(store: Store) -> Iterator[Session]:
    """As anna sees it."""
    with store.database() as db:
        visible_rows.restrict(db, wards.visibility_of(db, accounts.find_by_name(db, "anna")))
        yield db


def codes(db: Session) -> list[str]:
    return sorted(db.scalars(select(Patient.pseudonym)))


def test_an_account_sees_patients_of_its_wards_and_of_the_whole_house(db: Session) -> None:
    assert codes(db) == ["P-1", "P-2"]
    assert patients.count(db) == 2 and len(patients.find(db, "P")) == 2
    assert {s.patient_id for s in db.scalars(select(PatientSession))} == {1, 2}
    assert [n.patient_id for n in db.scalars(select(Note).order_by(Note.id))] == [1, 2]
    with pytest.raises(InputError, match="there is no patient 3"):
        patients.get(db, 3)
    with pytest.raises(InputError, match="there is no note 3"):
        notes.get(db, 3)


def test_every_table_that_hangs_on_a_patient_is_narrowed() -> None:
    """A new table with a patient's rows must be named in visible_rows.py."""
    hanging, added = {"patient"}, {""}
    while added:
        added = {
            t.name
            for t in Base.metadata.sorted_tables
            if t.name not in hanging
            and any(key.column.table.name in hanging for key in t.foreign_keys)
        }
        hanging |= added
    criteria = visible_rows.criteria_by_class(Visibility(frozenset()))
    assert {kind.__tablename__ for kind in criteria} == hanging


def test_what_is_loaded_along_is_narrowed_too(db: Session) -> None:
    joined = select(Patient.pseudonym).join(PatientSession).join(RecordingFile)
    assert sorted(db.scalars(joined)) == ["P-1", "P-2"]
    assert db.scalars(select(Result)).all() == []
    with unrestricted(db):
        assert codes(db) == ["P-1", "P-2", "P-3"]
    assert codes(db) == ["P-1", "P-2"]


def test_a_patient_who_is_moved_away_is_named_in_the_audit_trail(store: Store) -> None:
    with store.database() as db:
        moved = patients.create(db, "P-4", ward_id=2)
        visible_rows.restrict(db, Visibility(frozenset({2})))
        patients.change(db, moved.id, moved.version, ward_id=3)
        line = audit.list_lines(db, limit=1)[0]
        assert (line.what, line.patient, line.counts) == ("changed", moved.id, {"fields": ["ward_id"]})  # fmt: skip
    with store.database() as db:
        db.delete(db.get_one(Patient, moved.id))
        db.commit()


def test_whoever_belongs_to_the_whole_house_sees_everything(store: Store) -> None:
    with store.database() as db:
        local = accounts.local_account(db)
        assert wards.visibility_of(db, local) is None
        with pytest.raises(InputError, match="whole house"):
            wards.assign(db, local, [2])


def test_a_new_account_belongs_to_no_ward_where_there_are_wards(
    store: Store, tmp_path: Path
) -> None:
    with store.database() as db:
        made = accounts.add(db, "berta", ["clinician"])
        assert wards.visibility_of(db, made) == Visibility(frozenset())
        assert wards.ward_for_new_patient(db, wards.visibility_of(db, made), None) == HOUSE
    with open_store(tmp_path).database() as db:
        assert wards.wards_of(accounts.add(db, "carl", ["clinician"])) == {HOUSE}


def test_new_patients_stay_in_the_accounts_wards(db: Session) -> None:
    anna = Visibility(frozenset({2}))
    assert wards.ward_for_new_patient(db, anna, None) == 2
    assert wards.ward_for_new_patient(db, None, 3) == 3
    with pytest.raises(InputError, match="none of your account's"):
        wards.ward_for_new_patient(db, anna, 3)


def test_a_ward_with_patients_is_not_removed_and_the_whole_house_never(store: Store) -> None:
    with store.database() as db:
        with pytest.raises(InputError, match="patients belong"):
            wards.remove(db, 3)
        with pytest.raises(InputError, match="neither renamed nor removed"):
            wards.remove(db, HOUSE)
        made = wards.add(db, " Day  clinic ")
        assert wards.rename(db, made.id, "Day unit").name == "Day unit"
        with pytest.raises(InputError, match="already a ward"):
            wards.add(db, "Day unit")
        wards.remove(db, made.id)
        assert db.get(Ward, made.id) is None


def test_an_emergency_access_opens_one_patient_for_some_hours(db: Session, store: Store) -> None:
    anna = accounts.find_by_name(db, "anna")
    seen = wards.visibility_of(db, anna)
    with pytest.raises(InputError, match="say why"):
        emergency_access.open_patient(db, anna.id, seen, "P-3", "because")
    with pytest.raises(InputError, match="anyway"):
        emergency_access.open_patient(db, anna.id, seen, "P-2", WHY)
    with pytest.raises(InputError, match="there is no patient 'P-9'"):
        emergency_access.open_patient(db, anna.id, seen, "P-9", WHY)
    access = emergency_access.open_patient(db, anna.id, seen, "P-3", WHY)
    line = audit.list_lines(db, limit=1)[0]
    assert (line.kind, line.patient) == ("emergency_access", 3) and WHY not in str(line.counts)
    assert line.counts["reason_sha256"] == emergency_access.sum_of(WHY)
    visible_rows.restrict(db, wards.visibility_of(db, anna))
    assert codes(db) == ["P-1", "P-2", "P-3"]
    access.ends = now() - timedelta(seconds=1)
    db.commit()
    visible_rows.restrict(db, wards.visibility_of(db, anna))
    assert codes(db) == ["P-1", "P-2"]


def test_heads_and_the_house_are_shown_emergency_accesses(store: Store) -> None:
    with store.database() as db:
        anna = accounts.find_by_name(db, "anna")
        seen = wards.visibility_of(db, anna)
        made = emergency_access.open_patient(db, anna.id, seen, "P-3", WHY)
        of_house = emergency_access.list_for_heads(db, None, now())
        assert made in of_house
        assert made in emergency_access.list_for_heads(db, {3}, now())
        assert emergency_access.list_for_heads(db, {2}, now()) == []
        assert made not in emergency_access.list_for_heads(db, {3}, now() + timedelta(days=91))
        emergency_access.end(db, made.id, anna.id)
        assert emergency_access.list_own(db, anna.id) == []
        assert db.scalars(select(AuditLine).where(AuditLine.what == "changed", AuditLine.kind == "emergency_access")).all()  # fmt: skip


def test_lines_of_the_audit_trail_are_of_own_patients_and_own_accounts(store: Store) -> None:
    with store.database() as db:
        within = wards.audited_within(db, Visibility(frozenset({2})))
        lines = audit.list_lines(db, limit=200, within=within)
        assert {line.patient for line in lines} <= {None, 1, 2}
        assert {line.who for line in lines if line.patient is None} <= {"anna"}


def test_wards_and_their_accounts_are_managed_on_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = ["--data", str(tmp_path)]
    assert main(["ward", "add", "Hand surgery", *store]) == 0
    added = ["account", "add", "anna", "--role", "clinician", "--ward", "Hand surgery"]
    assert main([*added, *store]) == 0
    assert main(["account", "list", *store]) == 0
    assert "wards: Hand surgery" in capsys.readouterr().out
    assert main(["account", "ward", "anna", "--ward", "all", "--head", "Burns", *store]) == 2
    assert "there is no ward 'Burns'" in capsys.readouterr().err
    assert main(["ward", "rename", "Hand surgery", "Hand unit", *store]) == 0
    assert main(["account", "ward", "anna", "--ward", "Hand unit", "--head", "Hand unit", *store]) == 0  # fmt: skip
    assert main(["ward", "list", *store]) == 0
    assert capsys.readouterr().out == "all  (the whole house)\nHand unit\n"
    assert main(["ward", "remove", "all", *store]) == 2
    assert main(["ward", "remove", "Hand unit", *store]) == 0
