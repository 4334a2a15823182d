"""What people write on a session: two at once are told, and a wrong clock is corrected without losing what it said."""

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.sessions.clinic import dates, patients
from handscope.sessions.db.conflicts import ConflictError
from handscope.sessions.db.tables import PatientSession, now
from handscope.sessions.store import visit_facts
from handscope.sessions.store.store import open_store
from handscope.sessions.store.visit_facts import Written

WRONG, RIGHT = datetime(2019, 1, 1, 0, 4, tzinfo=UTC), datetime(2026, 5, 12, 9, 30, tzinfo=UTC)


@pytest.fixture
def db(tmp_path: Path) -> Iterator[Session]:
    with open_store(tmp_path).database() as db:
        patient = patients.create(db, "P", year_of_birth=1960)
        db.add(PatientSession(patient=patient, hand="left", state="processed", started=WRONG))
        db.commit()
        yield db


def test_the_second_of_two_writers_is_told_and_nothing_is_overwritten(db: Session) -> None:
    first = visit_facts.change(db, 1, 1, written=Written(notes="calm"))
    assert (first.notes, first.examiner, first.version) == ("calm", "", 2)
    with pytest.raises(ConflictError, match="the session was changed in another window meanwhile"):
        visit_facts.change(db, 1, 1, written=Written(notes="tired"))
    assert (first.notes, first.version) == ("calm", 2)


def test_pain_is_kept_by_whole_numbers_and_taken_back(db: Session) -> None:
    told = Written(conclusion="stiff", pain={"pain_rest": 0, "pain_movement": 7})
    first = visit_facts.change(db, 1, 1, written=told)
    assert (first.conclusion, first.pain_rest, first.pain_movement) == ("stiff", 0, 7)
    second = visit_facts.change(db, 1, 2, written=Written(pain={"pain_rest": None}))
    assert (second.conclusion, second.pain_rest, second.pain_movement) == ("stiff", None, 7)
    with pytest.raises(InputError, match=r"from 0 .* to 10"):
        visit_facts.change(db, 1, 3, written=Written(pain={"pain_movement": 11}))


def test_a_session_that_is_processed_meanwhile_disturbs_nobody_who_writes(db: Session) -> None:
    session = db.get(PatientSession, 1)
    assert session is not None
    session.state = "recorded"
    db.commit()
    assert visit_facts.change(db, 1, 1, written=Written(notes="calm")).notes == "calm"


def test_a_corrected_date_keeps_what_the_clock_said_and_can_be_put_back(db: Session) -> None:
    once = visit_facts.change(
        db, 1, 1, started=RIGHT - timedelta(days=1), date_reason="battery of the clock"
    )
    assert (once.recorded_as, once.date_reason) == (WRONG, "battery of the clock")
    twice = visit_facts.change(db, 1, 2, started=RIGHT, date_reason=" a day off ")
    assert (twice.started, twice.recorded_as, twice.date_reason) == (RIGHT, WRONG, "a day off")
    assert dates.find_doubts(twice.patient, [twice], now()) == {1: []}
    back = visit_facts.change(db, 1, 3, started=WRONG)
    assert (back.started, back.recorded_as, back.date_reason) == (WRONG, None, "")


@pytest.mark.parametrize(
    ("started", "reason", "sentence"),
    [
        (RIGHT, " ", "a corrected date needs a reason"),
        (datetime(2900, 1, 1, tzinfo=UTC), "clock", "lies in the future"),
        (datetime(1950, 1, 1, tzinfo=UTC), "clock", "before the patient's year of birth, 1960"),
    ],
)
def test_a_date_that_cannot_be_is_refused(
    db: Session, started: datetime, reason: str, sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        visit_facts.change(db, 1, 1, started=started, date_reason=reason)
    session = db.get(PatientSession, 1)
    assert session is not None and (session.started, session.version) == (WRONG, 1)
