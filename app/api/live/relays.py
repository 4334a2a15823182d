"""/api/sessions/{id}/relays: a token for one connection; /api/relay: the glove at the port of a clinician's own browser

The browser's first message is JSON {"token", "now"} (its clock, ms). Then it sends binary messages (app/devices/relay/messages.py) from the number
in the answer {"number"} on, and JSON: {"is_open"} of its port, {"total"} when it has no more messages. It gets {"on_disk"}, how many messages are
on the server's disk, {"ending": true} when the session is over, and bytes for its port.
"""

import asyncio
import time
from collections.abc import Mapping
from typing import Any

import anyio.to_thread
from fastapi import APIRouter, WebSocket
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from starlette.websockets import WebSocketDisconnect, WebSocketState

from handscope.app.auth.gate import CHECK_EVERY
from handscope.app.auth.roles import CLINICIAN, RequesterDep, requester, requires_role
from handscope.app.auth.ward_access import sees_now, wait_until_hidden
from handscope.app.devices.relay.live_relay import RelayEnd
from handscope.app.devices.relay.messages import (
    MOST_WAITING,
    BrowserClock,
    MalformedError,
    Pace,
    TooLargeError,
    parse_chunk,
    parse_hello,
    parse_words,
)
from handscope.app.state import PartsDep, parts

router = APIRouter(tags=["relays"], dependencies=[requires_role(CLINICIAN)])
REFUSED, MALFORMED, TOO_LARGE, REPLACED, COMPLETE = 4401, 4400, 1009, 4409, 1000
OTHER_WARD = "the account does not see this session's patient"
HELLO_WAIT = 10.0  # s for the first message
Words = Mapping[str, Any]


@router.post("/sessions/{session_id}/relays", status_code=201)
def permit_relay(parts: PartsDep, requester: RequesterDep, session_id: int) -> dict[str, str]:
    """A token for one connection of the browser whose port the session reads; shown this once, for a minute, for this login."""
    return {"token": parts.relays.grant(session_id, requester.account, requester.login)}


@router.websocket("/relay")
async def relay(websocket: WebSocket) -> None:
    """The bytes of a browser's port, numbered; acknowledged once they are on the server's disk."""
    await websocket.accept()
    try:
        hello = parse_hello(_words(await asyncio.wait_for(websocket.receive(), HELLO_WAIT)))
        login, relays = requester(websocket).login, parts(websocket).relays
        granted = await anyio.to_thread.run_sync(relays.redeem, hello.token, login)
        if granted is None:
            await websocket.close(REFUSED, "no such relay, or its token was used")
            return
        if not await anyio.to_thread.run_sync(_is_visible, websocket, granted.session):
            await websocket.close(REFUSED, OTHER_WARD)
            return
        connection = _Connection(websocket, granted.end, hello.now)
        ending = asyncio.ensure_future(_refuse_when_hidden(websocket, connection, granted.session))
        try:
            await connection.serve()
        finally:
            ending.cancel()
    except TooLargeError:
        await _close(websocket, TOO_LARGE, "the message is too large")
    except (MalformedError, TimeoutError):
        await _close(websocket, MALFORMED, "this is no message of a relay")
    except (WebSocketDisconnect, RuntimeError):
        pass  # the browser left


def _is_visible(websocket: WebSocket, session: int) -> bool:
    """Whether the account sees the session's patient now; a database that cannot be reached withdraws nothing."""
    try:
        return sees_now(parts(websocket).store, requester(websocket).name, session)
    except (DBAPIError, PoolTimeout):
        return True


async def _refuse_when_hidden(
    websocket: WebSocket, connection: "_Connection", session: int
) -> None:
    """End the connection once the patient is in a ward that the account does not see; the gate looks after login and role."""
    store, account = parts(websocket).store, requester(websocket).name
    await wait_until_hidden(store, account, session, CHECK_EVERY)
    connection.refuse()


class _Connection:
    """One browser that is connected."""

    def __init__(self, websocket: WebSocket, end: RelayEnd, sent: float) -> None:
        self._websocket, self._end = websocket, end
        self._clock = BrowserClock(sent, time.monotonic(), end.newest)
        self._news = asyncio.Event()
        loop = asyncio.get_running_loop()
        self._notify = lambda: loop.call_soon_threadsafe(self._news.set)
        self._sizes: list[int] = []  # of the messages that are not on the disk yet
        self._total: int | None = None
        self._is_refused = False

    def refuse(self) -> None:
        """The account may not send for this session any more."""
        self._is_refused = True
        self._news.set()

    async def serve(self) -> None:
        """Until the browser leaves, another takes its place, or all has come."""
        self._end.attach(self._notify)
        reader = asyncio.ensure_future(self._read())
        reader.add_done_callback(lambda _: self._news.set())
        try:
            await self._websocket.send_json({"number": self._end.next_number})
            await self._write(reader)
        finally:
            reader.cancel()
            await asyncio.gather(reader, return_exceptions=True)
            await anyio.to_thread.run_sync(self._end.detach, self._notify)
        if reader.done() and not reader.cancelled() and (problem := reader.exception()):
            raise problem

    async def _write(self, reader: "asyncio.Future[None]") -> None:
        """Acknowledgements and commands, as they come."""
        newest: Words = {}
        while not reader.done():
            self._news.clear()
            if not self._end.is_attached(self._notify):
                await self._websocket.close(REPLACED, "another page of yours has the port")
                return
            if self._is_refused:
                await self._websocket.close(REFUSED, OTHER_WARD)
                return
            for command in self._end.commands():
                await self._websocket.send_bytes(command)
            news = {"on_disk": self._end.on_disk, "ending": self._end.is_ending}
            if news != newest:
                newest = news
                await self._websocket.send_json(news)
            if self._total is not None and news["on_disk"] >= self._total:
                await self._websocket.close(COMPLETE, "all is on the disk")
                return
            await self._news.wait()

    async def _read(self) -> None:
        pace = Pace()
        while True:
            message = await self._websocket.receive()
            if message["type"] == "websocket.disconnect":
                return
            if message.get("bytes") is None:
                await self._take_words(_words(message))
                continue
            await asyncio.sleep(pace.wait(len(message["bytes"])))
            await self._take(message["bytes"])

    async def _take_words(self, words: Words) -> None:
        if isinstance(words.get("is_open"), bool):
            await anyio.to_thread.run_sync(self._end.set_port, words["is_open"])
        if isinstance(words.get("total"), int):
            self._total = words["total"]
            await anyio.to_thread.run_sync(self._end.finish, words["total"])
            self._news.set()

    async def _take(self, message: bytes) -> None:
        """Record a message; one that was sent before is passed over, one that leaves a gap is refused."""
        chunk = parse_chunk(message)
        if chunk.number < self._end.next_number:
            return
        if chunk.number > self._end.next_number:
            raise MalformedError
        at = self._clock.arrival(chunk.time, time.monotonic())
        self._sizes.append(len(chunk.data))
        await anyio.to_thread.run_sync(self._end.take, chunk, at)
        while self._waiting_bytes() > MOST_WAITING:
            await asyncio.sleep(0.05)

    def _waiting_bytes(self) -> int:
        waiting = self._end.next_number - self._end.on_disk
        self._sizes = self._sizes[max(0, len(self._sizes) - waiting) :]
        return sum(self._sizes)


def _words(message: Any) -> Words:
    """A JSON object; MalformedError where the message is none."""
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect
    return parse_words(message.get("text"))


async def _close(websocket: WebSocket, code: int, reason: str) -> None:
    if websocket.application_state is WebSocketState.CONNECTED:
        await websocket.close(code, reason)
