"""Notes on a patient, one by one with their day: written, corrected, removed and brought back.

A removed note is kept for KEPT, so that removing needs no "are you sure"; then it is purged. Erasing a patient takes all of them at once.
"""

from datetime import timedelta

from sqlalchemy import delete
from sqlalchemy.orm import Session
from sqlalchemy.orm.exc import StaleDataError

from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.db.conflicts import ConflictError, require_seen
from handscope.sessions.db.tables import Note, Patient, now

RETENTION = timedelta(days=7)
LONGEST = 20_000  # characters


def write(db: Session, patient: Patient, text: str) -> Note:
    """Keep a new note."""
    note = Note(patient_id=patient.id, text=_require_text(text))
    db.add(note)
    db.commit()
    return note


def get(db: Session, note_id: int) -> Note:
    """The note; InputError where there is none."""
    note = db.get(Note, note_id)
    if note is None:
        raise InputError("clinic.note_unknown", number=note_id)
    return note


def change(
    db: Session, note_id: int, version: int, text: str | None = None, removed: bool | None = None
) -> Note:
    """Correct a note as it stood at `version`, remove it or bring it back; ConflictError where somebody else changed it meanwhile."""
    note = get(db, note_id)
    require_seen(phrase("conflict.note"), note.version, version)
    if text is not None:
        note.text = _require_text(text)
    if removed is not None:
        note.removed = now() if removed else None
    try:
        db.commit()
    except StaleDataError:
        db.rollback()
        raise ConflictError(phrase("conflict.note")) from None
    return note


def purge(db: Session) -> None:
    """Forget notes that were removed longer than KEPT ago."""
    db.execute(delete(Note).where(Note.removed < now() - RETENTION))
    db.commit()


def _require_text(text: str) -> str:
    text = text.strip()
    if not 1 <= len(text) <= LONGEST:
        raise InputError("clinic.note_length", longest=LONGEST)
    return text
