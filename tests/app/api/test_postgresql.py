"""The server on a real PostgreSQL: from a patient to a result, two writers at once, a patient erased; where none is installed this is skipped."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from sqlalchemy import create_engine
from starlette.testclient import TestClient

from handscope.app.auth.gate import new_token
from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.sessions.clinic import patients
from handscope.sessions.db.conflicts import ConflictError
from handscope.sessions.motion_bids import writer
from handscope.sessions.store.database import open_database
from tests import postgres
from tests.app.api.test_recordings import upload
from tests.app.devices.virtual import wait_for
from tests.simulated import loaded, pose_and_wiggle


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    with postgres.server() as server, postgres.empty_database(server) as database:
        yield database


def test_from_a_patient_to_a_result_and_erased(url: str, tmp_path: Path) -> None:
    with ThreadPoolExecutor(
        3
    ) as several:  # processes that open a new database at once: one brings it up to date
        for made in several.map(lambda _: open_database(tmp_path, url), range(3)):
            made.kw["bind"].dispose()
    app = create_app(Settings(data=tmp_path, database_url=url))
    with TestClient(app, base_url="http://127.0.0.1:8420") as client:
        client.post("/api/login", json={"token": new_token(tmp_path)})
        patient = client.post("/api/patients", json={"pseudonym": "PÜ-1"}).json()["id"]
        packed = writer.pack(writer.tree(loaded(pose_and_wiggle("left")), "01", "wiggle"))
        made = upload(client, patient, packed).json()
        told = wait_for(
            lambda: (
                (r := client.get(f"/api/results/{made['result']}").json())["state"]
                in ("done", "failed")
                and r
            )
        )
        assert (told["state"], told["error"]) == ("done", "") and told["figures"]
        assert client.get("/api/patients?search=pü-1").json()[0]["pseudonym"] == "PÜ-1", (
            "letters of either case are found"
        )
        assert client.get(f"/api/patients/{2**40}").status_code == 404
        assert client.get(f"/api/patients/{patient}/progress").status_code == 200
        with app.state.parts.store.database() as one, app.state.parts.store.database() as other:
            first, second = patients.get(one, patient), patients.get(other, patient)
            patients.change(one, patient, first.version, year_of_birth=1950)
            with pytest.raises(ConflictError):
                patients.change(other, patient, second.version, year_of_birth=1951)
        assert (
            client.post(f"/api/patients/{patient}/erasure", json={"pseudonym": "PÜ-1"}).status_code
            == 200
        )
        assert client.get("/api/patients").json() == []
    assert not list((tmp_path / "recordings").iterdir())
    assert not (tmp_path / "handscope.sqlite").exists()
    engine = create_engine(url)
    with engine.connect() as connection:
        assert connection.exec_driver_sql("SELECT count(*) FROM patient").scalar() == 0
    engine.dispose()
