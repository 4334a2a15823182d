"""Whether the patient's screen may show a session still: its token, its end, and what the account that invited it sees."""

import asyncio
import contextlib
from collections.abc import Coroutine
from typing import Any

from anyio import to_thread
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from starlette.requests import HTTPConnection

from handscope.app.auth.gate import CHECK_EVERY, cookie_name
from handscope.app.auth.ward_access import sees_now
from handscope.app.live.patient_view.invitations import Screen
from handscope.app.live.station import Station
from handscope.app.state import Parts, parts
from handscope.estimators.errors import InputError

COOKIE = "handscope-screen"
LOOK = 0.25  # s between two looks whether a screen was ended
HANDING_OVER = 60.0  # s that a screen waits for the station of the other hand


def screen_of(connection: HTTPConnection) -> Screen | None:
    """The screen that a request comes from; a therapist's login is not asked."""
    token = connection.cookies.get(cookie_name(connection.scope, COOKIE))
    return parts(connection).screens.screen_of(token)


def station_of(all_parts: Parts, screen: Screen) -> Station | None:
    """The live station that the screen shows now; None while there is none."""
    try:
        station = all_parts.stations.get(screen.station)
    except InputError:
        return None
    return station if isinstance(station, Station) else None


async def await_station(all_parts: Parts, screen: Screen, other_than: str = "") -> Station | None:
    """The station that the screen shows next; None where the visit is over."""
    loop = asyncio.get_running_loop()
    until = loop.time() + HANDING_OVER
    while not screen.withdrawn.is_set():
        station = station_of(all_parts, screen)
        if station is not None and station.name != other_than and not station.ended:
            return station
        if loop.time() >= until:
            break
        await asyncio.sleep(LOOK)
    return None


async def serve_while_shown(
    all_parts: Parts, screen: Screen, serve: Coroutine[Any, Any, None]
) -> None:
    """Serve a web socket until its screen ends, or who invited it may see the session no more."""
    served = asyncio.ensure_future(serve)
    end = asyncio.ensure_future(_wait_for_end(all_parts, screen))
    try:
        await asyncio.wait({served, end}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        served.cancel()
        end.cancel()
        await asyncio.wait({served, end})
    if not served.cancelled():
        served.result()


def is_granted(all_parts: Parts, screen: Screen) -> bool:
    """Whether the account that invited the screen sees the session now; while it is handed over nothing is shown."""
    station = station_of(all_parts, screen)
    if station is None:
        return True
    return sees_now(all_parts.store, screen.by, station.setup.session)


async def _wait_for_end(all_parts: Parts, screen: Screen) -> None:
    loop = asyncio.get_running_loop()
    checked = loop.time()
    while not screen.withdrawn.is_set() and all_parts.screens.is_due(screen):
        await asyncio.sleep(LOOK)
        if loop.time() - checked < CHECK_EVERY:
            continue
        checked = loop.time()
        with contextlib.suppress(DBAPIError, PoolTimeout):  # a database that is away ends nothing
            if not await to_thread.run_sync(is_granted, all_parts, screen):
                all_parts.screens.withdraw(screen.station, screen.name)
