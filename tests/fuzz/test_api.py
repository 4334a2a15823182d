"""The API by its own description: whatever its schema allows, and what it does not, asked by anybody, is answered without a 500 and writes in the data
folder only; who may not have it gets nothing."""

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

from handscope.app.auth import request_limits
from handscope.app.auth.gate import new_token
from handscope.app.results import make as making
from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.app.version import software_version
from handscope.sessions.clinic import accounts, patients, results
from handscope.sessions.motion_bids import writer
from handscope.sessions.store import records
from handscope.sessions.store.store import Store, open_store
from tests.fuzz.targets import seeds, writes_within
from tests.simulated import loaded, pose_and_wiggle

schemathesis = pytest.importorskip(
    "schemathesis", reason="schemathesis is not installed: make lock, then make check"
)
ROUNDS = int(os.environ.get("HANDSCOPE_API_ROUNDS", "4"))  # of each route; `make fuzz` takes more
NUMBERS = st.sampled_from(
    [1, 1, 1, 2, 3, 0, -1, 2**31, 2**63, 10**30]
)  # of patients, sessions, ...: mostly of one that is there
WHO = st.sampled_from(["local", "local", "scientist", "administrator", "nobody"])
OPEN = {
    "/api/login",
    "/api/login/second",
    "/api/login/second-factors",
    "/api/health",
    "/api/patient-view",  # a patient's screen: a code that is valid once
}  # without a login
TYPED = "zinnober"  # stands wherever a person typed something about the patient
FEW = {"POST /api/patients/{patient_id}/sessions": 2}  # each starts a process
NAMES = st.one_of(
    st.sampled_from(["r.zip", "../../r.zip", "/tmp/r.mcap", "r.mcap\0", "", "."]),
    st.text(max_size=20),
)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data folder with a session that was processed by two methods, a correction, a note."""
    folder = tmp_path_factory.mktemp("site") / "data"
    store = open_store(folder)
    with store.database() as db:
        patient = patients.create(db, "P-1", note=f"{TYPED} note")
        for name in (
            "first",
            "second",
            "third",
        ):  # theirs are the numbers asked for most: they lose roles and are closed
            accounts.add(db, name, ["clinician"])
        for role in ("scientist", "administrator"):
            accounts.add(db, role, [role])
        session = records.add_upload(db, store, patient, _incoming(store), f"{TYPED}.zip", None)
        made = [
            results.find_matching(db, session.recordings[0], method, {}, software_version()).id
            for method in ("m2", "b")
        ]
    for number in made:
        making.make(store, number)
    return folder


@pytest.fixture(scope="module")
def client(data: Path) -> Iterator[TestClient]:
    app = create_app(Settings(data=data, largest_upload=2**20))
    with (
        pytest.MonkeyPatch.context() as patched,
        TestClient(
            app,
            base_url="http://127.0.0.1:8420",
            raise_server_exceptions=False,
            follow_redirects=False,
        ) as browser,
    ):
        patched.setattr(request_limits, "REFILL", 1e6)  # hundreds of requests a second, one address
        yield browser


@pytest.mark.slow
def test_whatever_is_asked_of_the_api_is_answered(client: TestClient, data: Path) -> None:
    schema, asked, bad_answers = (
        schemathesis.openapi.from_dict(client.app.openapi()),
        0,
        list[str](),
    )  # type: ignore[attr-defined]
    cookies: dict[str, str] = {}
    for operation in (found.ok() for found in schema.get_all_operations()):
        good, bad = (
            operation.as_strategy(generation_mode=mode) for mode in schemathesis.GenerationMode
        )
        rounds = FEW.get(operation.label, ROUNDS)

        @settings(
            max_examples=rounds, phases=[Phase.generate], suppress_health_check=list(HealthCheck)
        )
        @given(
            case=st.one_of(good, bad),
            who=WHO,
            number=NUMBERS,
            raw=st.binary(max_size=40),
            name=NAMES,
            how=st.integers(0, 9),
        )
        def ask(case: Any, who: str, number: int, raw: bytes, name: str, how: int) -> None:
            nonlocal asked
            _be(client, data, cookies, who)
            path, query, body = _path(case, number, how), _query(case), _body(case, raw, name, how)
            with writes_within(data):
                answer = client.request(case.method, path, params=query, **body)
            asked += 1
            if answer.status_code >= 500 and answer.status_code != 507:
                bad_answers.append(
                    f"{who}: {case.method} {answer.request.url} {str(body)[:300]}: {answer.status_code}"
                )
            if told := _not_for(who, str(case.path), answer.status_code, answer.text):
                bad_answers.append(
                    f"{who}: {case.method} {answer.request.url} {str(body)[:300]}: {told}"
                )
            _be(client, data, cookies, "local")
            stations = client.get("/api/stations")
            for station in stations.json() if stations.status_code == 200 else ():
                client.delete(f"/api/stations/{station['station']}")

        ask()
    assert bad_answers == []
    assert asked > 30 * ROUNDS


def _be(client: TestClient, data: Path, cookies: dict[str, str], who: str) -> None:
    """Ask as this account from now on, logged in anew where it was asked to log out; nobody has no login."""
    client.cookies.clear()
    if who == "nobody":
        return
    if who in cookies:
        client.cookies.set("handscope", cookies[who])
    if who not in cookies or client.get("/api/account").status_code == 401:
        client.cookies.clear()
        assert client.post("/api/login", json={"token": new_token(data, who)}).status_code == 204
        cookies[who] = client.cookies["handscope"]


def _not_for(who: str, path: str, status: int, text: str) -> str:
    """What an answer gave that is not for those who asked; empty where nothing."""
    if (
        who == "nobody" and path not in OPEN and status not in (400, 401, 404, 405)
    ):  # 400: no address
        return f"{status} without a login"
    if (
        who == "administrator"
        and path.startswith(("/api/patients", "/api/sessions", "/api/stations", "/api/results"))
        and status < 400
    ):
        return f"{status}: patients are not an administrator's"
    return "words that somebody typed" if who in ("scientist", "nobody") and TYPED in text else ""


def _incoming(store: Store) -> Path:
    place = store.incoming / "r.zip"
    place.write_bytes(writer.pack(writer.tree(loaded(pose_and_wiggle("left")), "01", "wiggle")))
    return place


def _path(case: Any, number: int, how: int) -> str:
    path = str(case.path)
    for name, value in (case.path_parameters or {}).items():
        path = path.replace(
            f"{{{name}}}", quote(str(number if name.endswith("_id") and how else value), safe="")
        )
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
        content = (
            seeds("bids")[0] if how < 3 else seeds("recording")[0][: how * 2000] if how < 6 else raw
        )
        words = {str(k): str(v) for k, v in fields.items() if k != "file"}
        return {"data": words, "files": {"file": (name, content)} if how < 9 else {}}
    if how == 0:
        return {"content": raw, "headers": {"Content-Type": "application/json"}}
    try:
        return {
            "content": json.dumps(case.body).encode(),
            "headers": {"Content-Type": "application/json"},
        }
    except (TypeError, ValueError):
        return {}
