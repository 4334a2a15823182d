"""What a monitoring system reads: figures that it understands, true ones, and nothing of a patient."""

import socket
import urllib.request
from contextlib import suppress
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.sessions.clinic import patients
from handscope.sessions.db.tables import PatientSession, RecordingFile, Result

parser = pytest.importorskip(
    "prometheus_client.parser",
    reason="prometheus-client is not installed: make lock, then make check",
)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def test_figures_are_served_without_a_login_on_a_port_of_their_own(tmp_path: Path) -> None:
    port = free_port()
    app = create_app(Settings(data=tmp_path, metrics=("127.0.0.1", port)))
    with TestClient(app, base_url="http://127.0.0.1:8420") as client:
        with app.state.parts.store.database() as db:
            file = RecordingFile(
                session=PatientSession(
                    patient=patients.create(db, "P-4711"), hand="left", state="recorded"
                ),
                format="native",
                file="x",
            )
            db.add(Result(recording=file, key="k", method="m2", version="1", state="failed"))
            db.commit()
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics") as answer:
            text = answer.read().decode()
        assert client.get("/metrics").status_code == 401, "the pages' own port gives them to nobody"
        assert client.get("/api/health").json()["status"] == "ok"
    found = {
        s.name: s.value
        for family in parser.text_string_to_metric_families(text)
        for s in family.samples
        if not s.labels
    }
    by_state = {
        s.labels["state"]: s.value
        for f in parser.text_string_to_metric_families(text)
        if f.name == "handscope_results"
        for s in f.samples
    }
    assert by_state == {"queued": 0.0, "running": 0.0, "failed": 1.0}
    assert found["handscope_sessions_running"] == 0.0 and found["handscope_database_up"] == 1.0
    assert (
        found["handscope_disk_free_bytes"] > 2**20
        and found["process_resident_memory_bytes"] > 2**20
    )
    assert "P-4711" not in text


def test_a_server_whose_database_is_gone_says_that_it_is_not_well(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    app = create_app(Settings(data=tmp_path))
    with TestClient(app, base_url="http://127.0.0.1:8420") as client:
        app.state.parts.store.close()
        _in_its_place(tmp_path / "handscope.sqlite")
        answer = client.get("/api/health")
        assert (answer.status_code, answer.json()["status"]) == (
            503,
            "the database is locked or does not answer",
        )
        (tmp_path / "handscope.sqlite").rmdir()


def _in_its_place(database: Path) -> None:
    """A folder where the database was; a worker that connects meanwhile makes the file once more."""
    while not database.is_dir():
        database.unlink(missing_ok=True)
        with suppress(FileExistsError):
            database.mkdir()
