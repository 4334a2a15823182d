"""/patient-view: what the patient's own screen is served. No login: a code that is valid once, then a cookie for this screen alone.

The screen reads and never writes: its web sockets pass nothing on but from where it looks at the hand.
"""

import asyncio
import hashlib
import time
from contextlib import suppress
from typing import Any

import orjson
from anyio import to_thread
from fastapi import APIRouter, Request, Response, WebSocket
from pydantic import Field
from starlette.websockets import WebSocketDisconnect

from handscope.app import language as languages
from handscope.app.api.broadcast import TRANSLATED_KEYS
from handscope.app.api.pages import OPENING, scene_answer
from handscope.app.api.patient_view.screen_access import (
    COOKIE,
    await_station,
    is_granted,
    screen_of,
    serve_while_shown,
    station_of,
)
from handscope.app.auth.gate import cookie_name
from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import ANYBODY, address_of, requires_role
from handscope.app.auth.security_headers import is_over_tls
from handscope.app.live.patient_view.invitations import SCREEN_LIFE, Screen
from handscope.app.live.patient_view.screen_state import screen_state
from handscope.app.live.station import Station
from handscope.app.page_files.document import document
from handscope.app.scene import bridge
from handscope.app.state import Parts, PartsDep, parts
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import audit
from handscope.sessions.clinic.audit import AuditEvent
from handscope.sessions.login import throttle
from handscope.sessions.store import records

router = APIRouter(tags=["patient's screen"], dependencies=[requires_role(ANYBODY)])
REFUSED, GONE = 4401, 1001  # web socket close codes
PAUSE = 0.05  # s between two states that are sent
MOST_TRIES = 20  # codes from one address that wait for nothing


class ScreenCode(Incoming):
    """The code that opens a screen."""

    code: str = Field(max_length=40)


@router.get("/patient-view", include_in_schema=False)
def page(request: Request) -> Response:
    """The page of the screen; it asks for the code where the address has none after the #."""
    return document("patient_view/index.html", request.headers)


@router.post("/api/patient-view", responses={200: {"description": "the screen's language"}})
def open_screen(
    all_parts: PartsDep, request: Request, response: Response, given: ScreenCode
) -> dict[str, str]:
    """Show a live session on this screen; sets its cookie."""
    address = address_of(request)
    opened = _try_code(all_parts, given.code, address)
    if opened is None:
        raise InputError("api.screen_code_refused")
    screen, token = opened
    response.set_cookie(
        cookie_name(request.scope, COOKIE),
        token,
        max_age=round(SCREEN_LIFE),
        httponly=True,
        samesite="strict",
        secure=is_over_tls(request.scope),
        path="/",
    )
    return {"language": screen.language}


@router.get("/patient-view/scene/", include_in_schema=False)
def scene_page(request: Request) -> Response:
    """The 3-D hand of the session; it comes back for its web socket."""
    return scene_answer(request) if screen_of(request) else Response(status_code=401)


@router.websocket("/patient-view/scene")
async def scene_socket(websocket: WebSocket) -> None:
    """The 3-D scene of the session, to be looked at."""
    all_parts, screen = parts(websocket), screen_of(websocket)
    station = station_of(all_parts, screen) if screen else None
    if screen is None or station is None:
        await websocket.close(REFUSED, "no screen")
        return
    await serve_while_shown(all_parts, screen, _pass_scene(websocket, station))
    with suppress(RuntimeError, WebSocketDisconnect):
        await websocket.close(GONE)


@router.websocket("/api/patient-view/live")
async def live(websocket: WebSocket) -> None:
    """JSON of the screen's state (screen_state.py), whenever it changed."""
    await websocket.accept()
    all_parts, screen = parts(websocket), screen_of(websocket)
    if screen is None or not await to_thread.run_sync(is_granted, all_parts, screen):
        await websocket.close(REFUSED, "no screen, or it ended")
        return
    await serve_while_shown(all_parts, screen, _send_states(websocket, all_parts, screen))
    with suppress(RuntimeError, WebSocketDisconnect):
        await websocket.close(GONE, "the session is over")


def _try_code(all_parts: Parts, code: str, address: str) -> tuple[Screen, str] | None:
    """Count the try, so that codes cannot be guessed, and record in the audit trail who was shown which session."""
    key = hashlib.sha256(f"screen from {throttle.network(address)}".encode()).hexdigest()
    limit = throttle.Limit(key, MOST_TRIES)
    with all_parts.store.database() as db:
        audit.set_actor(db, "", address)
        tried = throttle.count(db, [limit])
        opened = all_parts.screens.open(code, address)
        if opened is None:
            counts = {"by": "screen's code", "tries": throttle.tries(db, limit)}
            audit.record(db, AuditEvent("refused", "screen", counts=counts))
        else:
            throttle.forget(db, tried, limit)
            audit.record(db, _shown(db, all_parts, opened[0]))
        db.commit()
    return opened


def _shown(db: Any, all_parts: Parts, screen: Screen) -> AuditEvent:
    station = station_of(all_parts, screen)
    session = station.setup.session if station else None
    patient = records.get(db, session).patient_id if session else None
    return AuditEvent("viewed", "screen", screen.name, patient, {"session": session})


async def _pass_scene(websocket: WebSocket, station: Station) -> None:
    until = time.monotonic() + OPENING
    while not station.scene.port and time.monotonic() < until:
        await asyncio.sleep(0.05)
    await bridge.bridge(websocket, station.scene.port, station.scene.secret, only_looks=True)


async def _send_states(websocket: WebSocket, all_parts: Parts, screen: Screen) -> None:
    """Send the state until the visit is over; it goes on with the other hand's station."""
    reader = asyncio.ensure_future(_read_until_gone(websocket))
    name = ""
    try:
        while station := await await_station(all_parts, screen, name):
            name = station.name
            await _follow(websocket, station, screen, reader)
            if reader.done():
                return
    except (WebSocketDisconnect, RuntimeError):
        pass  # the screen's page was closed
    finally:
        reader.cancel()


async def _follow(
    websocket: WebSocket, station: Station, screen: Screen, reader: "asyncio.Future[None]"
) -> None:
    """Send the states of one station, each in the screen's language, until it ends."""
    loop, news, language = (
        asyncio.get_running_loop(),
        asyncio.Event(),
        languages.language(screen.language),
    )
    leave = station.watch(lambda: loop.call_soon_threadsafe(news.set))
    reader.add_done_callback(lambda _: news.set())
    news.set()
    sent, since = b"", -1e9
    try:
        while await news.wait() and not reader.done():
            news.clear()
            points = station.pulse(since)["points"]
            since = points[-1][0] - 1.0 if points else since
            _, snapshot = station.news()
            state = language.translate_keys(screen_state(snapshot, points), TRANSLATED_KEYS)
            if (text := orjson.dumps(state, option=orjson.OPT_SERIALIZE_NUMPY)) != sent:
                await websocket.send_text(text.decode())
                sent = text
            if station.ended:
                return
            await asyncio.sleep(PAUSE)
    finally:
        leave()


async def _read_until_gone(websocket: WebSocket) -> None:
    """What the screen sends is read, so that its end is seen, and thrown away."""
    while (await websocket.receive())["type"] != "websocket.disconnect":
        pass
