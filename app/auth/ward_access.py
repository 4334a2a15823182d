"""Whose patient an address names, for the gate: of another ward nothing is served, whatever the route does.

Routes' own queries are narrowed besides (sessions/db/visible_rows.py). A new kind of number in an address is refused
to accounts of a ward until it stands here.
"""

import asyncio
import contextlib
from collections.abc import Iterator

from anyio import to_thread
from sqlalchemy import select
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from sqlalchemy.orm import Session
from starlette.requests import HTTPConnection

from handscope.app.auth.roles import Requester, RouteAccess
from handscope.app.state import session_of
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.clinic.audit import patient_of
from handscope.sessions.db.tables import Account, Patient, PatientSession
from handscope.sessions.store.store import Store
from handscope.sessions.wards import wards

OTHER_WARD = phrase("wards.other_ward")
OF_PATIENTS = frozenset(
    {
        *("patient", "note", "session", "recording", "correction", "self_calibration"),
        *("photograph", "result", "treatment_event", "goal"),
    }
)
OF_NOBODY = frozenset({"account", "ward", "factor", "access"})  # their routes ask whose it is
STATION = "name"  # what routes call a station


def subjects(connection: HTTPConnection, access: RouteAccess) -> Iterator[tuple[str, int] | None]:
    """Kind and number of everything of patients that an address names; None for a kind that is not known."""
    for name, value in access.named.items():
        kind = name.removesuffix("_id")
        if name == STATION:
            session = session_of_station(connection, str(value))
            if session is not None:
                yield "session", session
        elif name.endswith("_id") and kind not in OF_NOBODY:
            if kind not in OF_PATIENTS:
                yield None
            elif str(value).isdecimal() and len(str(value)) <= 18:
                yield kind, int(value)


def is_visible(db: Session, requester: Requester, kind: str, number: int) -> bool:
    """Whether the account sees the patient whose it is; what there is not is left to the route."""
    patient = patient_of(db, kind, number)
    ward = db.scalar(select(Patient.ward_id).where(Patient.id == patient))
    if patient is None or ward is None or requester.visibility is None:
        return True
    return requester.visibility.covers(ward, patient)


def sees_session(db: Session, account: str, session: int) -> bool:
    """Whether an account, by its name, is in use and sees the patient of a session."""
    found = db.scalar(select(Account).where(Account.name == account))
    if found is None or found.disabled:
        return False
    visibility = wards.visibility_of(db, found)
    if visibility is None:
        return True
    row = db.get(PatientSession, session)
    return row is not None and visibility.covers(row.patient.ward_id, row.patient_id)


def sees_now(store: Store, account: str, session: int) -> bool:
    """The same, asked of the database at once, for what lasts longer than a request."""
    with store.database() as db:
        return sees_session(db, account, session)


async def wait_until_hidden(store: Store, account: str, session: int, every: float) -> None:
    """Return once the account no longer sees the session, asked every so many seconds; a database that cannot be reached hides nothing."""
    seen = True
    while seen:
        await asyncio.sleep(every)
        with contextlib.suppress(DBAPIError, PoolTimeout):
            seen = await to_thread.run_sync(sees_now, store, account, session)


def session_of_station(connection: HTTPConnection, name: str) -> int | None:
    """The session that a station shows; None where there is no such station."""
    try:
        station = connection.scope["app"].state.parts.stations.get(name)
    except InputError:
        return None
    return session_of(station)
