"""What a result stands among: sessions of the same hand processed in the same way, and the other hand's nearest."""

from collections.abc import Callable

from sqlalchemy.orm import Session

from handscope.sessions.clinic.visit_history import course
from handscope.sessions.db.tables import Result
from tests.sessions.clinic.test_repeatability import MAY, PIP, db, patient, visit

__all__ = ["db", "visit"]


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
    found = course(db, mine)
    assert found is not None
    assert [v.values[PIP][0] for v in found.visits] == [20.0, 24.0]
    assert found.other is not None
    assert found.other.values[PIP][0] == 90.0


def test_the_other_hands_nearest_session_is_the_last_before_else_the_first_after(
    db: Session, visit: Callable[..., Result]
) -> None:
    one = patient(db, "one")
    mine = visit(one, 4, 22.0)
    for day, value in ((6, 60.0), (9, 90.0)):
        visit(one, day, value, hand="right")
    found = course(db, mine)
    assert found is not None
    assert found.other is not None
    assert found.other.values[PIP][0] == 60.0
    visit(one, 1, 10.0, hand="right")
    found = course(db, mine)
    assert found is not None
    assert found.other is not None
    assert (found.other.started - MAY).days == 1


def test_a_first_session_stands_alone(db: Session, visit: Callable[..., Result]) -> None:
    found = course(db, visit(patient(db, "one"), 0, 1.0))
    assert found is not None
    assert (len(found.visits), found.other) == (1, None)
