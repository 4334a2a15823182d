"""/api/stations: live sessions and replays as they run; /api/gloves: where gloves may be plugged in"""

import asyncio
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, WebSocket
from pydantic import Field
from starlette.websockets import WebSocketDisconnect

from handscope.app.api.answers import StationRow, answers
from handscope.app.api.broadcast import (
    PULSE,
    StationBroadcast,
    localised_snapshot,
    next_pulse,
)
from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import CLINICIAN, SCIENTIST, RequesterDep, requires_role
from handscope.app.devices import ports
from handscope.app.devices.named_hand import named_hand
from handscope.app.language import Language
from handscope.app.live.readouts.trial_review import localised_review
from handscope.app.live.replay import Replay
from handscope.app.live.station import Station
from handscope.app.live.stations import AnyStation
from handscope.app.live.wizard.machine import State
from handscope.app.scene.camera.sides import Side
from handscope.app.state import (
    Db,
    LanguageDep,
    PartsDep,
    StationDep,
    parts,
    session_of,
    station_of,
    visible,
)
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import HINGES
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.store import records
from handscope.sessions.tables_io import tracker_places

router = APIRouter(tags=["stations"], dependencies=[requires_role(CLINICIAN)])
WATCHERS = requires_role(CLINICIAN, SCIENTIST)  # of replays, scientists too
NO_SUCH, GONE = 4404, 1001  # web socket close codes


class StationAction(Incoming):
    """What a person does at a station, with the details of that action."""

    action: str = Field(max_length=40)
    task: str = Field("", max_length=100)
    reason: str = Field("", max_length=1000)
    group: str = Field("", max_length=100)
    value: float | None = None


class StationView(Incoming):
    """From which side the hand is to be seen; `fit` keeps the side. With `mirrored` the picture is mirrored or not, and the side stays."""

    side: Literal[Side, "fit"] = "fit"
    mirrored: bool | None = None


class StiffJoints(Incoming):
    """Joints that cannot be straightened."""

    angles: dict[str, float] = Field(
        max_length=len(HINGES),
        description="flexion by joint as a goniometer shows it, deg; hyperextension is negative",
    )


class TrackerPlaces(Incoming):
    """Segments of trackers."""

    places: dict[str, str] = Field(max_length=64)


@router.get("/gloves")
def list_gloves(parts: PartsDep, language: LanguageDep) -> list[dict[str, Any]]:
    """Ports and addresses where a glove may be, virtual gloves of this server first."""
    own = [
        {"path": p, "description": name, "virtual": True}
        for p, name in parts.settings.demo_ports.items()
    ]
    real = [
        {"path": p.path, "description": p.description, "virtual": False} for p in ports.available()
    ]
    network = [
        {"path": url, "description": phrase("device.network_glove"), "virtual": False}
        for url in parts.settings.allowed_ports
        if not set(url) & set("*?[")
    ]
    return [
        {
            **port,
            "hand": named_hand(str(port["description"])),
            "description": language.translate(str(port["description"])),
            "in_use": parts.stations.uses(str(port["path"])),
        }
        for port in (*own, *real, *network)
    ]


@router.get("/stations", dependencies=[WATCHERS], responses=answers(list[StationRow]))
def list_stations(db: Db, parts: PartsDep, requester: RequesterDep) -> list[dict[str, Any]]:
    """Stations that run, live or as replays, of patients whom the account sees."""
    shown = [s for s in parts.stations.all() if visible(requester, s)]
    seen = records.visible_among(db, {session_of(s) for s in shown})
    return [{"station": s.name, "kind": s.kind} for s in shown if session_of(s) in seen]


@router.get("/stations/{name}", dependencies=[WATCHERS])
def read_station(station: StationDep, language: LanguageDep) -> dict[str, Any]:
    """The station's snapshot."""
    return localised_state(station, language)


@router.post("/stations/{name}/actions", dependencies=[WATCHERS])
def act(station: StationDep, language: LanguageDep, action: StationAction) -> dict[str, Any]:
    """Carry out a person's action on the wizard or the replay."""
    if isinstance(station, Replay):
        station.act(action.action, action.value)
    else:
        station.act(action.action, action.task, action.reason, action.group, action.value)
    return localised_state(station, language)


@router.post("/stations/{name}/view", status_code=204, dependencies=[WATCHERS])
def turn_view(station: StationDep, view: StationView) -> None:
    """Turn every viewer's picture of the hand to a side, or mirror it."""
    station.look(None if view.side == "fit" else view.side, view.mirrored)


@router.get("/stations/{name}/trial")
def read_trial(station: StationDep, language: LanguageDep) -> dict[str, Any] | None:
    """The trial that is to be kept or not: curves, marks, figures beside earlier ones, what was wrong; null where there is none."""
    return (
        None if isinstance(station, Replay) else localised_review(station.trial.payload(), language)
    )


@router.post("/stations/{name}/trial/replays", status_code=204)
def replay_trial(station: StationDep) -> None:
    """Show the trial under review once more in the scene."""
    if not isinstance(station, Replay):
        station.replay_trial()


@router.put("/stations/{name}/trackers")
def place_trackers(
    parts: PartsDep, station: StationDep, language: LanguageDep, new: TrackerPlaces
) -> dict[str, Any]:
    """Which tracker sits on which segment, by the trackers' names (empty: not worn); kept, and offered again with the next session of this hand."""
    if not isinstance(station, Station):
        raise InputError("live.no_trackers")
    tracker_places.require_places(new.places)
    if station.snapshot()["wizard"]["state"] != State.CONNECT:
        raise InputError("live.trackers_calibrated")
    places = station.glove.place_trackers(new.places)
    tracker_places.store_places(parts.store.folder, station.setup.hand, places)
    return localised_state(station, language)


@router.put("/stations/{name}/stiff-joints")
def enter_stiff_joints(
    station: StationDep, language: LanguageDep, new: StiffJoints
) -> dict[str, Any]:
    """Joints that cannot be straightened, all of them: every pose from now on has these angles."""
    if not isinstance(station, Station):
        raise InputError("api.replay_takes_no_pose")
    station.measured_pose.use_goniometer(new.angles)
    return localised_state(station, language)


@router.delete("/stations/{name}", status_code=204, dependencies=[WATCHERS])
def close_station(parts: PartsDep, requester: RequesterDep, name: str) -> None:
    """End a session (its recording is kept) or a replay."""
    if any(s.name == name and visible(requester, s) for s in parts.stations.all()):
        parts.stations.close(name)


def localised_state(station: AnyStation, language: Language) -> dict[str, Any]:
    """The station's snapshot in a language."""
    return localised_snapshot(station.snapshot(), language)


@router.websocket("/stations/{name}/live", dependencies=[WATCHERS])
async def live(
    websocket: WebSocket,
    language: LanguageDep,
    name: str,
    rate: Annotated[float, Query(ge=1, le=1 / PULSE)] = 1 / PULSE,
    changes: bool = False,
) -> None:
    """JSON messages: {"full": snapshot} when there is a new one, {"pulse": newest pose and curve points} with every pose, but at most `rate` a second.

    With `changes` a snapshot after the first is sent as {"changes": [[path, value], ...]} where that is possible.
    """
    await websocket.accept()
    try:
        station = station_of(websocket, name)
    except InputError:
        await websocket.close(NO_SUCH, "no such station")
        return
    reader = asyncio.ensure_future(_until_gone(websocket))
    try:
        await _send_live(websocket, station, language, reader, 1 / rate, changes)
    except (WebSocketDisconnect, RuntimeError):
        pass  # the viewer closed the page
    finally:
        reader.cancel()


async def _send_live(
    websocket: WebSocket,
    station: AnyStation,
    language: Language,
    reader: "asyncio.Future[None]",
    pulse_length: float,
    only_changes: bool,
) -> None:
    """Send each pose, at most one in each `pulse_length` s; a slow viewer misses poses, but no points of the curve."""
    broadcast = parts(websocket).broadcasts.of(station, language)
    number, newest, snapshot = None, -1e9, ""
    with broadcast.news(station) as news:
        reader.add_done_callback(lambda _: news.set())
        while await news.wait() and not reader.done():
            news.clear()
            pulse, newest = broadcast.pulse(station, newest)
            if only_changes:
                number, snapshot = _changes(broadcast, station, language, number)
            else:
                before, (number, full) = number, broadcast.snapshot(station, language)
                snapshot = f',"full":{full}' if number != before else ""
            await websocket.send_text(f'{{"pulse":{pulse}{snapshot}}}')
            if station.ended:
                await websocket.close(GONE, "the station was closed")
                return
            await next_pulse(news, pulse_length)


def _changes(
    broadcast: StationBroadcast, station: AnyStation, language: Language, seen: int | None
) -> tuple[int, str]:
    """The newest snapshot's number, and what of it a viewer who has seen the one of number `seen` has to be sent: nothing, what changed, or all."""
    number, parts_changed = broadcast.changes(station, language, seen)
    if number == seen:
        return number, ""
    if parts_changed is not None:
        return number, f',"changes":{parts_changed}'
    return number, f',"full":{broadcast.snapshot(station, language)[1]}'


async def _until_gone(websocket: WebSocket) -> None:
    while (await websocket.receive())["type"] != "websocket.disconnect":
        pass
