"""When an emergency access ends: by a clock that nobody can set back, beside the stored time of day.

While the program runs, an access lasts as long as was granted, counted by the monotonic clock from when it was made.
After a restart the stored end counts, never for longer than was granted. Whichever comes first ends it: the time of
day may shorten an access, never prolong it.
"""

import threading
import time
from collections.abc import Callable

from sqlalchemy import select
from sqlalchemy.orm import Session, object_session, sessionmaker

from handscope.sessions.db.tables import EmergencyAccess, now

DEADLINES = "access_deadlines"  # the key in Session.info
OVER = float("-inf")


class AccessDeadlines:
    """Ends of the accesses to one database, by the number of the access; from any thread."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._ends: dict[int, float] = {}  # s of the clock

    def start_countdown(self, access: EmergencyAccess) -> None:
        """Count from now how long the access still lasts, unless it is counted already."""
        self.lasts(access)

    def lasts(self, access: EmergencyAccess) -> bool:
        """Whether it lasts still; the countdown of an access that has none starts."""
        left = min(access.ends - now(), access.ends - access.begun).total_seconds()
        with self._lock:
            moment = self._clock()
            end = self._ends.setdefault(access.id, moment + left)
            if left <= 0:
                # it stays over, whatever the time of day says later
                self._ends[access.id] = end = OVER
        return end > moment

    def end(self, access: EmergencyAccess) -> None:
        """End it before its time."""
        with self._lock:
            self._ends[access.id] = OVER


def enable(database: sessionmaker[Session], clock: Callable[[], float] = time.monotonic) -> None:
    """From now on sessions of this database share the deadlines; those of accesses that last begin now."""
    deadlines = AccessDeadlines(clock)
    database.configure(info={DEADLINES: deadlines})
    with database() as db:
        for access in db.scalars(select(EmergencyAccess).where(EmergencyAccess.ends > now())):
            deadlines.start_countdown(access)


def deadlines_of(db: Session) -> AccessDeadlines:
    """The deadlines of the session's database."""
    found: AccessDeadlines = db.info[DEADLINES]
    return found


def lasts(access: EmergencyAccess) -> bool:
    """Whether a stored access lasts still."""
    db = object_session(access)
    assert db is not None, "an access is asked about within its database session"
    return deadlines_of(db).lasts(access)
