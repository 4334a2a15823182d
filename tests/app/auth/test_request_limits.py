"""Bodies, senders and connections that ask too much, against a server that listens."""

import asyncio
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import closing, suppress

import pytest
import uvicorn
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.routing import Route

from handscope.app.auth import request_limits
from handscope.app.auth.request_limits import BoundedProtocol, RequestLimits

UPLOAD = "/api/patients/1/recordings"


NOT_FOUND = "/api/nothing"


async def _length(request: Request) -> JSONResponse:
    return JSONResponse({"length": len(await request.body())})


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A server of one route that reads the body, small limits, patience of 0.3 s."""
    monkeypatch.setattr(request_limits, "SMALL", 1000)
    monkeypatch.setattr(request_limits, "PATIENCE", 0.3)
    app = Starlette(
        routes=[Route(path, _length, methods=["POST"]) for path in ("/api/login", UPLOAD)],
        middleware=[Middleware(RequestLimits, largest_upload=100_000)],
    )
    server = uvicorn.Server(uvicorn.Config(app, http=BoundedProtocol, log_level="critical"))
    listener = socket.create_server(("127.0.0.1", 0))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
    thread.start()
    yield listener.getsockname()[1]
    server.should_exit = True
    thread.join()


def _head(path: str, *lines: str) -> bytes:
    return "\r\n".join([f"POST {path} HTTP/1.1", "Host: x", *lines, "", ""]).encode()


def _chunked(path: str, chunks: int) -> bytes:
    piece = b"3e8\r\n" + b"x" * 1000 + b"\r\n"
    return _head(path, "Transfer-Encoding: chunked") + chunks * piece + b"0\r\n\r\n"


def _answer(port: int, *sent: bytes) -> bytes:
    """All that the server answers until it closes the connection, or has answered whole."""
    with closing(socket.create_connection(("127.0.0.1", port), timeout=10)) as connection:
        for part in sent:
            connection.sendall(part)
        return _read(connection)


def _read(connection: socket.socket) -> bytes:
    answer = b""
    with suppress(ConnectionResetError):  # the server closed while there was more to send
        while not answer.endswith(b"}") and (piece := connection.recv(65536)):
            answer += piece
    return answer


def test_a_body_beyond_its_routes_limit_is_refused_announced_or_not(port: int) -> None:
    announced = _answer(port, _head("/api/login", "Content-Length: 400000000"))
    assert announced.startswith(b"HTTP/1.1 413") and b"nothing was stored" in announced
    assert _answer(port, _chunked("/api/login", 5)).startswith(b"HTTP/1.1 413")
    assert b'"length":1000' in _answer(port, _chunked("/api/login", 1))
    assert b'"length":50000' in _answer(port, _chunked(UPLOAD, 50))
    refused = _answer(port, _chunked(UPLOAD, 200))
    assert refused == b"" or refused.startswith(b"HTTP/1.1 413")


def test_who_stops_sending_is_cut(port: int) -> None:
    half_a_body = _answer(port, _head("/api/login", "Content-Length: 100"), b"x")
    assert half_a_body.startswith(b"HTTP/1.1 408")
    assert _answer(port, b"POST /api/login HTT") == b""  # closed: there is no request to answer


def _refused_early(port: int) -> socket.socket:
    """A connection whose request is answered; the chunked body is still to come."""
    connection = socket.create_connection(("127.0.0.1", port), timeout=10)
    connection.sendall(_head(NOT_FOUND, "Transfer-Encoding: chunked"))
    answer = b""
    while not answer.endswith(b"Not Found"):
        answer += connection.recv(65536)
    return connection


@pytest.mark.parametrize(("size", "pause"), [(1, 0.05), (1000, 0.0)])
def test_who_was_refused_may_not_send_the_body_without_end(
    port: int, size: int, pause: float
) -> None:
    """A byte now and then, or as fast as it goes."""
    chunk = f"{size:x}\r\n".encode() + bytes(size) + b"\r\n"
    with closing(_refused_early(port)) as connection:
        assert not _may_send(connection, chunk, 100 if pause else 100_000, pause)


def _may_send(connection: socket.socket, piece: bytes, times: int, pause: float) -> bool:
    """Whether the server took them all."""
    try:
        for _ in range(times):
            connection.sendall(piece)
            time.sleep(pause)
    except (BrokenPipeError, ConnectionResetError):
        return False
    return True


def test_a_refused_body_that_ends_costs_no_connection(port: int) -> None:
    with closing(_refused_early(port)) as connection:
        connection.sendall(b"1\r\nx\r\n0\r\n\r\n" + _head("/api/login", "Content-Length: 0"))
        assert b'"length":0' in _read(connection)


def test_the_head_of_a_later_request_has_to_come_as_well(port: int) -> None:
    whole = _head("/api/login", "Content-Length: 1") + b"x"
    with closing(socket.create_connection(("127.0.0.1", port), timeout=10)) as connection:
        connection.sendall(whole)
        assert b'"length":1' in _read(connection)
        connection.sendall(b"POST /api/login HTT")
        assert connection.recv(65536) == b""


def test_connections_of_one_address_are_bounded(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(request_limits, "MOST_CONNECTIONS", 3)
    many = [socket.create_connection(("127.0.0.1", port), timeout=10) for _ in range(4)]
    assert many[0].recv(1) == b"", "the oldest that has sent nothing made room"
    many[-1].sendall(_head("/api/login", "Content-Length: 0"))
    assert b'"length":0' in _read(many[-1])
    for connection in many:
        connection.close()


def test_half_sent_requests_make_room_for_whole_ones(
    port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(request_limits, "MOST_CONNECTIONS", 4)
    monkeypatch.setattr(request_limits, "MOST_AT_ONCE", 2)
    monkeypatch.setattr(request_limits, "PATIENCE", 5.0)
    half = [b"POST /api/lo", _head("/api/login", "Content-Length: 100") + b"x"]
    many = [socket.create_connection(("127.0.0.1", port), timeout=10) for _ in range(8)]
    for k, connection in enumerate(many):
        with suppress(OSError):
            connection.sendall(half[k % 2])
    whole = _head("/api/login", "Content-Length: 1") + b"x"
    for _ in range(3):
        assert b'"length":1' in _answer(port, whole)
    for connection in many:
        connection.close()


def test_an_address_that_asks_without_end_is_told_to_wait() -> None:
    statuses = asyncio.run(_statuses(int(request_limits.BURST) + 100))
    assert statuses[: int(request_limits.BURST)] == [200] * int(request_limits.BURST)
    assert 429 in statuses


async def _statuses(requests: int) -> list[int]:
    """Of so many requests in a row, without a server."""
    limits, statuses = RequestLimits(JSONResponse({}), largest_upload=1), list[int]()

    async def send(message: dict[str, int]) -> None:
        if "status" in message:
            statuses.append(message["status"])

    async def receive() -> dict[str, object]:
        return {"type": "http.request", "body": b""}

    scope = {"type": "http", "path": "/", "headers": [], "client": ("192.0.2.1", 1)}
    for _ in range(requests):
        await limits(scope, receive, send)  # type: ignore[arg-type]
    return statuses
