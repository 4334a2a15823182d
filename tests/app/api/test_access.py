"""Nothing without a login, nothing from another site's page, nothing under another name."""

import os
import re
from dataclasses import dataclass
from pathlib import Path

import pytest
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from app.api import access
from app.api.access import COOKIE, OPEN_FOLDERS, OPEN_PATHS, new_token
from app.settings import Settings

ORIGIN = {"Origin": "http://127.0.0.1:8420"}
SOCKETS = "ws://127.0.0.1:8420"


@dataclass(frozen=True)
class Address:
    path: str
    methods: frozenset[str]  # empty: a web socket


def addresses(server: TestClient) -> list[Address]:
    """Everything the application serves, that of included routers too."""
    found = []
    for route in server.app.routes:  # type: ignore[attr-defined]
        if isinstance(route, Mount):
            found.append(Address(f"{route.path}/app.js", frozenset({"GET"})))
        elif isinstance(route, Route):
            found.append(Address(route.path, frozenset(route.methods or ())))
        else:
            prefix = route.include_context.prefix if hasattr(route, "include_context") else ""
            for inner in route.effective_route_contexts():
                web_socket = isinstance(inner.original_route, WebSocketRoute) or "WebSocket" in type(inner.original_route).__name__
                path = getattr(inner, "path", None) or prefix + inner.original_route.path
                found.append(Address(path, frozenset() if web_socket else frozenset(inner.methods)))
    return found


def filled(path: str) -> str:
    return re.sub(r"\{[^}]*\}", "1", path)


def test_every_route_without_a_login_is_refused(server: TestClient) -> None:
    served = addresses(server)
    assert {"/api/patients", "/api/results/{result_id}/report.{form}", "/scene/{name}/", "/static/app.js", "/api/openapi.json"} <= {
        a.path for a in served
    }
    assert {"/scene/{name}", "/api/stations/{name}/live"} == {a.path for a in served if not a.methods}
    for address in served:
        path = filled(address.path)
        if not address.methods:
            with pytest.raises(WebSocketDisconnect), server.websocket_connect(SOCKETS + path, headers=ORIGIN):
                pass
        elif path not in OPEN_PATHS and not path.startswith(OPEN_FOLDERS):
            for method in address.methods:
                assert server.request(method, path).status_code == 401, (method, path)


def test_a_person_without_a_login_is_shown_the_way_to_it(server: TestClient) -> None:
    answer = server.get("/", headers={"Accept": "text/html"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/login")
    assert server.get("/login").status_code == 200


def test_a_token_works_once_and_gives_a_cookie_that_scripts_cannot_read(server: TestClient, settings: Settings) -> None:
    token = new_token(settings.data)
    answer = server.get(f"/login?token={token}")
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"]
    assert cookie.startswith(f"{COOKIE}=")
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    server.cookies.clear()
    again = server.get(f"/login?token={token}")
    assert again.status_code == 401
    assert "set-cookie" not in again.headers


def test_a_wrong_or_old_token_is_refused(server: TestClient, settings: Settings) -> None:
    answer = server.post("/api/login", json={"token": "wrong"})
    assert answer.status_code == 422
    assert "print a new one" in answer.json()["error"]
    for hostile in ("../handscope.sqlite", "", "x" * 200, "\0"):
        assert server.post("/api/login", json={"token": hostile}).status_code == 422
    token = new_token(settings.data)
    path = next(Path(settings.data, "tokens").iterdir())
    os.utime(path, (0, 0))
    assert server.post("/api/login", json={"token": token}).status_code == 422


def test_tokens_can_be_read_by_the_user_only(settings: Settings) -> None:
    new_token(settings.data)
    folder = Path(settings.data, "tokens")
    assert folder.stat().st_mode & 0o077 == 0
    assert all(p.stat().st_mode & 0o077 == 0 for p in folder.iterdir())


def test_logging_out_ends_the_login(client: TestClient) -> None:
    cookie = client.cookies[COOKIE]
    assert client.get("/api/patients").status_code == 200
    assert client.delete("/api/login").status_code == 204
    client.cookies.set(COOKIE, cookie)
    assert client.get("/api/patients").status_code == 401


def test_an_idle_login_ends(client: TestClient, settings: Settings) -> None:
    store = client.app.state.parts.store  # type: ignore[attr-defined]
    with store.database() as db:
        assert access.logged_in(db, client.cookies[COOKIE], idle=60.0)
        assert not access.logged_in(db, client.cookies[COOKIE], idle=-1.0)
    assert client.get("/api/patients").status_code == 401


def test_requests_from_another_sites_page_are_refused(client: TestClient) -> None:
    evil = {"Origin": "http://evil.example"}
    assert client.post("/api/patients", json={"pseudonym": "x"}, headers=evil).status_code == 403
    with pytest.raises(WebSocketDisconnect), client.websocket_connect(SOCKETS + "/api/stations/1/live", headers=evil):
        pass
    with pytest.raises(WebSocketDisconnect), client.websocket_connect(SOCKETS + "/api/stations/1/live"):
        pass  # no Origin at all: not a browser's page


def test_another_name_for_the_server_is_refused(client: TestClient) -> None:
    answer = client.get("/api/patients", headers={"Host": "evil.example:8420"})
    assert answer.status_code == 421
    assert client.get("/api/patients", headers={"Host": "localhost:8420"}).status_code == 200


def test_every_answer_carries_the_security_headers(client: TestClient) -> None:
    for path in ("/", "/api/patients", "/nowhere", "/login", "/static/colors.css"):
        headers = client.get(path).headers
        assert "default-src 'none'" in headers["content-security-policy"]
        assert "'unsafe" not in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["x-frame-options"] == "SAMEORIGIN"


def test_an_unknown_address_is_404_and_a_broken_request_says_where(client: TestClient) -> None:
    assert client.get("/nowhere").status_code == 404
    answer = client.post("/api/patients", json={"pseudonym": 5})
    assert answer.status_code == 422
    assert answer.json()["error"].startswith("pseudonym: ")
