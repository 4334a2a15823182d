"""A glove at a browser's port: what the server acknowledges is in the recording, and nobody else may send for the session."""

import json
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient, WebSocketTestSession

from handscope.app.api.live import relays as relay_routes
from handscope.app.api.live.relays import MALFORMED, REFUSED, TOO_LARGE
from handscope.app.auth.gate import new_token
from handscope.app.auth.roles import CLINICIAN
from handscope.app.devices.relay.messages import LARGEST
from handscope.app.live import relays as live_relays
from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.sessions.clinic import accounts
from handscope.sessions.db.tables import PatientSession
from handscope.sessions.files import native
from handscope.sessions.files.recorder import Recorder
from handscope.sessions.sealing.keys import VARIABLE, make_key
from handscope.sessions.sealing.stored import is_sealed
from handscope.sessions.wards import wards
from tests.glove import frames, whole_session
from tests.simulated import cut, in_strips

BASE = "http://127.0.0.1:8420"
SOCKETS = "ws://127.0.0.1:8420"
ORIGIN = {"origin": BASE}
SIZE = 500  # bytes of a message
WAIT = 60.0


@pytest.fixture(scope="module")
def pieces() -> list[bytes]:
    """What a glove sends, in messages of a browser."""
    samples = {name: cut(in_strips("left").samples[name], [100])[0] for name in ("hand", "index")}
    sent = b"".join(frames(one.message for one in whole_session(samples)))
    return [sent[k : k + SIZE] for k in range(0, len(sent), SIZE)]


@contextmanager
def served(data: Path) -> Iterator[TestClient]:
    with TestClient(create_app(Settings(data=data)), base_url=BASE) as client:
        assert client.post("/api/login", json={"token": new_token(data)}).status_code == 204
        yield client


def begun(client: TestClient) -> tuple[int, str]:
    patient = client.post("/api/patients", json={"pseudonym": f"R-{time.monotonic_ns()}"})
    new = {"hand": "left", "port": "relay://"}
    answer = client.post(f"/api/patients/{patient.json()['id']}/sessions", json=new)
    assert answer.status_code == 201, answer.text
    return answer.json()["session"], answer.json()["station"]


def token(client: TestClient, session: int) -> str:
    return str(client.post(f"/api/sessions/{session}/relays").json()["token"])


@contextmanager
def connected(
    client: TestClient, session: int, code: str | None = None
) -> Iterator[tuple[WebSocketTestSession, int]]:
    """A relay, and the number that the server expects next."""
    with client.websocket_connect(f"{SOCKETS}/api/relay", headers=ORIGIN) as socket:
        now = time.time() * 1e3
        socket.send_text(json.dumps({"token": code or token(client, session), "now": now}))
        yield socket, socket.receive_json()["number"]


def send(socket: WebSocketTestSession, pieces: list[bytes], first: int, last: int) -> None:
    for number in range(first, last):
        now = time.time() * 1e3
        socket.send_bytes(struct.pack("<Qd", number, now) + pieces[number])


def news(socket: WebSocketTestSession, wanted: Callable[[dict[str, Any]], bool]) -> None:
    while not wanted(json.loads(socket.receive().get("text") or "{}")):
        pass  # commands for the port


def until(condition: Callable[[], Any]) -> Any:
    end = time.monotonic() + WAIT
    while not (value := condition()):
        assert time.monotonic() < end
        time.sleep(0.02)
    return value


@pytest.mark.parametrize("sealed", [False, True])
def test_nothing_is_lost_where_the_server_ends_between_two_messages(
    pieces: list[bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sealed: bool
) -> None:
    if sealed:
        make_key(tmp_path / "key")
        monkeypatch.setenv(VARIABLE, str(tmp_path / "key"))
    half = len(pieces) // 2
    data = tmp_path / "data"
    with served(data) as client:
        session, _ = begun(client)
        with connected(client, session) as (socket, number):
            assert number == 0
            socket.send_json({"is_open": True})
            send(socket, pieces, 0, half)
            news(socket, lambda word: word.get("on_disk") == half)
    with served(data) as client:
        with connected(client, session) as (socket, number):
            assert number == half
            send(socket, pieces, half - 3, len(pieces))  # some of them a second time
            socket.send_json({"total": len(pieces)})
            news(socket, lambda word: word.get("on_disk") == len(pieces))
        until(lambda: client.get(f"/api/sessions/{session}").json()["state"] != "open")
    (path,) = data.rglob("*.mcap")
    assert is_sealed(path) == sealed
    recording = native.load(path)
    whole = native.load(written_at_once(pieces, tmp_path / "whole.mcap"))
    assert not recording.warnings
    assert {n: len(b.t) for n, b in recording.samples.items()} == {
        n: len(b.t) for n, b in whole.samples.items()
    }


def test_a_token_lets_in_once(client: TestClient, session: int) -> None:
    code = token(client, session)
    with connected(client, session, code) as (_, number):
        assert number == 0
    assert refusal(client, code) == REFUSED


def test_another_account_gets_no_token_and_cannot_use_one(
    client: TestClient, session: int, log_in_as: Callable[..., TestClient]
) -> None:
    code = token(client, session)
    other = log_in_as(CLINICIAN)
    assert other.post(f"/api/sessions/{session}/relays").status_code == 404
    assert refusal(other, code) == REFUSED


def test_another_login_of_the_same_account_cannot_use_a_token(
    client: TestClient, session: int
) -> None:
    code, first = token(client, session), client.cookies
    client.cookies.clear()
    folder = client.app.state.parts.store.folder  # type: ignore[attr-defined]
    assert client.post("/api/login", json={"token": new_token(folder)}).is_success
    assert client.post(f"/api/sessions/{session}/relays").is_success, "the same account"
    assert refusal(client, code) == REFUSED
    client.cookies = first


def test_a_token_that_is_too_old_lets_nobody_in(
    client: TestClient, session: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_relays, "TOKEN_LIFE", 0.0)
    code = token(client, session)
    monkeypatch.undo()
    assert refusal(client, code) == REFUSED


def test_a_patient_who_went_to_another_ward_ends_the_relay_of_who_sees_it_no_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(relay_routes, "CHECK_EVERY", 0.05)
    with served(tmp_path) as client:
        database = client.app.state.parts.store.database  # type: ignore[attr-defined]
        with database() as db:
            own, other = (wards.add(db, name).id for name in ("Hand surgery", "Neurology"))
            wards.assign(db, accounts.add(db, "anna", [CLINICIAN]), [own])
        client.cookies.clear()
        assert client.post("/api/login", json={"token": new_token(tmp_path, "anna")}).is_success
        session, _ = begun(client)
        code = token(client, session)
        with connected(client, session) as (socket, _):
            with database() as db:
                db.get_one(PatientSession, session).patient.ward_id = other
                db.commit()
            assert closing(socket) == REFUSED
        assert refusal(client, code) == REFUSED, "a token of before"
        assert client.post(f"/api/sessions/{session}/relays").status_code == 403


def test_a_session_without_a_browsers_port_has_no_relay(client: TestClient, patient: int) -> None:
    assert client.post("/api/sessions/4711/relays").status_code == 404


@pytest.mark.parametrize(
    ("message", "code"),
    [
        (struct.pack("<Qd", 0, 0.0) + bytes(LARGEST + 1), TOO_LARGE),
        (struct.pack("<Qd", 1, 0.0) + b"gap", MALFORMED),
        (struct.pack("<Qd", 0, float("nan")) + b"no time", MALFORMED),
        (b"short", MALFORMED),
    ],
    ids=["too large", "a gap", "no time", "too short"],
)
def test_what_is_no_message_closes_the_relay(
    client: TestClient, session: int, message: bytes, code: int
) -> None:
    with connected(client, session) as (socket, _):
        socket.send_bytes(message)
        assert closing(socket) == code


@pytest.mark.parametrize("words", ["[]", "{", "1" * 2000])
def test_words_that_are_none_close_the_relay(client: TestClient, session: int, words: str) -> None:
    with connected(client, session) as (socket, _):
        socket.send_text(words)
        assert closing(socket) == MALFORMED


@pytest.fixture(scope="module")
def sessions_of(server: TestClient) -> dict[str, int]:
    return {}


@pytest.fixture
def session(client: TestClient, sessions_of: dict[str, int]) -> int:
    """A session whose glove is at a browser's port; one for all tests that send nothing valid."""
    if not sessions_of:
        sessions_of["one"], _ = begun(client)
    return sessions_of["one"]


@pytest.mark.parametrize("now", ["Infinity", "NaN", "1" + 400 * "0", '"noon"', "[]"])
def test_a_clock_that_is_no_number_closes_the_relay(
    client: TestClient, session: int, now: str
) -> None:
    with client.websocket_connect(f"{SOCKETS}/api/relay", headers=ORIGIN) as socket:
        socket.send_text(f'{{"token": "{token(client, session)}", "now": {now}}}')
        assert closing(socket) == MALFORMED


def refusal(client: TestClient, code: str) -> int:
    with client.websocket_connect(f"{SOCKETS}/api/relay", headers=ORIGIN) as socket:
        socket.send_text(json.dumps({"token": code, "now": 0.0}))
        return closing(socket)


def closing(socket: WebSocketTestSession) -> int:
    """The code with which the server closes."""
    while (message := socket.receive())["type"] != "websocket.close":
        pass
    return int(message["code"])


def written_at_once(pieces: list[bytes], path: Path) -> Path:
    with Recorder(path, {"hand": "left"}, 0.0) as recorder:
        for k, piece in enumerate(pieces):
            recorder.write(piece, 0.1 * k)
    return path
