"""The pages: one document whose modules draw what the address names, their files, and the 3-D scene of a station.

Text goes out packed. A browser keeps the files, which hold nothing of a patient, and asks each time whether they are the newest.
"""

import asyncio
import gzip
import hashlib
import os
import stat
import time
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from fastapi import APIRouter, Request, WebSocket
from starlette.datastructures import Headers
from starlette.responses import FileResponse, Response
from starlette.staticfiles import NotModifiedResponse, StaticFiles
from starlette.types import Scope

from handscope import static
from handscope.app.auth.roles import (
    CLINICIAN,
    EVERY_ACCOUNT,
    SCIENTIST,
    RoleRequirement,
    requires_role,
)
from handscope.app.scene.bridge import bridge
from handscope.app.scene.viser_page import scene_page
from handscope.app.state import StationDep, station_of
from handscope.estimators.errors import InputError

router = APIRouter(include_in_schema=False, dependencies=[requires_role(*EVERY_ACCOUNT)])
STATIC = Path(static.__file__).parent
TEXT = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
ASK = "no-cache"  # keep it, and ask whether it is the newest
OPENING = 30.0  # s that a viewer waits for a scene whose process begins
PAGES = (
    "/",
    "/patients/{id}",
    "/patients/{id}/tables/{table}",
    "/sessions/{id}",
    "/stations/{id}",
    "/protocols",
    "/devices",
    "/help",
    "/account",
    "/audit",
)


class Files(StaticFiles):
    """The pages' files; those of the login page are open to anybody (auth/gate.py)."""

    requires_role = RoleRequirement(frozenset(EVERY_ACCOUNT))

    async def get_response(self, path: str, scope: Scope) -> Response:
        """As the framework answers; a text's file is looked up here, since a page has up to eighty and a thread takes longer for each than the look."""
        if Path(path).suffix in TEXT and scope["method"] in ("GET", "HEAD"):
            with suppress(OSError, ValueError):  # the framework says what is wrong with the path
                found, about = self.lookup_path(path)
                if about and stat.S_ISREG(about.st_mode):
                    return self.file_response(found, about, scope)
        return await super().get_response(path, scope)

    def file_response(
        self,
        full_path: str | os.PathLike[str],
        stat_result: os.stat_result,
        scope: Scope,
        status_code: int = 200,
    ) -> Response:
        """As the framework answers with a file; text is packed."""
        path, headers = Path(full_path), Headers(scope=scope)
        if path.suffix in TEXT and status_code == 200:
            return text_answer(_text_of(path, stat_result.st_mtime_ns), path.suffix, headers)
        response = super().file_response(full_path, stat_result, scope, status_code)
        response.headers["Cache-Control"] = ASK
        return response


def text_answer(text: bytes, suffix: str, request: Headers) -> Response:
    """A text that holds nothing of a patient, packed where the browser can unpack it; nothing where its copy is the newest."""
    packed, tag = _compress(text)
    headers = {"ETag": tag, "Cache-Control": ASK, "Vary": "Accept-Encoding"}
    if tag in request.get("if-none-match", ""):
        return NotModifiedResponse(Headers(headers))
    if "gzip" not in request.get("accept-encoding", ""):
        return Response(text, media_type=TEXT[suffix], headers=headers)
    headers["Content-Encoding"] = "gzip"
    return Response(packed, media_type=TEXT[suffix], headers=headers)


@lru_cache(maxsize=512)
def _text_of(path: Path, changed: int) -> bytes:
    return path.read_bytes()


@lru_cache(maxsize=512)
def _compress(text: bytes) -> tuple[bytes, str]:
    """The text packed, and its tag."""
    return gzip.compress(text, 9, mtime=0), f'"{hashlib.sha256(text).hexdigest()[:32]}"'


def page(status: int = 200) -> FileResponse:
    """The document; at an address that is none of ours it says so itself."""
    return FileResponse(STATIC / "index.html", status)


def _page() -> FileResponse:
    return page()


for address in PAGES:
    router.add_api_route(address, _page, methods=["GET"])


@router.get("/scene/{name}/", dependencies=[requires_role(CLINICIAN, SCIENTIST)])
def station_scene_page(request: Request, _: StationDep) -> Response:
    """viser's client; it comes back for its web socket under the same address without the last slash."""
    return scene_answer(request)


def scene_answer(request: Request) -> Response:
    """viser's client with its policy; packed anew each time, 20 ms, as its nonce is another each time."""
    page = scene_page(request.headers["host"])
    headers = {"Content-Security-Policy": page.policy}
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
