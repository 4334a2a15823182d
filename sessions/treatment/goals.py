"""The range that a figure of a hand is to reach, one for each figure and hand; in the unit that people read."""

import math
from collections.abc import Mapping

from sqlalchemy import select
from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.sessions.db.tables import Goal, Patient

Key = tuple[str, str, str]  # measure, task, figure


def put(
    db: Session, patient: Patient, hand: str, key: Key, unit: str, low: float, high: float
) -> Goal:
    """Set the goal of a figure in place of an earlier one; InputError for an empty range."""
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError("clinic.goal_range", low=low, high=high)
    measure, task, figure = key
    goal = db.scalar(
        select(Goal).where(
            Goal.patient_id == patient.id,
            Goal.hand == hand,
            Goal.measure == measure,
            Goal.task == task,
            Goal.figure == figure,
        )
    )
    if goal is None:
        goal = Goal(patient_id=patient.id, hand=hand, measure=measure, task=task, figure=figure)
        db.add(goal)
    goal.unit, goal.low, goal.high = unit, low, high
    db.commit()
    return goal


def of_patient(patient: Patient) -> Mapping[tuple[str, Key], Goal]:
    """A patient's goals by hand and figure."""
    return {(g.hand, (g.measure, g.task, g.figure)): g for g in patient.goals}


def fitting(aims: Mapping[tuple[str, Key], Goal], hand: str, key: Key, unit: str) -> Goal | None:
    """The goal of a hand's figure; None where there is none, or where it was set in another unit than people read the figure in."""
    goal = aims.get((hand, key))
    return goal if goal is not None and goal.unit == unit else None


def remove(db: Session, goal_id: int) -> None:
    """Erase a goal; InputError where there is none."""
    found = db.get(Goal, goal_id)
    if found is None:
        raise InputError("clinic.goal_unknown", number=goal_id)
    db.delete(found)
    db.commit()
