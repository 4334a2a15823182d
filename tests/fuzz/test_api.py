"""The API by its own description: whatever its schema allows, and what it does not, is answered without a 500 and writes in the data folder only."""

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from starlette.testclient import TestClient

from app import results as making
from app.api.access import new_token
from app.server import create_app
from app.settings import Settings
from app.version import software_version
from sessions import patients, records, results
from sessions.motion_bids import writer
from sessions.store import Store, open_store
from tests.fuzz.targets import seeds, writes_within
from tests.simulated import loaded, pose_and_wiggle

schemathesis = pytest.importorskip("schemathesis", reason="schemathesis is not installed: make lock, then make check")
ROUNDS = int(os.environ.get("HANDSCOPE_API_ROUNDS", "4"))  # of each route; `make fuzz` takes more
NUMBERS = st.sampled_from([1, 1, 1, 2, 3, 0, -1, 2**31, 2**63, 10**30])  # of patients, sessions, ...: mostly of one that is there
FEW = {"POST /api/patients/{patient_id}/sessions": 2}  # each starts a process
NAMES = st.one_of(st.sampled_from(["r.zip", "../../r.zip", "/tmp/r.mcap", "r.mcap\0", "", "."]), st.text(max_size=20))


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data folder with a session that was processed by two methods, a correction, a note."""
    folder = tmp_path_factory.mktemp("site") / "data"
    store = open_store(folder)
    with store.database() as db:
        patient = patients.create(db, "P-1", note="a note")
        session = records.add_upload(db, store, patient, _incoming(store), "r.zip", None)
        made = [results.wanted(db, session.recordings[0], method, {}, software_version()).id for method in ("m2", "b")]
    for number in made:
        making.make(store, number)
    return folder


@pytest.fixture(scope="module")
def client(data: Path) -> Iterator[TestClient]:
    app = create_app(Settings(data=data, largest_upload=2**20))
    with TestClient(app, base_url="http://127.0.0.1:8420", raise_server_exceptions=False, follow_redirects=False) as browser:
        yield browser


def test_whatever_is_asked_of_the_api_is_answered(client: TestClient, data: Path) -> None:
    schema, asked, bad_answers = schemathesis.openapi.from_dict(client.app.openapi()), 0, list[str]()  # type: ignore[attr-defined]
    for operation in (found.ok() for found in schema.get_all_operations()):
        good, bad = (operation.as_strategy(generation_mode=mode) for mode in schemathesis.GenerationMode)
        rounds = FEW.get(operation.label, ROUNDS)

        @settings(max_examples=rounds, phases=[Phase.generate], suppress_health_check=list(HealthCheck))
        @given(case=st.one_of(good, bad), number=NUMBERS, raw=st.binary(max_size=40), name=NAMES, how=st.integers(0, 9))
        def ask(case: Any, number: int, raw: bytes, name: str, how: int) -> None:
            nonlocal asked
            if client.get("/api/stations").status_code == 401:  # it was asked to log out
                client.post("/api/login", json={"token": new_token(data)})
            path, query, body = _path(case, number, how), _query(case), _body(case, raw, name, how)
            with writes_within(data):
                answer = client.request(case.method, path, params=query, **body)
            asked += 1
            if answer.status_code >= 500 and answer.status_code != 507:
                bad_answers.append(f"{case.method} {answer.request.url} {str(body)[:300]}: {answer.status_code}")
            stations = client.get("/api/stations")
            for station in stations.json() if stations.status_code == 200 else ():
                client.delete(f"/api/stations/{station['station']}")

        ask()
    assert bad_answers == []
    assert asked > 30 * ROUNDS


def _incoming(store: Store) -> Path:
    place = store.incoming / "r.zip"
    place.write_bytes(writer.packed(writer.tree(loaded(pose_and_wiggle("left")), "01", "wiggle")))
    return place


def _path(case: Any, number: int, how: int) -> str:
    path = str(case.path)
    for name, value in (case.path_parameters or {}).items():
        path = path.replace(f"{{{name}}}", quote(str(number if name.endswith("_id") and how else value), safe=""))
    return path


def _query(case: Any) -> dict[str, Any]:
    query = case.query if isinstance(case.query, dict) else {}
    return {str(k): v if isinstance(v, list) else str(v) for k, v in query.items()}


def _body(case: Any, raw: bytes, name: str, how: int) -> dict[str, Any]:
    """What the schema says, in nine of ten; otherwise bytes that are no JSON."""
    if case.method == "GET":
        return {}
    if case.media_type == "multipart/form-data":
        fields = case.body if isinstance(case.body, dict) else {}
        content = seeds("bids")[0] if how < 3 else seeds("recording")[0][: how * 2000] if how < 6 else raw
        words = {str(k): str(v) for k, v in fields.items() if k != "file"}
        return {"data": words, "files": {"file": (name, content)} if how < 9 else {}}
    if how == 0:
        return {"content": raw, "headers": {"Content-Type": "application/json"}}
    try:
        return {"content": json.dumps(case.body).encode(), "headers": {"Content-Type": "application/json"}}
    except (TypeError, ValueError):
        return {}
