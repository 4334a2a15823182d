"""A real server and a virtual glove as processes, and the little of HTTP that benchmarks need."""

import json
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.error import HTTPError

WAIT = 120.0  # s for anything to happen: a busy machine takes its time


class Client:
    """A logged-in client of a server, from the address that it printed."""

    def __init__(self, address: str) -> None:
        self.base, token = address.split("/login?token=")
        request = urllib.request.Request(
            f"{self.base}/api/login",
            json.dumps({"token": token}).encode(),
            {"Content-Type": "application/json"},
        )
        with urllib.request.urlopen(request) as answer:
            self.cookie = str(answer.headers["Set-Cookie"]).split(";")[0]

    def call(self, method: str, path: str, body: Any = None) -> Any:
        """Parsed JSON of the answer."""
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(
            self.base + path,
            data,
            {"Cookie": self.cookie, "Content-Type": "application/json"},
            method=method,
        )
        with urllib.request.urlopen(request) as answer:
            text = answer.read()
        return json.loads(text) if text else None


@contextmanager
def server(data: Path, *words: str) -> Iterator[tuple[str, int]]:
    """A server on a free port: its one-time address and its process."""
    command = [
        sys.executable,
        "-P",
        "-m",
        "handscope.app.cli",
        "serve",
        "--print-login",
        "--port",
        "0",
        "--data",
        str(data),
        *words,
    ]
    with _running(command) as process:
        assert process.stdout is not None
        line = next(line for line in process.stdout if "/login?token=" in line)
        yield line.split()[-1], process.pid


@contextmanager
def glove(path: Path, *words: str) -> Iterator[None]:
    """A virtual glove at `path`."""
    with _running(
        [sys.executable, "-P", "-m", "handscope.app.cli", "glove", "--pty", str(path), *words]
    ):
        wait_for(path.is_symlink)
        yield


def wait_for(condition: Callable[[], Any]) -> Any:
    """The condition's value as soon as it is true; TimeoutError after WAIT."""
    until = time.monotonic() + WAIT
    while not (value := condition()):
        if time.monotonic() > until:
            raise TimeoutError("nothing happened")
        time.sleep(0.02)
    return value


def begin_tasks(client: Client, port: Path, hand: str = "left") -> str:
    """A new patient's session led through connect and pose; the station's name."""
    patient = client.call("POST", "/api/patients", {"pseudonym": f"bench {time.monotonic_ns()}"})
    station = str(
        client.call(
            "POST", f"/api/patients/{patient['id']}/sessions", {"hand": hand, "port": str(port)}
        )["station"]
    )

    def state(wanted: Sequence[str]) -> Callable[[], bool]:
        return lambda: client.call("GET", f"/api/stations/{station}")["wizard"]["state"] in wanted

    wait_for(lambda: _is_taken(client, station, "continue"))
    wait_for(lambda: _is_taken(client, station, "start"))
    wait_for(state(["pose_review"]))
    act(client, station, "accept")
    return station


def act(client: Client, station: str, action: str, **more: Any) -> None:
    """Take an action at a station, as a page does."""
    client.call("POST", f"/api/stations/{station}/actions", {"action": action, **more})


def _is_taken(client: Client, station: str, action: str) -> bool:
    """Take an action if it is possible now: on a busy machine samples may pause."""
    try:
        act(client, station, action)
    except HTTPError as refusal:
        if refusal.code != HTTPStatus.UNPROCESSABLE_ENTITY:
            raise
        return False
    return True


@contextmanager
def _running(command: list[str]) -> "Iterator[subprocess.Popen[str]]":
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if process.stdout is not None:
            process.stdout.close()
