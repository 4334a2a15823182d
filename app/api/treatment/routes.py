"""/api/patients/…/treatment-events and …/goals: what was done to a hand and what its figures are to reach."""

from datetime import date
from typing import Annotated, Any

from fastapi import APIRouter
from pydantic import Field

from handscope.app.api.answers import GoalRow, TreatmentEventRow, answers
from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import CLINICIAN, requires_role
from handscope.app.language import Language
from handscope.app.state import Db, LanguageDep
from handscope.estimators.hand.anatomy import Hand
from handscope.sessions.clinic import patients
from handscope.sessions.db.tables import Goal, TreatmentEvent
from handscope.sessions.treatment import events, goals

router = APIRouter(tags=["treatment"], dependencies=[requires_role(CLINICIAN)])
Finite = Annotated[float, Field(allow_inf_nan=False, ge=-1e6, le=1e6)]
Name = Annotated[str, Field(min_length=1, max_length=60)]


class NewTreatmentEvent(Incoming):
    """What was done to a hand on a day."""

    kind: events.Kind
    hand: events.Side
    day: date
    comment: str = Field("", max_length=events.LONGEST, description="free text, no names")


class NewGoal(Incoming):
    """The range that a figure is to reach, in the unit in which progress shows it."""

    hand: Hand
    measure: Name
    task: Name
    name: str = Field(min_length=1, max_length=100, description="of the figure, as in progress")
    unit: str = Field(max_length=16, description="of low and high, as in progress")
    low: Finite
    high: Finite


@router.post(
    "/patients/{patient_id}/treatment-events",
    status_code=201,
    responses=answers(TreatmentEventRow, 201),
)
def add_treatment_event(
    db: Db, language: LanguageDep, patient_id: int, new: NewTreatmentEvent
) -> Any:
    """Note what was done to a hand."""
    patient = patients.get(db, patient_id)
    return event_row(events.add(db, patient, new.kind, new.hand, new.day, new.comment), language)


@router.delete("/treatment-events/{treatment_event_id}", status_code=204)
def remove_treatment_event(db: Db, treatment_event_id: int) -> None:
    """Erase what was noted."""
    events.remove(db, treatment_event_id)


@router.put("/patients/{patient_id}/goals", responses=answers(GoalRow))
def put_goal(db: Db, patient_id: int, new: NewGoal) -> Any:
    """Set the goal of a hand's figure, in place of an earlier one."""
    key = (new.measure, new.task, new.name)
    return goal_row(
        goals.put(db, patients.get(db, patient_id), new.hand, key, new.unit, new.low, new.high)
    )


@router.delete("/goals/{goal_id}", status_code=204)
def remove_goal(db: Db, goal_id: int) -> None:
    """Erase a goal."""
    goals.remove(db, goal_id)


def event_row(e: TreatmentEvent, language: Language) -> TreatmentEventRow:
    """An event as the API shows it, the demonstration's in the reader's language."""
    return {
        "id": e.id,
        "kind": e.kind,
        "hand": e.hand,
        "day": e.day,
        "comment": language.example(e.comment),
    }


def goal_row(g: Goal) -> GoalRow:
    """A goal as the API shows it."""
    return {"id": g.id, "unit": g.unit, "low": g.low, "high": g.high, "changed": g.changed}
