"""An emergency access ends when it was granted to end, though the time of day is set back meanwhile."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta

import pytest
from sqlalchemy import delete

from handscope.sessions.clinic import accounts, patients
from handscope.sessions.db.tables import EmergencyAccess, now
from handscope.sessions.store.store import Store, open_store
from handscope.sessions.wards import access_deadlines, emergency_access, wards

WHY = "fell off the ladder in ward B at night"
HOUR = 3600.0


@dataclass
class Clocks:
    """Of a computer: the time of day, which can be set, and the seconds since its start, which cannot."""

    since_start: float = 0.0
    set_by: float = 0.0


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Store]:
    store = open_store(tmp_path_factory.mktemp("deadlines"))
    with store.database() as db:
        for name in ("Hand surgery", "Neurology"):
            wards.add(db, name)
        wards.assign(db, accounts.add(db, "anna", ["clinician"]), [2])
        patients.create(db, "P-3", ward_id=3)
    yield store
    store.close()


@pytest.fixture
def clocks(store: Store, monkeypatch: pytest.MonkeyPatch) -> Iterator[Clocks]:
    clocks = Clocks()

    def time_of_day() -> datetime:
        return now() + timedelta(seconds=clocks.since_start + clocks.set_by)

    for module in (emergency_access, access_deadlines):
        monkeypatch.setattr(module, "now", time_of_day)
    start(store, clocks)
    yield clocks
    with store.database() as db:
        db.execute(delete(EmergencyAccess))
        db.commit()


def start(store: Store, clocks: Clocks) -> None:
    """A server that starts on the data folder: it knows what is stored, nothing else."""
    access_deadlines.enable(store.database, lambda: clocks.since_start)


def opened(store: Store) -> int:
    with store.database() as db:
        anna = accounts.find_by_name(db, "anna")
        seen = wards.visibility_of(db, anna)
        return emergency_access.open_patient(db, anna.id, seen, "P-3", WHY).id


def lasting(store: Store) -> list[int]:
    """The accesses that anna is shown as lasting; the patients whom she sees are theirs."""
    with store.database() as db:
        anna = accounts.find_by_name(db, "anna")
        found = emergency_access.list_own(db, anna.id)
        assert emergency_access.patients_open_to(db, anna.id) == {a.patient_id for a in found}
        assert all(access_deadlines.lasts(a) for a in found)
        return [a.id for a in found]


def test_a_clock_set_back_by_an_hour_prolongs_nothing(store: Store, clocks: Clocks) -> None:
    made = opened(store)
    clocks.since_start += 3.9 * HOUR
    clocks.set_by = -HOUR
    assert lasting(store) == [made]
    clocks.since_start += 0.2 * HOUR
    assert lasting(store) == []


def test_an_access_that_was_over_stays_over(store: Store, clocks: Clocks) -> None:
    made = opened(store)
    clocks.set_by = 5 * HOUR
    with store.database() as db:
        found = emergency_access.list_for_heads(db, None, now())
        assert [access_deadlines.lasts(a) for a in found if a.id == made] == [False]
    clocks.set_by = 0.0
    assert lasting(store) == []
    clocks.set_by = 1.0
    made = opened(store)
    with store.database() as db:
        emergency_access.end(db, made, accounts.find_by_name(db, "anna").id)
    clocks.set_by = -HOUR
    assert lasting(store) == [], "ended by its owner"


def test_after_a_restart_the_stored_end_counts_and_never_more_than_was_granted(
    store: Store, clocks: Clocks
) -> None:
    made = opened(store)
    clocks.since_start += 3.9 * HOUR
    start(store, clocks)
    assert lasting(store) == [made]
    clocks.set_by = -HOUR
    clocks.since_start += 0.2 * HOUR
    assert lasting(store) == [], "counted from the start of the server, asked about or not"
    clocks.set_by = -100 * HOUR
    start(store, clocks)
    assert lasting(store)[0] == made
    clocks.since_start += 4.1 * HOUR
    assert lasting(store) == []
