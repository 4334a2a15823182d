"""Single faults with real processes: a recorder slower than the server's next start, another glove on the cable, browsers that are slow or dead, a clock that jumps."""

import os
import signal
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select

from handscope.sessions.db.tables import RecordingFile
from handscope.sessions.files import native
from handscope.sessions.store import records
from handscope.sessions.store.store import open_store
from tests.app.devices.virtual import virtual_glove
from tests.faults.disturbing import CLOCK, FAILS
from tests.faults.victim import Victim, wait_for


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Victim]:
    running = Victim(tmp_path / "data").start()
    yield running
    running.stop()


@pytest.fixture
def glove(tmp_path: Path) -> Iterator[Path]:
    with virtual_glove(tmp_path / "glove", "--strips", "index") as port:
        yield port


def begun(server: Victim, port: Path) -> tuple[str, int]:
    """A session whose samples flow: its station and number."""
    patient = server.call("POST", "/api/patients", {"pseudonym": f"P-{time.monotonic_ns()}"})["id"]
    made = server.call(
        "POST", f"/api/patients/{patient}/sessions", {"hand": "left", "port": str(port)}
    )
    wait_for(lambda: told(server, made["station"])["glove"]["recorded"] > 1.0)
    return made["station"], made["session"]


def told(server: Victim, station: str) -> Any:
    return server.call("GET", f"/api/stations/{station}")


def recorders(server: Victim) -> list[int]:
    """The processes that record for the server."""
    children = Path(f"/proc/{server.pid}/task/{server.pid}/children").read_text().split()
    every = [
        int(p)
        for t in Path(f"/proc/{server.pid}/task").iterdir()
        for p in (t / "children").read_text().split()
    ]
    return [
        p
        for p in {*every, *map(int, children)}
        if b"acquisition" in Path(f"/proc/{p}/cmdline").read_bytes()
    ]


@pytest.mark.slow
def test_a_recorder_that_outlives_its_server_and_slow_browsers_lose_nothing(
    server: Victim, glove: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Browsers that never read what they are sent hold nobody up; then the server dies while its recorder stands still: its file is not closed before it ends."""
    station, session = begun(server, glove)
    host, port = server.base.removeprefix("http://").split(":")
    dead = [socket.create_connection((host, int(port))) for _ in range(8)]
    for k, browser in enumerate(dead):
        path = f"/api/stations/{station}/live"
        head = [
            f"GET {path} HTTP/1.1",
            f"Host: {host}:{port}",
            f"Origin: {server.base}",
            f"Cookie: {server.cookie}",
            "Upgrade: websocket",
            "Connection: Upgrade",
        ]
        head += ["Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Version: 13", "", ""]
        browser.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        browser.sendall(
            "\r\n".join(head).encode()[: None if k else 40]
        )  # one breaks off in its first words
    shown = told(server, station)["glove"]["recorded"]
    wait_for(lambda: told(server, station)["glove"]["recorded"] > shown + 2.0)
    after = told(server, station)["glove"]
    assert after["dropped_live"] == 0 and sum(s["lost"] for s in after["strips"]) == 0
    [recorder] = recorders(server)
    os.kill(recorder, signal.SIGSTOP)
    server.kill()
    for browser in dead:
        browser.close()
    store = open_store(server.data)
    monkeypatch.setattr(records, "FINISH_WAIT", 0.3)
    with store.database() as db, pytest.raises(records.InputError, match="still being written"):
        records.close(db, store, session)
    os.kill(recorder, signal.SIGCONT)
    server.start()
    wait_for(lambda: not Path(f"/proc/{recorder}").exists())

    def closed() -> RecordingFile | None:
        """The file once the repair, which the server does beside its work, has closed it."""
        with store.database() as db:
            query = select(RecordingFile).where(RecordingFile.session_id == session)
            found = db.scalars(query).one()
        return found if found.sha256 else None

    file = wait_for(closed)
    path = store.path_of(file.file)
    assert native.file_checksum(path) == file.sha256
    recording = native.load(path)
    assert recording.duration > after["recorded"] - 1.0
    assert not any("was not closed" in w for w in recording.warnings)


def test_another_glove_on_the_cable_is_told_and_the_session_is_finished(
    server: Victim, tmp_path: Path
) -> None:
    port = tmp_path / "glove"
    with virtual_glove(port, "--strips", "index"):
        station, session = begun(server, port)
    shown = told(server, station)["glove"]["recorded"]
    with virtual_glove(port, "--strips", "index", "--seed", "7"):
        wait_for(lambda: "Another glove" in told(server, station)["glove"]["problem"])
        wait_for(lambda: told(server, station)["glove"]["recorded"] > shown + 1.0)
        server.call("DELETE", f"/api/stations/{station}")
    assert server.call("GET", f"/api/sessions/{session}")["state"] in ("recorded", "processed")
    recording = native.load(server.data / _file(server, session))
    assert recording.duration > shown, "the other glove's samples go on in time"
    assert any("another glove" in w for w in recording.warnings)


@pytest.mark.slow
def test_a_clock_that_jumps_and_a_method_that_fails_cost_no_sample(
    server: Victim, glove: Path
) -> None:
    """The hospital's time server sets the clock, two hours ahead and three back; in between the estimator crashes, says so, and goes on."""
    station, session = begun(server, glove)
    follow = lambda action: server.call(  # noqa: E731
        "POST", f"/api/stations/{station}/actions", {"action": action}
    )
    wait_for(lambda: "continue" in told(server, station)["wizard"]["actions"])
    follow("continue")
    follow("start")
    jump(server, 7200.0)
    wait_for(lambda: told(server, station)["wizard"]["state"] == "pose_review")
    assert told(server, station)["glove"]["sent"] > time.time() + 7000.0, "the clock did jump"
    follow("accept")
    wait_for(lambda: told(server, station)["glove"]["row_age_ms"] is not None)
    (server.data.parent / FAILS).touch()
    wait_for(lambda: told(server, station)["glove"]["method_failures"] > 0)
    jump(server, -3600.0)
    shown = told(server, station)["glove"]["recorded"]
    wait_for(lambda: told(server, station)["glove"]["recorded"] > shown + 0.5)
    (server.data.parent / FAILS).unlink()
    failed = told(server, station)["glove"]["row_age_ms"]
    wait_for(lambda: told(server, station)["glove"]["row_age_ms"] < failed)
    after = told(server, station)["glove"]
    assert after["recorded"] < 600.0, "the glove's time, not the wall's"
    assert sum(s["lost"] for s in after["strips"]) == 0
    server.call("DELETE", f"/api/stations/{station}")
    assert server.call("GET", f"/api/sessions/{session}")["state"] in ("recorded", "processed")
    recording = native.load(server.data / _file(server, session))
    assert after["recorded"] - 1.0 < recording.duration < after["recorded"] + 60.0
    assert not any("was not closed" in w for w in recording.warnings)


def jump(server: Victim, seconds: float) -> None:
    """The server's wall clock is off by so much from now on."""
    (server.data.parent / CLOCK).write_text(str(seconds))


def _file(server: Victim, session: int) -> str:
    with open_store(server.data).database() as db:
        return str(
            db.scalars(select(RecordingFile.file).where(RecordingFile.session_id == session)).one()
        )
