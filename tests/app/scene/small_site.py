"""A small site as the application's: a scene's page and web socket behind a cookie, on a port of its own."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import uvicorn
from fastapi import FastAPI, Request, Response, WebSocket

from handscope.app.scene import bridge
from handscope.app.scene.hand_scene import HandScene
from handscope.app.scene.viser_page import scene_page

COOKIE = {"name": "session", "value": "known"}
WAIT = 90.0  # s until a test gives up
PICTURE = (
    1.0  # s between two pictures: without a graphics card each takes half a second of both cores
)
SELDOM = f"""
  const drawn = window.requestAnimationFrame;
  window.requestAnimationFrame = (draw) => setTimeout(() => drawn(draw), {1000 * PICTURE});
  window.cancelAnimationFrame = clearTimeout;
"""


@dataclass
class Site:
    """Where it is, and which origins opened a web socket to it."""

    port: int
    sockets: list[str] = field(default_factory=list)
    path: str = "/scene/a/"

    @property
    def host(self) -> str:
        return f"127.0.0.1:{self.port}"

    @property
    def address(self) -> str:
        return f"http://{self.host}{self.path}"


@contextmanager
def site(scene: HandScene, with_policy: bool = True) -> Iterator[Site]:
    """Serve one scene; `with_policy` False leaves the Content-Security-Policy out, to see what it is good for."""
    listener = socket.create_server(("127.0.0.1", 0))
    here = Site(listener.getsockname()[1])
    server = uvicorn.Server(uvicorn.Config(_app(scene, here, with_policy), log_level="critical"))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
    thread.start()
    try:
        eventually(lambda: server.started)
        yield here
    finally:
        server.should_exit = True
        thread.join(20)
        listener.close()


def eventually(
    condition: Callable[[], object], within: float = WAIT, every: float = 0.02
) -> object:
    """Ask every so many s until the answer is true, and return it."""
    end = time.monotonic() + within
    while not (answer := condition()):
        assert time.monotonic() < end, "it never came true"
        threading.Event().wait(every)
    return answer


def _app(scene: HandScene, here: Site, with_policy: bool) -> FastAPI:
    app = FastAPI()

    @app.get(here.path)
    def page(request: Request) -> Response:
        if request.cookies.get(COOKIE["name"]) != COOKIE["value"]:
            return Response(status_code=401)
        page = scene_page(request.headers["host"])
        headers = {"Content-Security-Policy": page.policy} if with_policy else {}
        assert page.html is not None
        return Response(page.html, media_type="text/html", headers=headers)

    @app.websocket(here.path.rstrip("/"))
    async def messages(websocket: WebSocket) -> None:
        if websocket.cookies.get(COOKIE["name"]) != COOKIE["value"]:
            await websocket.close(4401)
            return
        here.sockets.append(websocket.headers.get("origin", ""))
        await bridge.bridge(websocket, scene.port, scene.secret)

    return app
