"""What was done to a patient's hand, by day: a change of a figure is read against it."""

from datetime import date, timedelta
from typing import Literal, get_args

from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.sessions.db.tables import Patient, TreatmentEvent, now

Kind = Literal["injury", "operation", "botulinum_toxin", "splint", "therapy", "other"]
Side = Literal["left", "right", "both"]
KINDS: tuple[Kind, ...] = get_args(Kind)
LONGEST = 200  # characters of a comment
ZONES = timedelta(days=1)  # somewhere it is tomorrow already


def add(
    db: Session, patient: Patient, kind: Kind, hand: Side, day: date, comment: str
) -> TreatmentEvent:
    """Keep an event; InputError for a day that has not come or lies before the patient's birth."""
    if day > now().date() + ZONES:
        raise InputError("clinic.treatment_in_future", day=day.isoformat())
    if day.year < (patient.year_of_birth or 1900):
        raise InputError("clinic.treatment_before_birth", day=day.isoformat())
    made = TreatmentEvent(
        patient_id=patient.id, kind=kind, hand=hand, day=day, comment=comment.strip()
    )
    db.add(made)
    db.commit()
    return made


def remove(db: Session, treatment_event_id: int) -> None:
    """Erase an event; InputError where there is none."""
    found = db.get(TreatmentEvent, treatment_event_id)
    if found is None:
        raise InputError("clinic.treatment_unknown", number=treatment_event_id)
    db.delete(found)
    db.commit()
