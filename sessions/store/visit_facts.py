"""What people write on a session: notes, the conclusion, pain, who examined, its true date where the computer's clock was wrong, how high the trunk's sensor was worn.

Of two people who write at once the second gets a ConflictError; a session that is measured or processed meanwhile disturbs nobody. What the clock said
is kept with the reason, and putting it back is a correction like any other.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Literal

from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.clinic import trunk_height
from handscope.sessions.clinic.dates import SLACK
from handscope.sessions.db.conflicts import claim_version
from handscope.sessions.db.tables import PatientSession, now
from handscope.sessions.store import records

LONGEST = 20_000  # characters of notes
PAIN = range(11)  # numerical rating scale: none to the worst imaginable


@dataclass(frozen=True)
class Written:
    """What is written on a session; None leaves a text as it is, pain that is not named, too."""

    notes: str | None = None
    examiner: str | None = None
    conclusion: str | None = None
    pain: Mapping[Literal["pain_rest", "pain_movement"], int | None] = field(default_factory=dict)


@dataclass(frozen=True)
class TrunkHeight:
    """Told afterwards."""

    height: float | None  # m; None: as in the recording


def change(
    db: Session,
    session_id: int,
    version: int,
    written: Written = Written(),
    started: datetime | None = None,
    date_reason: str = "",
    trunk: TrunkHeight | None = None,
) -> PatientSession:
    """Change a session as it stood at `version`; ConflictError where somebody else changed it meanwhile. A new date, `started`, needs a reason."""
    session = records.get(db, session_id)
    if any(score is not None and score not in PAIN for score in written.pain.values()):
        raise InputError("store.pain_outside", most=PAIN[-1])
    if trunk is not None:
        trunk_height.require_worn(session)
        if trunk.height is not None:
            trunk_height.require_height(trunk.height)
    if started is not None:
        started = started if started.tzinfo else started.replace(tzinfo=UTC)
        _require_date(session, started, date_reason)
    claim_version(db, session, version, phrase("conflict.session"))
    for name in ("notes", "examiner", "conclusion"):
        if (text := getattr(written, name)) is not None:
            setattr(session, name, text)
    for name, score in written.pain.items():
        setattr(session, name, score)
    if started is not None:
        _date(session, started, date_reason.strip())
    if trunk is not None:
        session.trunk_corrected = None if trunk.height == session.trunk_height else trunk.height
    db.commit()
    return session


def _date(session: PatientSession, started: datetime, reason: str) -> None:
    clock_time = session.recorded_as or session.started
    session.started = started
    session.recorded_as, session.date_reason = (
        (None, "") if started == clock_time else (clock_time, reason)
    )


def _require_date(session: PatientSession, started: datetime, reason: str) -> None:
    born = session.patient.year_of_birth
    if session.state == "open":
        raise InputError("store.date_while_measured")
    if started > now() + SLACK:
        raise InputError("store.date_in_future")
    if born is not None and started.year < born:
        raise InputError("store.date_before_birth", year=born)
    if started not in (session.recorded_as, session.started) and not reason.strip():
        raise InputError("store.date_without_reason")
