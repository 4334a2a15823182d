"""How much, how slowly and how often anybody may send: before a login is looked at, and while a body is read.

Every body has a limit by its route, enforced on the bytes as they come, whether their length was announced or not. A body must keep
coming: who sends slower than SLOWEST, or stops, is cut. Requests of one address at a time, and in a row, are bounded. A connection that
does not finish the head of its request is closed; where an address has too many, the oldest half-sent request makes room.
"""

import asyncio
import re
import time
from collections import Counter, OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import h11
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from handscope.estimators.messages.sentence import phrase

SMALL = 1 << 20  # bytes of a body that is no upload: the largest form of the pages has some 20 kB
LANDMARKS = 64 << 20  # bytes of a camera's landmarks: some 20 minutes at 30 Hz
FORM = 1 << 16  # bytes that a form with a file has besides the file
UPLOADS = re.compile(r"/api/patients/\d+/(recordings|tables|photographs|photographs/landmarks)")
LANDMARK_UPLOADS = re.compile(r"/api/results/\d+/landmark-comparisons")
PATIENCE = 10.0  # s that may pass without a byte
SLOWEST = 16_000.0  # bytes/s on average after PATIENCE: GPRS
MOST_AT_ONCE = 64  # requests of one address whose answers are not finished
# requests in a row, and a second, of one address: a ward behind one address among them
BURST, REFILL = 400.0, 100.0
MOST_ADDRESSES = 4096  # whose requests are counted
MOST_CONNECTIONS = 256  # of one address: browsers open six, and a web socket for every view
TOO_SLOW = phrase("gate.request_stopped")
TOO_MANY = phrase("gate.too_many_requests")


@dataclass
class _Allowance:
    """Requests that an address may still make (token bucket)."""

    left: float = BURST
    since: float = field(default_factory=time.monotonic)

    def take(self, now: float) -> bool:
        self.left = min(BURST, self.left + REFILL * (now - self.since))
        self.since = now
        self.left -= 1.0
        return self.left >= 0.0


class RequestLimits:
    """ASGI middleware, outside of the gate; `largest_upload` in bytes."""

    def __init__(self, app: ASGIApp, largest_upload: int) -> None:
        self._app, self._largest_upload = app, largest_upload
        self._open: Counter[str] = Counter()
        self._allowances: OrderedDict[str, _Allowance] = OrderedDict()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        address = scope["client"][0] if scope.get("client") else ""
        if self._open[address] >= MOST_AT_ONCE or not self._allowance(address).take(
            time.monotonic()
        ):
            await _refuse(429, TOO_MANY, scope, receive, send)
            return
        limit = self._limit(scope)
        if _declared_length(scope) > limit:
            await _refuse(413, _words(limit), scope, receive, send)
            return
        with _Counted(self._open, address) as counted:
            if not _has_body(scope):
                counted.begin()
            await self._app(scope, _limit_body(receive, limit, counted.begin), send)

    def _limit(self, scope: Scope) -> int:
        if LANDMARK_UPLOADS.fullmatch(scope["path"]):
            return min(self._largest_upload, LANDMARKS) + FORM
        return self._largest_upload + FORM if UPLOADS.fullmatch(scope["path"]) else SMALL

    def _allowance(self, address: str) -> _Allowance:
        allowance = self._allowances.setdefault(address, _Allowance())
        self._allowances.move_to_end(address)
        if len(self._allowances) > MOST_ADDRESSES:
            self._allowances.popitem(last=False)
        return allowance


class _Counted:
    """A request among those of its address, from the moment at which it is there whole: half-sent ones keep nobody else out."""

    def __init__(self, open_requests: Counter[str], address: str) -> None:
        self._open, self._address, self._began = open_requests, address, False

    def __enter__(self) -> "_Counted":
        return self

    def begin(self) -> None:
        if not self._began:
            self._began = True
            self._open[self._address] += 1

    def __exit__(self, *_: object) -> None:
        if self._began:
            self._open[self._address] -= 1
            if not self._open[self._address]:
                del self._open[self._address]


def _has_body(scope: Scope) -> bool:
    names = {name for name, _ in scope["headers"]}
    return _declared_length(scope) > 0 or b"transfer-encoding" in names


def _declared_length(scope: Scope) -> int:
    """The body's length as its header says; 0 where it does not."""
    word = dict(scope["headers"]).get(b"content-length", b"0")
    return int(word) if word.isdigit() else 0


def _words(limit: int) -> str:
    return phrase("gate.request_too_large", limit=limit / 2**20)


def _limit_body(receive: Receive, limit: int, when_whole: Callable[[], None]) -> Receive:
    """The body as it comes; HTTPException where it grows beyond the limit or comes too slowly."""
    total, complete, began = 0, False, time.monotonic()

    async def read() -> Message:
        nonlocal total, complete
        if complete:  # what follows is the end of the connection: nobody hurries it
            return await receive()
        try:
            async with asyncio.timeout(PATIENCE):
                message = await receive()
        except TimeoutError:
            raise HTTPException(408, TOO_SLOW, {"Connection": "close"}) from None
        total += len(message.get("body", b""))
        complete = message["type"] != "http.request" or not message.get("more_body", False)
        if complete:
            when_whole()
        if total > limit:
            raise HTTPException(413, _words(limit), {"Connection": "close"})
        if not complete and time.monotonic() - began > PATIENCE + total / SLOWEST:
            raise HTTPException(408, TOO_SLOW, {"Connection": "close"})
        return message

    return read


async def _refuse(status: int, words: str, scope: Scope, receive: Receive, send: Send) -> None:
    await JSONResponse({"error": words}, status, {"Connection": "close"})(scope, receive, send)


class BoundedProtocol(H11Protocol):  # type: ignore[misc]  # mypy does not follow uvicorn
    """HTTP/1.1 whose connections are bounded for each address, and closed where the head of a request, or the rest of an answered one, does not arrive in time."""

    _of_address: ClassVar[dict[str, dict["BoundedProtocol", None]]] = {}  # the oldest first

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        self._address = self.client[0] if self.client else ""
        self._deadline: asyncio.TimerHandle | None = None
        self._unread = 0  # bytes that came after the answer to their request
        self._set_deadline(True)
        others = self._of_address.setdefault(self._address, {})
        if len(others) >= MOST_CONNECTIONS:
            unfinished = (one for one in others if one.sends_half)
            next(unfinished, self).transport.abort()
        others[self] = None

    @property
    def sends_half(self) -> bool:
        """Whether it keeps a request that is not there whole: such a connection makes room for a new one."""
        return self._deadline is not None or self.conn.their_state is h11.SEND_BODY

    def data_received(self, data: bytes) -> None:
        self._unread = self._unread + len(data) if self._is_answered_early else 0
        super().data_received(data)
        self._set_deadline(self._is_unfinished)
        if self._unread > SMALL:
            self.transport.abort()

    def on_response_complete(self) -> None:
        super().on_response_complete()
        self._set_deadline(self._is_unfinished)

    @property
    def _is_unfinished(self) -> bool:
        return self._has_half_a_head or self._is_answered_early

    @property
    def _has_half_a_head(self) -> bool:
        return self.conn.their_state is h11.IDLE and bool(self.conn.trailing_data[0])

    @property
    def _is_answered_early(self) -> bool:
        """Whether the rest of a body still comes that nobody reads any more: its request is answered."""
        return self.conn.their_state is h11.SEND_BODY and self.conn.our_state is h11.DONE

    def connection_lost(self, exc: Exception | None) -> None:
        self._leave()
        super().connection_lost(exc)

    def handle_websocket_upgrade(self, event: Any) -> None:
        self._leave()  # a web socket has a login, and limits of its own
        super().handle_websocket_upgrade(event)

    def _set_deadline(self, unfinished: bool) -> None:
        """Close the connection after PATIENCE unless what it has not finished is complete by then."""
        if unfinished and self._deadline is None:
            self._deadline = asyncio.get_running_loop().call_later(PATIENCE, self.transport.abort)
        elif not unfinished and self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _leave(self) -> None:
        self._set_deadline(False)
        others = self._of_address.get(self._address, {})
        others.pop(self, None)
        if not others:
            self._of_address.pop(self._address, None)
