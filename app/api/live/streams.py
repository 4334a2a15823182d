"""/api/stations/{name}/streams: permissions for other programs to read a live session's poses; /api/stream: those poses"""

import asyncio
import time
from typing import Any

from anyio import to_thread
from fastapi import APIRouter, WebSocket
from pydantic import Field
from starlette.websockets import WebSocketDisconnect

from handscope.app.api.wards.ward_routes import require_member
from handscope.app.auth.gate import CHECK_EVERY
from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import ANYBODY, CLINICIAN, RequesterDep, requires_role
from handscope.app.auth.ward_access import sees_now, wait_until_hidden
from handscope.app.live.outputs import lsl_outlet, pose_message
from handscope.app.live.outputs.permits import Permit
from handscope.app.live.station import Station
from handscope.app.state import Db, Parts, PartsDep, StationDep, parts, session_of
from handscope.estimators.errors import InputError
from handscope.sessions.exports.measured import is_simulated
from handscope.sessions.store import records

router = APIRouter(tags=["streams"], dependencies=[requires_role(CLINICIAN)])
REFUSED, GONE, TOO_SLOW = 4401, 1001, 4408  # web socket close codes
SEND_WAIT = 5.0  # s that a client may take for one pose before it is let go
IDLE = 5.0  # s without a pose until the stream checks whether its session is still there


class NewStream(Incoming):
    """A live stream of poses to be opened."""

    rate: float = Field(60.0, allow_inf_nan=False, description="Hz, most poses a second: 1 to 120")


@router.get("/outlets")
def list_outlets(parts: PartsDep) -> list[dict[str, str]]:
    """What a session may send to, where the administrator named it without a wildcard."""
    named = [a for a in parts.settings.allowed_outlets if not set(a) & set("*?[")]
    return [{"address": a} for a in named if a != "lsl" or lsl_outlet.is_installed()]


@router.get("/stations/{name}/streams")
def list_streams(parts: PartsDep, station: StationDep) -> list[dict[str, Any]]:
    """The streams of a session; their tokens are not shown again."""
    return [
        {"stream": p.name, "rate": p.rate, "by": p.by, "clients": p.clients}
        for p in parts.permits.list_of(station.name)
    ]


@router.post("/stations/{name}/streams", status_code=201)
def open_stream(
    db: Db, parts: PartsDep, requester: RequesterDep, station: StationDep, new: NewStream
) -> dict[str, Any]:
    """Permit other programs to read the poses of a live session; the token is shown this once and ends with the session."""
    if not requester.is_of_house:
        require_member(requester, records.get(db, session_of(station)).patient.ward_id)
    if not isinstance(station, Station):
        raise InputError("api.replay_has_no_stream")
    permit, token = parts.permits.grant(station.name, new.rate, requester.name)
    return {
        "stream": permit.name,
        "rate": permit.rate,
        "token": token,
        "path": "/api/stream",
    }


@router.delete("/stations/{name}/streams/{stream}", status_code=204)
def close_stream(parts: PartsDep, station: StationDep, stream: str) -> None:
    """End a stream for every client that reads it."""
    parts.permits.withdraw(station.name, stream)


@router.websocket("/stream", dependencies=[requires_role(ANYBODY)])
async def stream_poses(websocket: WebSocket) -> None:
    """JSON of the newest pose, at most `rate` a second, for whoever holds the token (header `Authorization: Bearer TOKEN`)."""
    await websocket.accept()
    all_parts = parts(websocket)
    scheme, _, token = websocket.headers.get("authorization", "").partition(" ")
    permit = all_parts.permits.enter(token.strip()) if scheme.lower() == "bearer" else None
    if permit is None:
        await websocket.close(REFUSED, "no such stream, or it has enough clients")
        return
    try:
        station = all_parts.stations.get(permit.station)
        if not await to_thread.run_sync(sees_now, all_parts.store, permit.by, session_of(station)):
            await websocket.close(REFUSED, "who made the stream does not see this session any more")
            return
        assert isinstance(station, Station)
        ending = asyncio.ensure_future(_end_when_not_granted(all_parts, station, permit))
        try:
            await _send_poses(websocket, station, permit)
        finally:
            ending.cancel()
    except TimeoutError:
        await _close(websocket, TOO_SLOW, "the poses were not read")
    except InputError:
        await _close(websocket, GONE, "the session was closed")
    except (WebSocketDisconnect, RuntimeError):
        pass  # the client has left
    finally:
        all_parts.permits.leave(permit)


async def _end_when_not_granted(all_parts: Parts, station: Station, permit: Permit) -> None:
    """End the stream once its account was disabled, or the patient is in another ward; a database that cannot be reached ends nothing."""
    await wait_until_hidden(all_parts.store, permit.by, session_of(station), CHECK_EVERY)
    all_parts.permits.withdraw(station.name, permit.name)


async def _send_poses(websocket: WebSocket, station: Station, permit: Permit) -> None:
    """Send the newest pose whenever there is one; a client that reads slowly misses poses and holds back nobody."""
    setup, loop, new_pose = station.setup, asyncio.get_running_loop(), asyncio.Event()
    identity = station.glove.assembler.identity
    about = {"device": identity.name if identity else "", "port": setup.port}
    first = pose_message.description(setup.hand, setup.method_name, is_simulated(about))
    leave = station.watch_poses(lambda: loop.call_soon_threadsafe(new_pose.set))
    reader = asyncio.ensure_future(_read_until_gone(websocket))
    reader.add_done_callback(lambda _: new_pose.set())
    sent, due = None, 0.0
    try:
        await asyncio.wait_for(websocket.send_text(first.decode()), SEND_WAIT)
        while not (station.ended or permit.withdrawn.is_set() or reader.done()):
            rows = station.latest
            if rows is not None and len(rows) and rows is not sent:
                due, sent = time.monotonic() + 1 / permit.rate, rows
                message = pose_message.to_json(pose_message.newest_pose(rows, station.row_age()))
                await asyncio.wait_for(websocket.send_text(message.decode()), SEND_WAIT)
                await asyncio.sleep(max(0.0, due - time.monotonic()))
            else:
                new_pose.clear()
                if station.latest is sent:
                    await _wait(new_pose, IDLE)
        if not reader.done():
            await _close(websocket, GONE, "the stream was ended")
    finally:
        leave()
        reader.cancel()


async def _wait(new_pose: asyncio.Event, seconds: float) -> None:
    """Wait for an event, at most so many seconds."""
    try:
        await asyncio.wait_for(new_pose.wait(), seconds)
    except TimeoutError:
        pass


async def _close(websocket: WebSocket, code: int, reason: str) -> None:
    """Close without waiting long for a client that does not answer."""
    try:
        await asyncio.wait_for(websocket.close(code, reason), SEND_WAIT)
    except (TimeoutError, RuntimeError, WebSocketDisconnect):
        pass


async def _read_until_gone(websocket: WebSocket) -> None:
    """Read and drop what a client sends until it disconnects."""
    while (await websocket.receive())["type"] != "websocket.disconnect":
        pass
