"""/api/stations: live sessions and replays as they run; /api/gloves: where gloves may be plugged in"""

import asyncio
import time
from pathlib import Path
from typing import Any

from fastapi import APIRouter, WebSocket
from pydantic import BaseModel, ConfigDict, Field
from starlette.websockets import WebSocketDisconnect

from app.api.roles import CLINICIAN, SCIENTIST, WhoDep, may
from app.api.state import LanguageDep, PartsDep, StationDep, station_of, visible
from app.devices import ports
from app.language import Language
from app.live.replay import Replay
from app.live.stations import AnyStation
from estimators.errors import InputError

router = APIRouter(tags=["stations"], dependencies=[may(CLINICIAN)])
WATCHERS = may(CLINICIAN, SCIENTIST)  # of replays, scientists too
PULSE = 1 / 60  # s, least time between two messages to a viewer
FULL = 0.1  # s between two whole snapshots to a viewer
SPOKEN = (
    "title",
    "instruction",
    "message",
    "problem",
    "say",
    "word",
    "words",
    "next",
    "reason",
    "hint",
)  # keys of texts that stations tell in English
NO_SUCH, GONE = 4404, 1001  # web socket close codes


class Wish(BaseModel):
    model_config = ConfigDict(extra="forbid")

    action: str = Field(max_length=40)
    task: str = Field("", max_length=100)
    reason: str = Field("", max_length=1000)
    group: str = Field("", max_length=100)
    value: float | None = None


@router.get("/gloves")
def list_gloves(parts: PartsDep) -> list[dict[str, Any]]:
    """Serial ports where a glove may be, virtual gloves of this server first."""
    own = [{"path": p, "description": Path(p).name.replace("-", " "), "virtual": True} for p in parts.settings.demo_ports]
    real = [{"path": p.path, "description": p.description, "virtual": False} for p in ports.available()]
    return [{**port, "in_use": parts.stations.uses(str(port["path"]))} for port in (*own, *real)]


@router.get("/stations", dependencies=[WATCHERS])
def list_stations(parts: PartsDep, who: WhoDep) -> list[dict[str, Any]]:
    return [{"station": s.name, "kind": s.kind} for s in parts.stations.all() if visible(who, s)]


@router.get("/stations/{name}", dependencies=[WATCHERS])
def read_station(station: StationDep, language: LanguageDep) -> dict[str, Any]:
    """Where the session stands."""
    return told(station, language)


@router.post("/stations/{name}/actions", dependencies=[WATCHERS])
def act(station: StationDep, language: LanguageDep, wish: Wish) -> dict[str, Any]:
    """Tell the wizard or the replay what a person wants."""
    if isinstance(station, Replay):
        station.act(wish.action, wish.value)
    else:
        station.act(wish.action, wish.task, wish.reason, wish.group, wish.value)
    return told(station, language)


@router.delete("/stations/{name}", status_code=204, dependencies=[WATCHERS])
def close_station(parts: PartsDep, who: WhoDep, name: str) -> None:
    """End a session (its recording is kept) or a replay."""
    if any(s.name == name and visible(who, s) for s in parts.stations.all()):
        parts.stations.close(name)


def told(station: AnyStation, language: Language) -> dict[str, Any]:
    """Where the station stands, in a language."""
    found: dict[str, Any] = language.told(station.snapshot(), SPOKEN)
    return found


@router.websocket("/stations/{name}/live", dependencies=[WATCHERS])
async def live(websocket: WebSocket, language: LanguageDep, name: str) -> None:
    """JSON messages: {"full": snapshot} ten times a second, {"pulse": newest pose and curve points} with every pose."""
    await websocket.accept()
    try:
        station = station_of(websocket, name)
    except InputError:
        await websocket.close(NO_SUCH, "no such station")
        return
    news, loop = asyncio.Event(), asyncio.get_running_loop()
    leave = station.watch(lambda: None if news.is_set() else loop.call_soon_threadsafe(news.set))
    reader = asyncio.ensure_future(_until_gone(websocket))
    try:
        await _tell(websocket, station, language, news, reader)
    except (WebSocketDisconnect, RuntimeError):
        pass  # the viewer closed the page
    finally:
        reader.cancel()
        leave()


async def _tell(websocket: WebSocket, station: AnyStation, language: Language, news: asyncio.Event, reader: "asyncio.Future[None]") -> None:
    told_full, told_pulse, newest = -1.0, -1.0, -1e9
    while not reader.done():
        try:
            await asyncio.wait_for(news.wait(), 1.0)
        except TimeoutError:
            continue
        await asyncio.sleep(max(0.0, PULSE - (time.monotonic() - told_pulse)))
        news.clear()
        now = time.monotonic()
        message: dict[str, Any] = {"pulse": station.pulse(newest)}
        newest = message["pulse"]["points"][-1][0] if message["pulse"]["points"] else newest
        if now - told_full >= FULL or station.ended:
            message["full"], told_full = told(station, language), now
        told_pulse = now
        await websocket.send_json(message)
        if station.ended:
            await websocket.close(GONE, "the station was closed")
            return


async def _until_gone(websocket: WebSocket) -> None:
    while (await websocket.receive())["type"] != "websocket.disconnect":
        pass
