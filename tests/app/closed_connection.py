"""A request whose sender closes the connection before it is answered, which a test client cannot do."""

from collections.abc import Callable, Sequence
from typing import Any

import anyio
from starlette.testclient import TestClient


def status_of(
    client: TestClient,
    method: str,
    path: str,
    query: bytes = b"",
    headers: Sequence[tuple[bytes, bytes]] = (),
    body: bytes = b"",
    left: Callable[[], bool] = lambda: True,
) -> int | None:
    """The status of the answer, None where there is none; with the client's cookies, the body the first part of a longer one, gone as soon as `left`."""
    cookies = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": method,
        "scheme": "http",
        "path": path,
        "raw_path": path.encode(),
        "query_string": query,
        "headers": [(b"host", b"127.0.0.1:8420"), (b"cookie", cookies.encode()), *headers],
        "client": ("127.0.0.1", 50000),
        "server": ("127.0.0.1", 8420),
        "state": {},
    }
    sent: list[dict[str, Any]] = []
    parts = [{"type": "http.request", "body": body, "more_body": True}] if body else []

    async def receive() -> dict[str, Any]:
        if parts:
            return parts.pop()
        if not left():
            await anyio.sleep_forever()
        return {"type": "http.disconnect"}

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    assert client.portal is not None
    client.portal.call(client.app, scope, receive, send)  # type: ignore[arg-type]
    return sent[0]["status"] if sent else None
