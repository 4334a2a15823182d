"""Lines that the gate adds to the audit trail: views, exports and refusals. Changes add their own (sessions/clinic/audit.py).

A page requests the same data repeatedly, so a view is recorded once in REPEAT_AFTER per login; an export every time.
A line is written before the answer begins. Where that fails the page is served: a full disk is logged, and while the
database is locked the line waits in memory and is written, with its time, when the database takes it.
"""

import logging
import threading
import time
from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass, replace

import anyio.to_thread
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session
from starlette.requests import HTTPConnection
from starlette.types import Message, Send

from handscope.app.auth.roles import RouteAccess, on_behalf_of
from handscope.app.auth.ward_access import session_of_station
from handscope.app.private_log import describe_error
from handscope.sessions.clinic import audit
from handscope.sessions.clinic.audit import AuditEvent
from handscope.sessions.db.tables import now
from handscope.sessions.db.unavailable import is_unavailable
from handscope.sessions.store.database import hurry
from handscope.sessions.store.store import Store

log = logging.getLogger(__name__)
REPEAT_AFTER = 15 * 60.0  # s
MOST = 4096  # views remembered, lines that wait
WRITE_WAIT = 0.5  # s that a view waits for its line
SEEN = "viewed"
LISTS = {
    "/api/patients": "patients",
    "/api/sessions/unfinished": "sessions",
    "/api/accounts": "accounts",
    "/api/audit": "audit",
}


@dataclass(frozen=True)
class _Line:
    """A line that is to be written."""

    who: str
    address: str
    event: AuditEvent
    moment: str  # at which it happened, ISO


class AuditHooks:
    """Records views, exports and refusals."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._recorded: OrderedDict[Hashable, float] = OrderedDict()
        self._lock = threading.Lock()
        self._waiting = list[_Line]()  # while the database takes nothing

    def record_on(self, send: Send, connection: HTTPConnection, access: RouteAccess | None) -> Send:
        """`send` that records the view before the answer begins."""

        async def sender(message: Message) -> None:
            if message["type"] == "http.response.start" and connection.scope["method"] == "GET":
                await self.record_view(connection, access, message["status"])
            await send(message)

        return sender

    async def record_view(
        self, connection: HTTPConnection, access: RouteAccess | None, status: int
    ) -> None:
        """Record that an account was shown something."""
        if (
            access is None
            or access.requirement is None
            or status >= 400
            or getattr(connection.state, "requester", None) is None
        ):
            return
        subject = _subject(connection, access)
        what = access.requirement.does
        if subject and (what != SEEN or self._is_due((connection.state.requester.login, subject))):
            forms = {k: v for k, v in connection.path_params.items() if k == "form"}
            event = AuditEvent(what, *subject, counts=forms)
            await anyio.to_thread.run_sync(self._write, connection, event)

    async def record_refusal(self, connection: HTTPConnection, status: int) -> None:
        """Record a refusal: of an account for each address, of a stranger once in REPEAT_AFTER."""
        event = AuditEvent(
            "refused", "request", connection.scope["path"], counts={"status": status}
        )
        who, where = on_behalf_of(connection)
        if status >= 400 and self._is_due((who, where, status, event.ref if who else "")):
            await anyio.to_thread.run_sync(self._write, connection, event)

    def _write(self, connection: HTTPConnection, happened: AuditEvent) -> None:
        try:
            self._append(_Line(*on_behalf_of(connection), happened, now().isoformat()))
        except DBAPIError as problem:
            if is_unavailable(problem):
                self._wait_with(_Line(*on_behalf_of(connection), happened, now().isoformat()))
            log.error(
                "%s: account %s, %s %s: %s",
                "waits for the audit trail"
                if is_unavailable(problem)
                else "not in the audit trail",
                on_behalf_of(connection)[0],
                happened.what,
                happened.kind,
                describe_error(problem),
            )

    def _append(self, line: "_Line") -> None:
        """Write a line after those that wait, which say when they happened."""
        with self._lock:
            lines, self._waiting = [*self._waiting, line], []
        try:
            with self._store.database() as db:
                while lines:
                    _write_line(db, lines[0], late=lines[0] is not line)
                    lines.pop(0)
        finally:
            with self._lock:
                self._waiting = [one for one in lines if one is not line] + self._waiting

    def _wait_with(self, line: "_Line") -> None:
        with self._lock:
            if len(self._waiting) < MOST:
                self._waiting.append(line)

    def _is_due(self, key: Hashable) -> bool:
        """Whether it was not recorded within REPEAT_AFTER."""
        moment = time.monotonic()
        with self._lock:
            if moment - self._recorded.get(key, -REPEAT_AFTER) < REPEAT_AFTER:
                return False
            self._recorded[key] = moment
            self._recorded.move_to_end(key)
            while len(self._recorded) > MOST:
                self._recorded.popitem(last=False)
        return True


def _write_line(db: Session, line: _Line, late: bool) -> None:
    hurry(db, WRITE_WAIT)
    event = audit.add_patient(db, line.event)
    if late:
        event = replace(event, counts={**event.counts, "happened": line.moment})
    audit.set_actor(db, line.who, line.address)
    audit.record(db, event)
    db.commit()


def _subject(connection: HTTPConnection, access: RouteAccess) -> tuple[str, str] | None:
    """Kind and number of what an address names."""
    for name, value in access.named.items():
        if name.endswith("_id"):
            return name.removesuffix("_id"), str(value)
        if name == "name":
            return _of_station(connection, str(value))
    kind = LISTS.get(connection.scope["path"])
    return (kind, "") if kind else None


def _of_station(connection: HTTPConnection, name: str) -> tuple[str, str] | None:
    """The session that a station shows."""
    session = session_of_station(connection, name)
    return None if session is None else ("session", str(session))
