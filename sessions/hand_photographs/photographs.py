"""Photographs of a patient's hand on the sheet: their figures are kept, the picture itself only where somebody asks."""

from base64 import b64decode, b64encode
from collections.abc import Mapping
from typing import Any

from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.estimators.hand.geometry import measures_from
from handscope.sessions.db.tables import HandPhotograph, Patient
from handscope.sessions.sealing.stored import seal_bytes, unseal_bytes


def store(
    db: Session,
    patient: Patient,
    hand: str,
    marks: Mapping[str, Any],
    figures: Mapping[str, Any],
    version: str,
    picture: bytes | None,
) -> HandPhotograph:
    """Keep the figures of a photograph: `geometry` (HandGeometry, m), `initial_pose` (columns of the event, deg)."""
    measures_from(figures["geometry"])
    kept = None if picture is None else b64encode(seal_bytes(picture)).decode()
    made = HandPhotograph(
        hand=hand, marks=dict(marks), figures=dict(figures), version=version, picture=kept
    )
    patient.photographs.insert(0, made)
    db.commit()
    return made


def get(db: Session, photograph_id: int) -> HandPhotograph:
    """The photograph; InputError where there is none."""
    found = db.get(HandPhotograph, photograph_id)
    if found is None:
        raise InputError("clinic.photograph_unknown", number=photograph_id)
    return found


def remove(db: Session, photograph_id: int) -> None:
    """Erase it, its picture too."""
    db.delete(get(db, photograph_id))
    db.commit()


def picture_of(photograph: HandPhotograph) -> bytes | None:
    """The JPEG, where it was kept."""
    return None if photograph.picture is None else unseal_bytes(b64decode(photograph.picture))
