"""What the gate tells the audit trail: who saw and exported what, and what was refused. What was changed tells itself (sessions/clinic/audit.py).

A page asks again and again for what it shows, so the same look of the same login is told once in AGAIN; an export is told each time. A line is
written before the answer begins. Where it cannot be written (a full disk), the log says so and the page is shown all the same.
"""

import logging
import threading
import time
from collections import OrderedDict
from collections.abc import Hashable

import anyio.to_thread
from sqlalchemy.exc import DBAPIError
from starlette.requests import HTTPConnection
from starlette.types import Message, Send

from handscope.app.auth.roles import Door, on_behalf_of
from handscope.app.live.replay import Replay
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import audit
from handscope.sessions.clinic.audit import Happened
from handscope.sessions.store.store import Store

log = logging.getLogger(__name__)
AGAIN = 15 * 60.0  # s
MOST = 4096  # looks that are remembered
SEEN = "viewed"
LISTS = {
    "/api/patients": "patients",
    "/api/sessions/unfinished": "sessions",
    "/api/accounts": "accounts",
    "/api/audit": "audit",
}


class Watch:
    """Tells looks, exports and refusals."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._told: OrderedDict[Hashable, float] = OrderedDict()
        self._lock = threading.Lock()

    def on(self, send: Send, connection: HTTPConnection, door: Door | None) -> Send:
        """`send`, with the answer told before it begins."""

        async def sender(message: Message) -> None:
            if message["type"] == "http.response.start" and connection.scope["method"] == "GET":
                await self.answered(connection, door, message["status"])
            await send(message)

        return sender

    async def answered(self, connection: HTTPConnection, door: Door | None, status: int) -> None:
        """Tell that somebody was shown something."""
        if (
            door is None
            or door.may is None
            or status >= 400
            or getattr(connection.state, "who", None) is None
        ):
            return
        subject = _subject(connection, door)
        what = door.may.does
        if subject and (what != SEEN or self._first((connection.state.who.login, subject))):
            await anyio.to_thread.run_sync(self._tell, connection, Happened(what, *subject))

    async def refused(self, connection: HTTPConnection, status: int) -> None:
        """Tell that somebody was turned away: an account of each address, a stranger once in a while, however many he tries."""
        about = Happened("refused", "request", connection.scope["path"], counts={"status": status})
        who, where = on_behalf_of(connection)
        if status >= 400 and self._first((who, where, status, about.ref if who else "")):
            await anyio.to_thread.run_sync(self._tell, connection, about)

    def _tell(self, connection: HTTPConnection, happened: Happened) -> None:
        try:
            with self._store.database() as db:
                audit.by(db, *on_behalf_of(connection))
                audit.tell(db, audit.whose(db, happened))
                db.commit()
        except DBAPIError as problem:
            log.error(
                "not in the audit trail: %s %s: %s", on_behalf_of(connection), happened, problem
            )

    def _first(self, key: Hashable) -> bool:
        """Whether it was not told within AGAIN."""
        moment = time.monotonic()
        with self._lock:
            if moment - self._told.get(key, -AGAIN) < AGAIN:
                return False
            self._told[key] = moment
            self._told.move_to_end(key)
            while len(self._told) > MOST:
                self._told.popitem(last=False)
        return True


def _subject(connection: HTTPConnection, door: Door) -> tuple[str, str] | None:
    """What an address is about: kind and number."""
    for name, value in door.named.items():
        if name.endswith("_id"):
            return name.removesuffix("_id"), str(value)
        if name == "name":
            return _of_station(connection, str(value))
    kind = LISTS.get(connection.scope["path"])
    return (kind, "") if kind else None


def _of_station(connection: HTTPConnection, name: str) -> tuple[str, str] | None:
    """The session that a station shows."""
    try:
        station = connection.scope["app"].state.parts.stations.get(name)
    except InputError:
        return None
    return "session", str(station.session if isinstance(station, Replay) else station.setup.session)
