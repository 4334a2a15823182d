"""Clocks that were set wrong: what shows in the dates of sessions."""

from datetime import UTC, datetime, timedelta

from handscope.sessions.clinic import dates
from handscope.sessions.db.tables import Patient, PatientSession, RecordingFile

NOON = datetime(2026, 11, 21, 12, tzinfo=UTC)
DAY = timedelta(days=1)


def session(
    number: int, started: datetime, name: str = "", state: str = "processed"
) -> PatientSession:
    file = RecordingFile(format="native", file="f", original_name=name)
    return PatientSession(id=number, hand="left", state=state, started=started, recordings=[file])


def doubts(*sessions: PatientSession, born: int | None = None) -> dict[int, list[str]]:
    return dates.find_doubts(Patient(year_of_birth=born), sessions, NOON)


def test_sessions_in_order_raise_no_doubt_and_their_order_in_the_list_does_not_matter() -> None:
    row = [session(k, NOON - (9 - k) * DAY) for k in range(1, 9)]
    assert doubts(*row[::-1], born=1960) == {k: [] for k in range(1, 9)}


def test_a_session_dated_in_the_future_or_before_birth_or_before_the_last() -> None:
    future, unborn, before = (
        session(1, NOON + DAY),
        session(2, datetime(1970, 1, 1, tzinfo=UTC)),
        session(3, NOON - DAY),
    )
    assert doubts(future, unborn, before, born=1980) == {
        1: ["future"],
        2: ["before_birth", "before_last"],
        3: ["before_last"],
    }


def test_an_upload_may_be_older_than_the_last_session_and_tells_nothing_of_our_clock() -> None:
    assert doubts(session(1, NOON - DAY), session(2, NOON - 30 * DAY, "old.mcap")) == {1: [], 2: []}
    patient = Patient(year_of_birth=None)
    assert dates.find_clock_doubts(patient, [session(1, NOON + DAY, "odd.mcap")], NOON) == []
    assert dates.find_clock_doubts(patient, [session(1, NOON + DAY)], NOON) == ["before_last"]
    assert dates.find_clock_doubts(
        Patient(year_of_birth=1990), [], datetime(1980, 1, 1, tzinfo=UTC)
    ) == ["before_birth"]


def test_a_session_left_open_overnight_is_told_from_one_that_runs() -> None:
    assert doubts(
        session(1, NOON - timedelta(hours=20), state="open"),
        session(2, NOON - timedelta(hours=1), state="open"),
    ) == {
        1: ["overnight"],
        2: [],
    }
