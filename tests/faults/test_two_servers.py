"""Two servers on one PostgreSQL database and one S3 storage; one is killed in a session: nothing is lost, and it is finished when that server is back."""

import urllib.error
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests import object_store, postgres
from tests.app.devices.virtual import virtual_glove
from tests.faults.victim import ProgramVictim, wait_for

pytestmark = [pytest.mark.slow, pytest.mark.process]
SHOWN = 1.0  # s of recording that a browser has seen before the kill
LOST = 1.0  # s at its end that a kill may cost


@pytest.fixture
def servers(tmp_path: Path) -> Iterator[tuple[ProgramVictim, ProgramVictim]]:
    with postgres.server() as url, object_store.server():
        away = f"s3://{object_store.BUCKET}/clinic"
        words = ("--database", url, "--recordings", away, "--shared")
        one, two = (
            ProgramVictim(tmp_path / name / "data", {}, *words, "--name", f"{name}.example.org")
            for name in ("one", "two")
        )
        with ExitStack() as stack:
            for server in (one, two):
                server.data.mkdir(parents=True)
                server.start()
                stack.callback(server.stop)
            yield one, two


def test_a_session_outlives_its_server_and_is_seen_by_the_other(
    servers: tuple[ProgramVictim, ProgramVictim], tmp_path: Path
) -> None:
    one, two = servers
    patient = one.call("POST", "/api/patients", {"pseudonym": "P-1"})["id"]
    assert [p["pseudonym"] for p in two.call("GET", "/api/patients")] == ["P-1"]
    with virtual_glove(tmp_path / "glove", "--strips", "index") as port:
        made = one.call(
            "POST", f"/api/patients/{patient}/sessions", {"hand": "left", "port": str(port)}
        )
        station, session = made["station"], made["session"]
        shown = wait_for(lambda: recorded(one, station) > SHOWN and recorded(one, station))
        (seen,) = two.call("GET", "/api/sessions/unfinished")
        assert (seen["id"], seen["station"]) == (session, None)
        port = one.base.rpartition(":")[2]
        assert seen["elsewhere"]["address"] == f"http://one.example.org:{port}"
        assert seen["elsewhere"]["answers"]
        with pytest.raises(urllib.error.HTTPError) as refused:
            two.call("POST", f"/api/sessions/{session}/closing")
        assert b"finish it there" in refused.value.read()
        one.kill()
    two.stop()
    two.start()
    assert [s["id"] for s in two.call("GET", "/api/sessions/unfinished")] == [session], (
        "it is not the other server's to close"
    )
    one.start()
    closed = wait_for(lambda: state_of(two, session) != "open" and visit(two, session))
    assert closed["duration"] > shown - LOST
    (file,) = closed["recordings"]
    address = f"/api/recordings/{file['id']}/file"
    whole = wait_for(lambda: in_storage(two, address))
    assert whole == one.call("GET", address) and len(whole) > 10_000
    assert two.call("GET", "/api/health")["other_servers"] == {"answer": 1, "all": 1}


def recorded(server: ProgramVictim, station: str) -> float:
    """s of the recording that a browser sees."""
    return float(server.call("GET", f"/api/stations/{station}")["glove"]["recorded"])


def visit(server: ProgramVictim, session: int) -> Any:
    return server.call("GET", f"/api/sessions/{session}")


def state_of(server: ProgramVictim, session: int) -> str:
    return str(visit(server, session)["state"])


def in_storage(server: ProgramVictim, address: str) -> Any:
    """The file, once the other server has brought it to the storage."""
    try:
        return server.call("GET", address)
    except urllib.error.HTTPError as refused:
        reason = refused.read()
    assert b"still lies at the server" in reason
    return None
