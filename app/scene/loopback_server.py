"""A viser server that only our own bridge can reach.

viser has no login and trusts every client. As it comes, any web page open in the clinician's browser may connect to it, any client may have it
open a public tunnel, and the page it serves runs whatever script a crafted link's foreign server sends. So this one listens on the loopback
interface only, asks every connection for a random word in place of the Origin no browser can send, serves no page and has no tunnel.
"""

import logging
import secrets
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from http import HTTPStatus
from typing import Any

import rich
import websockets.asyncio.server
from viser import ViserServer
from viser import _messages as wire
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

log = logging.getLogger(__name__)
HOST = "127.0.0.1"
_construction = threading.Lock()  # viser offers no way to pass options to its web socket server: they are put in while it is built, one at a time


def make_server() -> tuple[ViserServer, str]:
    """Start a server on a free port; the second value is the word a connection must give as its Origin."""
    secret = f"scene-{secrets.token_urlsafe(32)}"
    with _construction, _guarded_sockets(secret), quiet():
        server = ViserServer(host=HOST, port=0, verbose=False)
    for request in (wire.ShareUrlRequest, wire.ShareUrlDisconnect):
        server._websock_server.unregister_handler(request)
    server.gui.configure_theme(show_logo=False, show_share_button=False)
    return server, secret


def renumber(server: ViserServer) -> None:
    """Give the messages kept for late viewers low numbers again; does nothing while somebody is connected.

    A new viewer's connection counts through every number ever given, at 70 a picture and some 0.1 us each: seconds after a day.
    """
    buffer = server._websock_server._broadcast_buffer
    with buffer.buffer_lock:
        if buffer.generator_cursors:
            return
        messages = list(buffer.message_from_id.values())
        by_entity: dict[Any, set[int]] = {}
        for number, message in enumerate(messages):
            if (entity := message.entity_state_key()) is not None:
                by_entity.setdefault(entity, set()).add(number)
        buffer.message_from_id = dict(enumerate(messages))
        buffer.id_from_redundancy_key = {
            message.redundancy_key(): number for number, message in enumerate(messages)
        }
        buffer.ids_from_entity_state_key = by_entity
        buffer.message_counter = len(messages)


@contextmanager
def quiet() -> Iterator[None]:
    """Keep viser from printing its own address, which is of use to nobody, on the terminal."""
    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before


@contextmanager
def _guarded_sockets(secret: str) -> Iterator[None]:
    module = websockets.asyncio.server
    serve = module.serve
    module.serve = partial(_serve, serve, secret)  # type: ignore[misc, assignment]
    try:
        yield
    finally:
        module.serve = serve  # type: ignore[misc]


def _serve(serve: Callable[..., Any], secret: str, *args: Any, **options: Any) -> Any:
    logger = logging.getLogger("websockets.server.scene")
    logger.addFilter(_log_refusal)  # the same one again changes nothing
    return serve(
        *args, **{**options, "origins": [secret], "process_request": _no_pages, "logger": logger}
    )


def _log_refusal(record: logging.LogRecord) -> bool:
    """A stranger who is turned away is no error: one line for who debugs instead of a traceback."""
    if record.msg != "opening handshake failed":
        return True
    log.debug("refused: %s", record.exc_info[1] if record.exc_info else "")
    return False


def _no_pages(connection: ServerConnection, request: Request) -> Response | None:
    """Answer anything but a web socket with 404."""
    if request.headers.get("Upgrade", "").lower() == "websocket":
        return None
    return connection.respond(HTTPStatus.NOT_FOUND, "")
