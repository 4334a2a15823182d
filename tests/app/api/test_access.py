"""Nothing without a login, nothing from another site's page, nothing under another name."""

import os
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest
from fastapi import FastAPI
from starlette.middleware import Middleware
from starlette.routing import Mount
from starlette.staticfiles import StaticFiles
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from handscope.app.auth import gate
from handscope.app.auth.gate import COOKIE, Gate, new_token
from handscope.app.auth.roles import ANYBODY, RoleRequirement, RouteTable, requires_role
from handscope.app.settings import Settings
from handscope.sessions.clinic import accounts
from handscope.sessions.db.roles import ADMINISTRATOR, ROLES
from handscope.sessions.login import logins
from handscope.sessions.store.store import open_store

ORIGIN = {"Origin": "http://127.0.0.1:8420"}
SOCKETS = "ws://127.0.0.1:8420"


@dataclass(frozen=True)
class Address:
    path: str
    methods: frozenset[str]  # empty: a web socket
    requirement: RoleRequirement | None


def addresses(server: TestClient) -> list[Address]:
    """Everything the application serves, that of included routers and of the mounted folder too."""
    found = []
    for route, declaration in RouteTable(server.app.routes).all:  # type: ignore[attr-defined]
        mounted = isinstance(route.original_route, Mount)
        methods = frozenset({"GET"} if mounted else getattr(route, "methods", None) or ())
        found.append(
            Address(
                filled(f"{route.path}/app.js" if mounted else str(route.path)), methods, declaration
            )
        )
    return found


def filled(path: str) -> str:
    return re.sub(r"\{[^}]*\}", "1", path)


def refused(server: TestClient, address: Address) -> set[int]:
    """The answers to everything the address takes; 403 of a web socket that is closed before it is open."""
    if address.methods:
        return {server.request(method, address.path).status_code for method in address.methods}
    try:
        with server.websocket_connect(SOCKETS + address.path, headers=ORIGIN) as socket:
            socket.send_text("{}")  # a relay waits for a first message
            socket.receive()  # of a station that is not there
            return {4404}
    except WebSocketDisconnect as closed:
        return {403 if closed.code == 1008 else closed.code}


def test_every_route_says_who_may_use_it(server: TestClient) -> None:
    served = addresses(server)
    assert {
        "/api/patients",
        "/api/results/1/report.1",
        "/scene/1/",
        "/static/app.js",
        "/api/openapi.json",
    } <= {a.path for a in served}
    assert {a.path for a in served if not a.methods} == {
        "/scene/1",
        "/api/stations/1/live",
        "/api/stream",
        "/api/relay",
        "/patient-view/scene",
        "/api/patient-view/live",
    }
    assert [a.path for a in served if a.requirement is None] == []
    anybody = {a.path for a in served if a.requirement and ANYBODY in a.requirement.roles}
    assert anybody == {
        "/login",
        "/login/sso",
        "/login/sso/answer",
        "/login/sso/end",
        "/api/login",
        "/api/login/second",
        "/api/login/second-factors",
        "/api/health",
        "/api/stream",  # for whoever holds a token of a stream
        "/patient-view",  # for whoever holds a code of a session
        "/api/patient-view",
        "/patient-view/scene/",
        "/patient-view/scene",
        "/api/patient-view/live",
        "/languages/names.js",
        "/languages/1.js",
    }


def test_every_route_without_a_login_is_refused(server: TestClient) -> None:
    for address in addresses(server):
        if address.requirement is None or ANYBODY not in address.requirement.roles:
            assert refused(server, address) <= {401, 403}, address


@pytest.mark.parametrize("role", ROLES)
def test_every_route_of_other_roles_is_refused_and_the_own_ones_answer(
    role: str, log_in_as: Callable[..., TestClient]
) -> None:
    client = log_in_as(role)
    for address in addresses(client):
        if address.requirement and ANYBODY not in address.requirement.roles:
            answers = refused(client, address)
            assert (answers == {403}) == (role not in address.requirement.roles), (
                role,
                address,
                answers,
            )
            assert 401 not in answers


def test_a_route_that_says_nothing_is_refused_to_everybody(tmp_path: Path) -> None:
    store, settings = open_store(tmp_path), Settings(data=tmp_path)
    app = FastAPI(
        openapi_url=None,
        docs_url=None,
        redoc_url=None,
        middleware=[Middleware(Gate, store=store, settings=settings)],
    )
    app.add_api_route("/forgotten", lambda: "secret")
    app.add_api_route("/declared", lambda: "answer", dependencies=[requires_role(*ROLES)])
    app.mount("/folder", StaticFiles(directory=tmp_path))
    with store.database() as db:
        cookie = logins.begin(db, accounts.add(db, "anna", ROLES))
    client = TestClient(app, base_url="http://127.0.0.1:8420", cookies={COOKIE: cookie})
    answers = {
        path: client.get(path).status_code
        for path in ("/forgotten", "/folder/handscope.sqlite", "/declared")
    }
    assert answers == {"/forgotten": 403, "/folder/handscope.sqlite": 403, "/declared": 200}


def test_roles_that_change_count_from_the_next_request_on(
    log_in_as: Callable[..., TestClient],
) -> None:
    client = log_in_as(*ROLES)
    assert client.get("/api/patients").status_code == 200
    with client.app.state.parts.store.database() as db:  # type: ignore[attr-defined]
        account = accounts.find_by_name(db, ".".join(ROLES))
        accounts.change(db, account, roles=[ADMINISTRATOR])
        assert client.get("/api/patients").status_code == 403
        accounts.change(db, account, disabled=True)
        assert client.get("/api/patients").status_code == 401
        accounts.change(db, account, roles=ROLES, disabled=False)


def test_a_person_without_a_login_is_shown_the_way_to_it(server: TestClient) -> None:
    answer = server.get("/", headers={"Accept": "text/html"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/login")
    assert server.get("/login").status_code == 200


def test_a_token_works_once_and_gives_a_cookie_that_scripts_cannot_read(
    server: TestClient, settings: Settings
) -> None:
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
    before = set(Path(settings.data, "tokens").iterdir())
    token = new_token(settings.data)
    (path,) = set(Path(settings.data, "tokens").iterdir()) - before
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


def test_a_pages_files_take_one_look_at_the_login_and_nothing_of_a_patient_does(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks: list[object] = []
    found = gate.find_login
    monkeypatch.setattr(gate, "find_login", lambda *given: looks.append(given[1]) or found(*given))
    files = ("/static/app.js", "/static/api.js", "/static/dom.js", "/static/app.js")
    assert [client.get(path).status_code for path in files] == [200] * 4
    assert len(looks) == 1
    cookie = str(client.cookies[COOKIE])
    assert client.get("/api/patients").status_code == 200
    assert client.delete("/api/login").status_code == 204
    client.cookies.set(COOKIE, cookie)
    assert client.get("/api/patients").status_code == 401
    much_later = time.monotonic() + 2 * gate.READS_FOR
    monkeypatch.setattr(gate, "time", SimpleNamespace(monotonic=lambda: much_later))
    assert client.get("/static/app.js").status_code == 401


def test_an_idle_login_ends(client: TestClient) -> None:
    ended({"idle": -1.0, "longest": 60.0}, client)


def test_a_login_ends_after_the_longest_time_however_busy_it_was(client: TestClient) -> None:
    ended({"idle": 60.0, "longest": -1.0}, client)


def ended(limits: dict[str, float], client: TestClient) -> None:
    store = client.app.state.parts.store  # type: ignore[attr-defined]
    with store.database() as db:
        assert logins.find_login(db, client.cookies[COOKIE], idle=60.0, longest=60.0)
        assert not logins.find_login(db, client.cookies[COOKIE], **limits)
    assert client.get("/api/patients").status_code == 401


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:9000"},  # the same site for a cookie
        {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"},
        {"Sec-Fetch-Site": "same-site", "Origin": "http://127.0.0.1:8420"},
    ],
    ids=str,
)
def test_requests_from_another_sites_page_are_refused(
    client: TestClient, headers: dict[str, str]
) -> None:
    before = client.get("/api/patients").json()
    assert client.post("/api/patients", json={"pseudonym": "x"}, headers=headers).status_code == 403
    assert (
        client.post("/api/patients", data={"pseudonym": "x"}, headers=headers).status_code == 403
    )  # a plain form
    assert client.post("/api/login", json={"token": "x"}, headers=headers).status_code == 403
    assert client.get("/api/patients").json() == before
    with (
        pytest.raises(WebSocketDisconnect),
        client.websocket_connect(SOCKETS + "/api/stations/1/live", headers=headers),
    ):
        pass


def test_a_web_socket_without_an_origin_is_refused(client: TestClient) -> None:
    with (
        pytest.raises(WebSocketDisconnect),
        client.websocket_connect(SOCKETS + "/api/stations/1/live"),
    ):
        pass


def test_another_sites_page_may_link_to_us_but_not_read_us(client: TestClient) -> None:
    followed = {
        "Sec-Fetch-Site": "cross-site",
        "Sec-Fetch-Mode": "navigate",
        "Sec-Fetch-Dest": "document",
    }
    assert client.get("/", headers=followed).status_code == 200
    for dest, mode in (
        ("script", "no-cors"),
        ("image", "no-cors"),
        ("iframe", "navigate"),
        ("empty", "cors"),
    ):
        framed = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": mode, "Sec-Fetch-Dest": dest}
        assert client.get("/api/patients", headers=framed).status_code == 403


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


@pytest.mark.parametrize("number", ["999", str(2**63), "-1"])
def test_a_number_that_nothing_has_is_refused_on_every_route(
    client: TestClient, number: str
) -> None:
    paths = [
        re.sub(r"{\w+_id}", number, path).replace("{form}", "pdf")
        for path, operations in client.app.openapi()["paths"].items()  # type: ignore[attr-defined]
        if "get" in operations and "_id}" in path
    ]
    answers = {path: client.get(path).status_code for path in paths}
    assert len(paths) > 10
    assert {p: code for p, code in answers.items() if code not in (404, 422)} == {}


def test_an_unknown_address_is_404_and_a_broken_request_says_where(client: TestClient) -> None:
    assert client.get("/nowhere").status_code == 404
    answer = client.post("/api/patients", json={"pseudonym": 5})
    assert answer.status_code == 422
    assert answer.json()["error"].startswith("pseudonym: ")
