"""Tries that fail make the next ones wait: longer each time, up to LONGEST_WAIT, until WINDOW has passed without one.

Tries are counted in the database before they are checked: tries at once count too, and a restart forgets none. Nothing is ever closed for
good, so that nobody locks somebody else's account.
"""

import ipaddress
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta

from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.db.tables import Attempt, now

WINDOW = timedelta(minutes=15)  # in which tries are counted
FIRST_WAIT, LONGEST_WAIT = 2.0, 120.0  # s


class ThrottledError(InputError):
    """Too many tries; `wait` s until the next one is taken."""

    def __init__(self, wait: float) -> None:
        super().__init__(phrase("login.throttled", wait=wait))
        self.wait = wait


@dataclass(frozen=True)
class Limit:
    """So many tries of a key in a WINDOW wait for nothing."""

    key: str  # a hash
    most: int


def network(address: str) -> str:
    """Whom an address stands for: an IPv6 host has a whole /64."""
    try:
        found = ipaddress.ip_address(address)
    except ValueError:
        return address
    if found.version == 4:
        return address
    return str(ipaddress.ip_network(f"{address.partition('%')[0]}/64", strict=False))


def count(db: Session, limits: Sequence[Limit]) -> list[int]:
    """Count a try; ThrottledError, and it does not count, where it comes too early. Numbers of what was counted."""
    moment = now()
    db.execute(delete(Attempt).where(Attempt.at < moment - WINDOW))
    made = [Attempt(key=limit.key, at=moment) for limit in limits]
    db.add_all(made)
    db.commit()
    wait = 0.0
    for attempt, limit in zip(made, limits):
        before, last = db.execute(
            select(func.count(Attempt.id), func.max(Attempt.at)).where(
                Attempt.key == limit.key, Attempt.id < attempt.id
            )
        ).one()
        if before >= limit.most:
            wait = max(wait, _wait_after(before - limit.most) - (moment - last).total_seconds())
    numbers = [attempt.id for attempt in made]
    if wait > 0.0:  # what is turned away makes nobody wait longer
        db.execute(delete(Attempt).where(Attempt.id.in_(numbers)))
        db.commit()
        raise ThrottledError(max(1.0, wait))
    return numbers


def tries(db: Session, limit: Limit) -> int:
    """How many tries of the key are counted."""
    return db.scalar(select(func.count(Attempt.id)).where(Attempt.key == limit.key)) or 0


def forget(db: Session, numbers: Sequence[int], limit: Limit) -> None:
    """A try that was right: it and those of its key count no longer; the caller commits."""
    db.execute(delete(Attempt).where(Attempt.id.in_(numbers) | (Attempt.key == limit.key)))


def _wait_after(more: int) -> float:
    return min(LONGEST_WAIT, FIRST_WAIT * 2.0 ** min(more, 30))
