"""The pump between a browser and a scene: its messages on the application's own port, under its own login.

The page at `/scene/<id>/` connects to the web socket `/scene/<id>` (the address of the page without the last slash): serve both under one login.
"""

import asyncio
from contextlib import suppress

import msgspec
import viser
from starlette.websockets import WebSocket, WebSocketDisconnect
from viser import _messages as wire
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Origin, Subprotocol

from handscope.app.scene.loopback_server import HOST

PROTOCOL = Subprotocol(f"viser-v{viser.__version__}")
CAMERA = wire.ViewerCameraMessage.__name__
LARGEST_FROM_BROWSER = 1 << 20  # bytes: the camera and clicks take some hundred
GONE, WRONG_PROTOCOL, NOT_BINARY, TOO_LARGE = 1001, 1002, 1003, 1009  # close codes, RFC 6455 7.4.1


async def bridge(websocket: WebSocket, port: int, secret: str, only_looks: bool = False) -> None:
    """Carry messages between a browser and the scene at `port` until either side leaves. Login and Origin are checked before this is called.

    Of a browser that `only_looks`, only its camera is passed on, which has no effect on others. Nothing is kept here: each pump waits until the other side took a message, so a slow browser slows only its own connection.
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
