"""What the application needs to serve a scene on its own port, under its own login: viser's page, its security policy, and the pump between.

The page at `/scene/<id>/` connects to the web socket `/scene/<id>` (the address of the page without the last slash): serve both under one login.
"""

import asyncio
import gzip
import re
from base64 import b64encode
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path

import msgspec
import viser
from starlette.websockets import WebSocket, WebSocketDisconnect
from viser import _messages as wire
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Origin, Subprotocol

from handscope.app.scene import viser_csp_hash
from handscope.app.scene.loopback_server import HOST

PROTOCOL = Subprotocol(f"viser-v{viser.__version__}")
CAMERA = wire.ViewerCameraMessage.__name__
LARGEST_FROM_BROWSER = 1 << 20  # bytes: the camera and clicks take some hundred
GONE, WRONG_PROTOCOL, NOT_BINARY, TOO_LARGE = 1001, 1002, 1003, 1009  # close codes, RFC 6455 7.4.1
_HEAD = """<title>Hand</title><style>
html, body { margin: 0; height: 100%; background: radial-gradient(ellipse at 50% 42%, #f7f8f9 0%, #e9edf0 62%, #dde2e7 100%); }
#root div:has(> div > [data-dock-root]), #root [data-dock-root] { background: transparent !important; }
.mantine-Paper-root, .mantine-Notifications-root, [data-portal] { display: none !important; }
</style><script>
{ // viser 1.1.1 leaves null for a node that is gone, looks for undefined, and falls over with every skinned mesh when it connects again
  let mutable;
  // and its unused splat sorter asks for eval, which the policy refuses
  addEventListener("unhandledrejection", event => { if (event.reason instanceof EvalError) event.preventDefault(); });
  // and it connects again in a window alone that has the focus, which a frame beside the wizard has not
  document.hasFocus = () => true;
  Object.defineProperty(window, "__viserMutable", { configurable: true, get: () => mutable, set(value) {
    mutable = value;
    mutable.nodeRefFromName = new Proxy(mutable.nodeRefFromName, { get: (nodes, name) => nodes[name] ?? undefined });
  } });
}
</script>"""


@cache
def client_page() -> bytes:
    """viser's page, one file without any other, its own controls and messages hidden: ours draws them."""
    return without_controls(_as_it_comes()).encode()


def without_controls(page: str) -> str:
    """viser's page with its own controls and messages hidden."""
    assert "</head>" in page
    return re.sub(r"<title>.*?</title>", "", page, count=1).replace("</head>", _HEAD + "</head>", 1)


@cache
def scripts() -> tuple[str, ...]:
    """What the policy names the page's scripts by: those that stand in it, and the program that the first of them unpacks and puts there."""
    standing = [
        found.encode()
        for found in re.findall(r"<script[^>]*>(.*?)</script>", client_page().decode(), re.DOTALL)
    ]
    return tuple(
        f"'sha256-{b64encode(sha256(script).digest()).decode()}'"
        for script in (*standing, viser_csp_hash.program(_as_it_comes()))
    )


def _as_it_comes() -> str:
    return (Path(viser.__file__).parent / "client" / "build" / "index.html").read_text(
        encoding="utf-8"
    )


@cache
def client_page_gzipped() -> bytes:
    """The same page for a client that takes gzip."""
    return gzip.compress(client_page(), 9, mtime=0)


def policy(host: str) -> str:
    """The page's Content-Security-Policy on `host` (name or address with port, as the request named it).

    It lets the page connect nowhere but to us: `?websocket=` and `?playbackPath=` in a link would otherwise have it run a stranger's scripts.
    """
    if not re.fullmatch(r"[A-Za-z0-9.\-]+(:\d+)?|\[[0-9A-Fa-f:.]+\](:\d+)?", host):
        raise ValueError(f"{host!r} is not a host name")
    rules = {
        "default-src": "'none'",
        "script-src": f"{' '.join(scripts())} 'wasm-unsafe-eval'",
        "worker-src": "blob:",
        "style-src": "'unsafe-inline'",
        "img-src": "'self' data: blob:",
        "font-src": "data:",
        "connect-src": f"'self' data: blob: ws://{host} wss://{host}",
        "frame-ancestors": "'self'",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    return "; ".join(f"{name} {value}" for name, value in rules.items())


async def bridge(websocket: WebSocket, port: int, secret: str, only_looks: bool = False) -> None:
    """Carry messages between a browser and the scene at `port` until either side leaves. Login and Origin are checked before this is called.

    Of a browser that `only_looks`, its camera alone is passed on, which nobody else sees. Nothing is kept here: each pump waits until the other side took a message, so a slow browser slows only its own connection.
    """
    if PROTOCOL not in websocket.scope.get("subprotocols", ()):
        await websocket.close(WRONG_PROTOCOL, "reload the page")
        return
    code = GONE
    try:
        async with connect(
            f"ws://{HOST}:{port}",
            subprotocols=[PROTOCOL],
            origin=Origin(secret),
            compression=None,
            max_size=None,
            ping_interval=None,
            proxy=None,  # else an http_proxy of the environment would be asked
            open_timeout=20,
            close_timeout=1,
        ) as scene:
            await websocket.accept(subprotocol=PROTOCOL)
            code = await _pump(websocket, scene, only_looks)
    except (OSError, TimeoutError, InvalidHandshake):
        pass  # the scene is closed: the page tries again until ours takes it away
    finally:
        with suppress(RuntimeError, WebSocketDisconnect):
            await websocket.close(code)


async def _pump(websocket: WebSocket, scene: ClientConnection, only_looks: bool) -> int:
    """Both directions until the first ends; the code to close the browser's side with."""
    pumps = {
        asyncio.create_task(_to_scene(websocket, scene, only_looks)),
        asyncio.create_task(_to_browser(websocket, scene)),
    }
    try:
        done, _ = await asyncio.wait(pumps, return_when=asyncio.FIRST_COMPLETED)
        return max(pump.result() for pump in done)
    finally:
        for pump in pumps:
            pump.cancel()
        await asyncio.gather(*pumps, return_exceptions=True)


async def _to_scene(websocket: WebSocket, scene: ClientConnection, only_looks: bool) -> int:
    while True:
        message = await websocket.receive()
        data = message.get("bytes")
        if message["type"] == "websocket.disconnect":
            return GONE
        if data is None:
            return NOT_BINARY
        if len(data) > LARGEST_FROM_BROWSER:
            return TOO_LARGE
        if only_looks and not is_camera(data):
            continue
        try:
            await scene.send(data)
        except ConnectionClosed:
            return GONE


def is_camera(data: bytes) -> bool:
    """Whether a browser's message says from where it looks, and nothing else."""
    try:
        message = msgspec.msgpack.decode(data)
    except msgspec.DecodeError:
        return False
    return isinstance(message, dict) and message.get("type") == CAMERA


async def _to_browser(websocket: WebSocket, scene: ClientConnection) -> int:
    with suppress(ConnectionClosed, WebSocketDisconnect, RuntimeError):
        async for data in scene:
            assert isinstance(data, bytes)
            await websocket.send_bytes(data)
    return GONE
