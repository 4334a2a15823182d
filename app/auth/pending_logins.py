"""Logins whose first factor was right and whose second is waited for, and passkeys that are being made: in memory, for five minutes."""

import secrets
import threading
import time
from collections import OrderedDict
from dataclasses import dataclass, field

from handscope.app.auth.passkeys import Asked

LIFE = 300.0  # s
MOST = 1000


@dataclass(frozen=True)
class Pending:
    """What a ticket stands for."""

    account: int
    asked: Asked | None = None  # of a passkey
    began: float = field(default_factory=time.monotonic)


class PendingLogins:
    """Tickets; a server that restarts has none, and the login begins again."""

    def __init__(self) -> None:
        self._pending: OrderedDict[str, Pending] = OrderedDict()
        self._lock = threading.Lock()

    def add(self, account: int, asked: Asked | None = None) -> str:
        """A ticket (192 random bits)."""
        ticket = secrets.token_urlsafe(24)
        with self._lock:
            self._pending[ticket] = Pending(account, asked)
            while len(self._pending) > MOST:
                self._pending.popitem(last=False)
        return ticket

    def get(self, ticket: str) -> Pending | None:
        """What it stands for; None where it is unknown or too old."""
        with self._lock:
            found = self._pending.get(ticket)
            if found is not None and time.monotonic() - found.began > LIFE:
                del self._pending[ticket]
                return None
            return found

    def end(self, ticket: str) -> None:
        """It was used."""
        with self._lock:
            self._pending.pop(ticket, None)
