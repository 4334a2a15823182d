"""The server's parts that routes use, made once by `create_app` and stored on the application."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Query
from sqlalchemy.orm import Session
from starlette.requests import HTTPConnection, Request

from handscope.app import language as languages
from handscope.app.api.broadcast import Broadcasts
from handscope.app.auth.pending_logins import PendingLogins
from handscope.app.auth.roles import Requester, on_behalf_of, requester
from handscope.app.documents import Asked, Documents
from handscope.app.job_queue import Jobs
from handscope.app.language import Language
from handscope.app.live.outputs.permits import Permits
from handscope.app.live.patient_view.invitations import Invitations
from handscope.app.live.relays import Relays
from handscope.app.live.replay import Replay
from handscope.app.live.stations import AnyStation, Stations
from handscope.app.settings import Settings
from handscope.app.workers.pending_tables import PendingTables
from handscope.app.workers.session_repair import SessionRepair
from handscope.app.workers.storage_mover import StorageMover
from handscope.app.workers.upload_reader import UploadReader
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import audit
from handscope.sessions.db import visible_rows
from handscope.sessions.db.visible_rows import Visibility
from handscope.sessions.store.store import Store


@dataclass(frozen=True)
class Parts:
    """Everything that lives as long as the server."""

    settings: Settings
    store: Store
    jobs: Jobs
    documents: Documents
    stations: Stations
    upload_reader: UploadReader
    storage_mover: StorageMover | None  # where there is an object storage
    relays: Relays  # of gloves at the ports of clinicians' browsers
    broadcasts: Broadcasts = field(default_factory=Broadcasts)
    pending_logins: PendingLogins = field(default_factory=PendingLogins)
    pending_tables: PendingTables = field(default_factory=PendingTables)
    permits: Permits = field(default_factory=Permits)  # of streams that other programs read
    screens: Invitations = field(default_factory=Invitations)  # of patients


def parts(connection: HTTPConnection) -> Parts:
    """The parts of the application that serves this request or web socket."""
    value: Parts = connection.app.state.parts
    return value


def documents(request: Request) -> Asked:
    """What makes documents for whoever asks by this request, as long as they wait."""
    return Asked(parts(request).documents, request.is_disconnected)


def repair(connection: HTTPConnection) -> SessionRepair:
    """The repair of sessions that the last server left open."""
    value: SessionRepair = connection.app.state.repair
    return value


def database(connection: HTTPConnection) -> Iterator[Session]:
    """A database session for one request, in the name of its account."""
    with parts(connection).store.database() as db:
        audit.set_actor(db, *on_behalf_of(connection))
        visible_rows.restrict(db, _visibility(connection))
        yield db


def _visibility(connection: HTTPConnection) -> Visibility | None:
    """Whose patients this request sees; without a login nobody's of a ward."""
    asking: Requester | None = getattr(connection.state, "requester", None)
    return asking.visibility if asking else Visibility(frozenset())


def visible(requester: Requester, station: AnyStation) -> bool:
    """Whether the account may see a station: only clinicians see a live session. Whose patient it shows the gate has asked."""
    return requester.sees_all or isinstance(station, Replay)


def session_of(station: AnyStation) -> int:
    """The session that a station shows."""
    return station.session if isinstance(station, Replay) else station.setup.session


def station_of(connection: HTTPConnection, name: str) -> AnyStation:
    """The station; InputError where there is none that the account may see."""
    station = parts(connection).stations.get(name)
    if not visible(requester(connection), station):
        raise InputError("live.station_closed", name=name)
    return station


def language(
    connection: HTTPConnection,
    language: Annotated[
        str, Query(description="en, de, ...; without it the Accept-Language header decides")
    ] = "",
) -> Language:
    """The language of the sentences in an answer, with times where the reader is."""
    found = languages.language(language) if language else preferred(connection)
    return found.read_in(connection.headers.get("time-zone", ""))


def preferred(connection: HTTPConnection) -> Language:
    """The language that the address asks for (`?language=de`) where there is it, else that of the browser."""
    asked = languages.languages().get(connection.query_params.get("language", ""))
    return asked or languages.preferred(connection.headers.get("accept-language", ""))


StationDep = Annotated[AnyStation, Depends(station_of)]
RepairDep = Annotated[SessionRepair, Depends(repair)]
PartsDep = Annotated[Parts, Depends(parts)]
Db = Annotated[Session, Depends(database)]
LanguageDep = Annotated[Language, Depends(language)]
DocumentsDep = Annotated[Asked, Depends(documents)]
