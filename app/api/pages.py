"""The pages: one document whose modules draw what the address names, and the 3-D scene of a station."""

import asyncio
import gzip
import time
from collections.abc import Callable, Iterator
from contextlib import suppress

from fastapi import APIRouter, Request, WebSocket
from starlette.responses import Response

from handscope.app.auth.roles import CLINICIAN, EVERY_ACCOUNT, SCIENTIST, Requester, requires_role
from handscope.app.live.replay import Replay
from handscope.app.page_files.document import document
from handscope.app.scene.bridge import bridge
from handscope.app.scene.viser_page import scene_page
from handscope.app.state import StationDep, station_of
from handscope.estimators.errors import InputError

router = APIRouter(include_in_schema=False, dependencies=[requires_role(*EVERY_ACCOUNT)])
OPENING = 30.0  # s that a viewer waits for a scene whose process begins
PAGES = {  # what static/app.js imports there
    "/": "patients",
    "/patients/{id}": "patient",
    "/patients/{id}/tables/{table}": "table",
    "/sessions/{id}": "session",
    "/stations/{id}": "station",
    "/protocols": "protocols",
    "/devices": "devices",
    "/help": "help",
    "/account": "account",
    "/audit": "audit",
}


def page(request: Request, name: str = "missing", status: int = 200) -> Response:
    """The document; at an address that is none of ours it says so itself."""
    who: Requester = request.state.requester
    account = {"roles": sorted(who.roles), "lacks_second_factor": who.lacks_second_factor}
    modules = [f"/static/pages/{name}.js"]
    if name == "station":
        modules += [f"/static/station/{kind}.js" for kind in _kind_of_station(request)]
    return document("index.html", request.headers, tuple(modules), account, status)


def _kind_of_station(request: Request) -> Iterator[str]:
    """What static/pages/station.js imports of the two, where the station is there."""
    with suppress(InputError):
        station = station_of(request, request.path_params["id"])
        yield "replay" if isinstance(station, Replay) else "live"


def _page_of(name: str) -> Callable[[Request], Response]:
    def answer(request: Request) -> Response:
        return page(request, name)

    return answer


for address, name in PAGES.items():
    router.add_api_route(address, _page_of(name), methods=["GET"])


@router.get("/scene/", dependencies=[requires_role(CLINICIAN, SCIENTIST)])
def any_scene_page(request: Request) -> Response:
    """viser's client for the station that is named after the #: at one address, so that a browser keeps it."""
    return scene_answer(request)


@router.get("/scene/{name}/", dependencies=[requires_role(CLINICIAN, SCIENTIST)])
def station_scene_page(request: Request, _: StationDep) -> Response:
    """viser's client; it comes back for its web socket under the same address without the last slash."""
    return scene_answer(request)


def scene_answer(request: Request) -> Response:
    """viser's client with its policy; packed anew each time, 20 ms, as its nonce is another each time. A browser keeps it and asks whether it is the newest."""
    page = scene_page(request.headers["host"], request.headers.get("if-none-match", ""))
    headers = {"Content-Security-Policy": page.policy, "ETag": page.tag}
    headers |= {"Cache-Control": "private, no-cache", "Vary": "Accept-Encoding"}
    if page.html is None:
        return Response(status_code=304, headers=headers)
    if "gzip" not in request.headers.get("accept-encoding", ""):
        return Response(page.html, media_type="text/html", headers=headers)
    packed = gzip.compress(page.html, mtime=0)
    return Response(packed, media_type="text/html", headers={**headers, "Content-Encoding": "gzip"})


@router.websocket("/scene/{name}", dependencies=[requires_role(CLINICIAN, SCIENTIST)])
async def scene_socket(websocket: WebSocket, name: str) -> None:
    """The 3-D scene of a station, passed on from its own process."""
    try:
        scene = station_of(websocket, name).scene
    except InputError:
        await websocket.close(4404, "no such station")
        return
    until = time.monotonic() + OPENING
    while not scene.port and time.monotonic() < until:
        await asyncio.sleep(0.05)
    await bridge(websocket, scene.port, scene.secret)
