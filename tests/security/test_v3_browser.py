"""ASVS 5, 3.4: every answer says what a browser may do with it, refusals and failures too."""

import socket

import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient

from handscope.app.api import errors
from tests.faults.victim import Victim

WANTED = ("content-security-policy", "x-content-type-options", "referrer-policy", "cache-control")
REQUESTS = {
    "too large a body": "POST /api/login HTTP/1.1\r\nHost: HOST\r\nContent-Length: 400000000\r\n",
    "an address with a control character": "GET /api/patients/%00 HTTP/1.1\r\nHost: HOST\r\n",
    "another host": "GET /api/health HTTP/1.1\r\nHost: elsewhere.example\r\n",
    "no login": "GET /api/patients HTTP/1.1\r\nHost: HOST\r\n",
    "nothing there": "GET /static/login/nothing.js HTTP/1.1\r\nHost: HOST\r\n",
    "the login page": "GET /login HTTP/1.1\r\nHost: HOST\r\n",
}


@pytest.mark.parametrize("what", REQUESTS)
def test_every_answer_has_the_headers(victim: Victim, what: str) -> None:
    host = victim.base.removeprefix("http://")
    address, port = host.split(":")
    request = REQUESTS[what].replace("HOST", host) + "Connection: close\r\n\r\n"
    answer = b""
    with socket.create_connection((address, int(port)), timeout=30) as connection:
        connection.sendall(request.encode())
        while b"\r\n\r\n" not in answer and (piece := connection.recv(65536)):
            answer += piece
    head = answer.partition(b"\r\n\r\n")[0].decode("latin-1").lower()
    assert [name for name in WANTED if f"\r\n{name}:" not in head] == []


def test_the_answer_to_a_bug_has_them_too() -> None:
    app = FastAPI()
    errors.install(app)
    app.add_api_route("/", lambda: 1 / 0)
    answer = TestClient(app, raise_server_exceptions=False).get("/")
    assert answer.status_code == 500
    assert [name for name in WANTED if name not in answer.headers] == []
