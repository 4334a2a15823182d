"""What routes reach: the server's parts, made once by `create_app` and kept on the application."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Query
from sqlalchemy.orm import Session
from starlette.requests import HTTPConnection

from handscope.app import language as languages
from handscope.app.api.broadcast import Bulletins
from handscope.app.auth.roles import Who, on_behalf_of, who
from handscope.app.job_queue import Jobs
from handscope.app.language import Language
from handscope.app.live.replay import Replay
from handscope.app.live.stations import AnyStation, Stations
from handscope.app.settings import Settings
from handscope.app.workers.storage_mover import MovingOut
from handscope.app.workers.upload_reader import Opening
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import audit
from handscope.sessions.store.store import Store


@dataclass(frozen=True)
class Parts:
    settings: Settings
    store: Store
    jobs: Jobs
    stations: Stations
    opening: Opening
    moving_out: MovingOut | None  # where an object storage is attached
    bulletins: Bulletins = field(default_factory=Bulletins)


def parts(connection: HTTPConnection) -> Parts:
    """The parts of the application that serves this request or web socket."""
    found: Parts = connection.app.state.parts
    return found


def database(connection: HTTPConnection) -> Iterator[Session]:
    """A database session for one request, in the name of its account."""
    with parts(connection).store.database() as db:
        audit.by(db, *on_behalf_of(connection))
        yield db


def visible(who: Who, station: AnyStation) -> bool:
    """Whether the account may see a station: a patient who is being measured is the clinician's alone."""
    return who.sees_all or isinstance(station, Replay)


def station_of(connection: HTTPConnection, name: str) -> AnyStation:
    """The station; InputError where there is none that the account may see."""
    found = parts(connection).stations.get(name)
    if not visible(who(connection), found):
        raise InputError(f"there is no station {name}; it was closed")
    return found


def language(
    connection: HTTPConnection,
    language: Annotated[
        str, Query(description="en, de, ...; without it the Accept-Language header decides")
    ] = "",
) -> Language:
    """The language that sentences for people are answered in."""
    return languages.language(language) if language else preferred(connection)


def preferred(connection: HTTPConnection) -> Language:
    """The language that the browser asks for."""
    return languages.preferred(connection.headers.get("accept-language", ""))


StationDep = Annotated[AnyStation, Depends(station_of)]
PartsDep = Annotated[Parts, Depends(parts)]
Db = Annotated[Session, Depends(database)]
LanguageDep = Annotated[Language, Depends(language)]
