"""Whether the days of a patient's sessions can be right: a computer's clock that was set wrong shows in their order.

future        dated later than now
before_birth  in a year before the patient's year of birth
before_last   measured here after another session, yet dated earlier
overnight     still not finished after OVERNIGHT
"""

from collections.abc import Sequence
from datetime import datetime, timedelta

from handscope.sessions.db.tables import Patient, PatientSession

SLACK = timedelta(minutes=5)  # that two clocks may differ
OVERNIGHT = timedelta(hours=8)  # longer than any session


def find_doubts(
    patient: Patient, sessions: Sequence[PatientSession], now: datetime
) -> dict[int, list[str]]:
    """By session the doubts about its date."""
    found: dict[int, list[str]] = {}
    latest: datetime | None = None
    for s in sorted(sessions, key=lambda s: s.id):
        here = is_measured_here(s)
        checks = {
            "future": s.started > now + SLACK,
            "before_birth": patient.year_of_birth is not None
            and s.started.year < patient.year_of_birth,
            "before_last": here and latest is not None and s.started < latest - SLACK,
            "overnight": s.state == "open" and now - s.started > OVERNIGHT,
        }
        found[s.id] = [name for name, so in checks.items() if so]
        latest = max(filter(None, (latest, s.started if here else None)), default=None)
    return found


def find_clock_doubts(
    patient: Patient, sessions: Sequence[PatientSession], now: datetime
) -> list[str]:
    """What speaks against this computer's clock before another session is begun."""
    here = [s.started for s in sessions if is_measured_here(s)]
    checks = {
        "before_last": bool(here) and now < max(here) - SLACK,
        "before_birth": patient.year_of_birth is not None and now.year < patient.year_of_birth,
    }
    return [name for name, so in checks.items() if so]


def is_measured_here(session: PatientSession) -> bool:
    """Whether it was recorded by this server, not uploaded."""
    return any(f.format == "native" and not f.original_name for f in session.recordings)
