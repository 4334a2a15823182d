"""What a result is compared with: chosen when it is made, frozen, chosen again only by a person as a new version."""

from collections.abc import Callable

import pytest
from sqlalchemy import delete
from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.sessions.clinic import references
from handscope.sessions.clinic.repeatability import ProcessedSession
from handscope.sessions.db.tables import Repeatability, Result
from tests.sessions.clinic.test_repeatability import PIP, db, patient, visit

__all__ = ["db", "visit"]
VALUES = {"version": 2, "norms": []}


def test_a_later_session_of_the_other_hand_changes_no_older_result(
    db: Session, visit: Callable[..., Result]
) -> None:
    one = patient(db, "one")
    mine = visit(one, 0, 22.0)
    first = references.current(db, mine, VALUES)
    assert first.other is None
    visit(one, 0.1, 11.0, hand="right")  # stopped early
    again = references.current(db, mine, VALUES)
    assert (again.number, again.other) == (1, None)


def test_two_who_read_a_result_first_at_the_same_time_store_one_version(
    db: Session, visit: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = visit(patient(db, "one"), 0, 22.0)
    matching = references._matching

    def overtaken(db: Session, result: Result) -> list[ProcessedSession]:
        """Another reader stores its choice after this one saw that there is none."""
        monkeypatch.setattr(references, "_matching", matching)
        references.current(db, result, VALUES)
        return matching(db, result)

    monkeypatch.setattr(references, "_matching", overtaken)
    assert references.current(db, mine, VALUES).number == 1
    assert [v.number for v in references.versions(db, mine)] == [1]


def test_the_first_choice_is_the_newest_session_before_of_either_hand(
    db: Session, visit: Callable[..., Result]
) -> None:
    one = patient(db, "one")
    visit(one, 0, 80.0, hand="right")
    right = visit(one, 1, 90.0, hand="right")
    before = visit(one, 2, 20.0)
    mine = visit(one, 3, 22.0)
    found = references.current(db, mine, VALUES)
    assert found.other is not None
    assert found.before is not None
    assert (found.other.result, found.other.values[PIP][0]) == (right.id, 90.0)
    assert (found.before.result, found.before.values[PIP][0]) == (before.id, 20.0)
    assert found.other.session == right.recording.session_id
    assert found.author == ""


def test_frozen_values_stay_when_their_session_is_reprocessed_redated_or_erased(
    db: Session, visit: Callable[..., Result]
) -> None:
    one = patient(db, "one")
    right = visit(one, 0, 90.0, hand="right")
    mine = visit(one, 1, 22.0)
    frozen = references.current(db, mine, VALUES)
    db.delete(right.recording.session)
    db.commit()
    assert references.current(db, mine, VALUES).other == frozen.other


def test_the_smallest_change_and_the_reference_values_are_frozen_too(
    db: Session, visit: Callable[..., Result]
) -> None:
    one = patient(db, "one")
    *_, mine = [visit(one, day, v) for day, v in enumerate((50.0, 53.0, 47.0, 52.0, 48.0))]
    first = references.current(db, mine, VALUES)
    comparison = references.comparison(first, mine)
    assert comparison is not None
    own = comparison.own[PIP]
    db.execute(delete(Repeatability))
    db.commit()
    later = references.current(db, mine, {"version": 3, "norms": ["other"]})
    assert later.reference_values == VALUES
    again = references.comparison(later, mine)
    assert again is not None
    assert (again.own[PIP].mdc95, again.own[PIP].sessions) == (own.mdc95, own.sessions)


def test_another_choice_is_a_new_version_and_the_older_one_is_still_there(
    db: Session, visit: Callable[..., Result]
) -> None:
    one = patient(db, "one")
    mine = visit(one, 0, 22.0)
    references.current(db, mine, VALUES)
    right = visit(one, 1, 90.0, hand="right")
    made = references.choose(db, mine, None, right.id, "anna", VALUES)
    assert (made.number, made.author) == (2, "anna")
    assert references.current(db, mine, VALUES).other is not None
    assert references.current(db, mine, VALUES, number=1).other is None
    assert [v.number for v in references.versions(db, mine)] == [1, 2]


def test_only_a_result_of_the_same_patient_made_in_the_same_manner_can_be_chosen(
    db: Session, visit: Callable[..., Result]
) -> None:
    one, other = patient(db, "one"), patient(db, "other")
    mine = visit(one, 0, 22.0)
    stranger = visit(other, 0, 90.0, hand="right")
    ekf = visit(one, 1, 90.0, hand="right", method="ekf")
    same = visit(one, 2, 90.0)
    for wrong in (stranger.id, ekf.id, same.id, 999):
        with pytest.raises(InputError, match="cannot be compared"):
            references.choose(db, mine, None, wrong, "anna", VALUES)
    assert len(references.versions(db, mine)) == 0


def test_a_version_that_does_not_exist_is_an_error(
    db: Session, visit: Callable[..., Result]
) -> None:
    with pytest.raises(InputError, match="version 7"):
        references.current(db, visit(patient(db, "one"), 0, 1.0), VALUES, number=7)


def test_a_result_made_anew_keeps_what_a_person_chose(
    db: Session, visit: Callable[..., Result]
) -> None:
    one = patient(db, "one")
    mine = visit(one, 1, 22.0)
    first, _ = visit(one, 0, 90.0, hand="right"), visit(one, 0.5, 60.0, hand="right")
    references.choose(db, mine, None, first.id, "anna", VALUES)
    anew = Result(
        recording=mine.recording,
        key="k2",
        method="m2",
        version="2",
        state="done",
        figures=mine.figures,
    )
    db.add(anew)
    db.commit()
    found = references.current(db, anew, VALUES)
    assert found.other is not None
    assert (found.other.result, found.author) == (first.id, "anna")


def test_the_course_ends_with_the_result_and_leaves_out_other_people_hands_and_methods(
    db: Session, visit: Callable[..., Result]
) -> None:
    one, other = patient(db, "one"), patient(db, "other")
    visit(other, 0, 10.0)
    visit(one, 1, 20.0)
    visit(one, 2, 21.0, method="ekf")
    visit(one, 3, 90.0, hand="right")
    mine = visit(one, 4, 22.0, 24.0)
    visit(one, 5, 99.0)
    found = references.course(references.current(db, mine, VALUES), mine)
    assert [v.values[PIP][0] for v in found.visits] == [20.0, 24.0]
    assert found.other is not None
    assert found.other.values[PIP][0] == 90.0
