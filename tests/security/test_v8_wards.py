"""ASVS 5, 8.2.2 and 8.2.3: nothing of another ward's patient is served, on any address that the application has."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import date
from types import SimpleNamespace
from typing import Any

import pytest
from starlette.routing import Mount
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from handscope.app.auth.gate import new_token
from handscope.app.auth.roles import ANYBODY, RouteTable
from handscope.app.auth.ward_access import OF_PATIENTS, sees_session
from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.sessions.clinic import accounts, patients
from handscope.sessions.db.tables import (
    Correction,
    Goal,
    HandPhotograph,
    PatientSession,
    RecordingFile,
    Result,
    SelfCalibration,
    TreatmentEvent,
)
from handscope.sessions.wards import wards

ORIGIN = {"Origin": "http://127.0.0.1:8420"}
WHY = "unconscious on the night ward, burn of the hand"
OWN, OTHER = "P-OWN-1", "P-OTHER-2"  # codes of patients
ROLES = ["clinician", "scientist", "administrator"]


@dataclass(frozen=True)
class House:
    """Two wards with a patient each, and everything that a patient can have; anna is of the first ward, berta of the second."""

    client: TestClient
    own: dict[str, Any]
    other: dict[str, Any]

    def log_in(self, name: str) -> None:
        self.client.cookies.clear()
        folder = self.client.app.state.parts.store.folder  # type: ignore[attr-defined]
        assert self.client.post("/api/login", json={"token": new_token(folder, name)}).is_success


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Iterator[House]:
    settings = Settings(data=tmp_path_factory.mktemp("house"))
    app = create_app(settings)
    with TestClient(app, "http://127.0.0.1:8420", False, follow_redirects=False) as client:
        with app.state.parts.store.database() as db:
            for name in ("anna", "berta"):
                accounts.add(db, name, ROLES)
            numbers = [wards.add(db, name).id for name in ("Hand surgery", "Neurology")]
            for name, ward in zip(("anna", "berta"), numbers, strict=True):
                wards.assign(db, accounts.find_by_name(db, name), [ward], [ward])
            own, other = (_patient(db, code, ward) for code, ward in zip((OWN, OTHER), numbers))  # fmt: skip
        for ids in (own, other):
            station = SimpleNamespace(
                name=f"station{ids['session']}",
                kind="live",
                setup=SimpleNamespace(session=ids["session"]),
            )
            ids["name"] = station.name
            app.state.parts.stations._stations[station.name] = station
            place = app.state.parts.store.path_of(f"recordings/{ids['code']}.mcap")
            place.write_bytes(b"recorded")
        yield House(client, own, other)
        app.state.parts.stations._stations.clear()


@pytest.fixture
def house(built: House) -> House:
    """Logged in as anna."""
    built.log_in("anna")
    return built


def _patient(db: Any, code: str, ward: int) -> dict[str, Any]:
    """Rows of every kind."""
    patient = patients.create(db, code, note="x", ward_id=ward)
    file = RecordingFile(format="native", file=f"recordings/{code}.mcap", sha256="0" * 64)
    session = PatientSession(patient=patient, hand="left", state="recorded", recordings=[file])
    correction = Correction(
        recording=file, event=0, kind="exclude", onset=0.0, end=1.0, reason="pain"
    )
    result = Result(recording=file, key=code, method="m1", version="1", state="done")
    db.add_all([session, correction, result])
    db.flush()
    found = SelfCalibration(
        patient_id=patient.id, recording=file, hand="left", onset=0.0, end=1.0, version="1"
    )
    photograph = HandPhotograph(patient_id=patient.id, hand="left", version="1")
    event = TreatmentEvent(
        patient_id=patient.id, kind="splint", hand="left", day=date(2026, 5, 1), comment="x"
    )
    goal = Goal(
        patient_id=patient.id, hand="left", measure="tapping", task="tapping", figure="rate",
        unit="1/s", low=3.0, high=4.0,
    )  # fmt: skip
    db.add_all([found, photograph, event, goal])
    db.commit()
    rows = {
        "patient": patient,
        "note": patient.notes[0],
        "session": session,
        "recording": file,
        "correction": correction,
        "self_calibration": found,
        "photograph": photograph,
        "treatment_event": event,
        "goal": goal,
        "result": result,
    }
    assert set(rows) == OF_PATIENTS
    return {"code": code, **{kind: row.id for kind, row in rows.items()}}


def addresses(client: TestClient, ids: dict[str, Any]) -> Iterator[tuple[str, str, bool]]:
    """Method ("": a web socket) and path of everything served, filled in, and whether it names something of a patient."""
    for route, declaration in RouteTable(client.app.routes).all:  # type: ignore[attr-defined]
        if isinstance(route.original_route, Mount) or ANYBODY in (
            declaration.roles if declaration else ()
        ):
            continue
        path = str(route.path)
        names = re.findall(r"\{(\w+)", path)
        of_patient = any(name.removesuffix("_id") in ids for name in names)
        filled = re.sub(
            r"\{(\w+)[^}]*\}", lambda m: str(ids.get(m[1].removesuffix("_id"), 1)), path
        )
        for method in sorted(getattr(route, "methods", None) or ("",)):
            yield method, filled, of_patient


def answer(client: TestClient, method: str, path: str) -> tuple[int, str]:
    if method:
        given = client.request(method, path, json={} if method in ("POST", "PUT", "PATCH") else None)  # fmt: skip
        return given.status_code, given.text
    try:
        with client.websocket_connect(f"ws://127.0.0.1:8420{path}", headers=ORIGIN) as socket:
            return 200, json.dumps(socket.receive_json())
    except WebSocketDisconnect as closed:
        return 403 if closed.code == 1008 else closed.code, ""


def test_every_address_that_names_something_of_another_wards_patient_is_refused(
    house: House,
) -> None:
    walked = [a for a in addresses(house.client, house.other) if a[2]]
    assert len(walked) > 30 and {path for method, path, _ in walked if not method} >= {
        f"/scene/{house.other['name']}",
        f"/api/stations/{house.other['name']}/live",
    }
    served = [(m, p, s) for m, p, _ in walked if (s := answer(house.client, m, p)[0]) != 403]
    assert served == []


def test_the_own_wards_patient_is_served_at_the_same_addresses(house: House) -> None:
    refused = [
        path
        for method, path, of_patient in addresses(house.client, house.own)
        if of_patient and method == "GET" and "station" not in path
        and answer(house.client, method, path)[0] == 403
    ]  # fmt: skip
    assert refused == []
    assert house.client.get(f"/api/patients/{house.own['patient']}").json()["pseudonym"] == OWN


def test_no_list_names_another_wards_patient_or_session(house: House) -> None:
    lists = [
        p for m, p, of_patient in addresses(house.client, house.own) if m == "GET" and not of_patient
    ]  # fmt: skip
    assert {"/api/patients", "/api/sessions/unfinished", "/api/stations", "/api/audit"} <= {*lists}
    texts = {path: answer(house.client, "GET", path)[1] for path in lists}
    assert [path for path, text in texts.items() if OTHER in text] == []
    assert house.other["name"] not in texts["/api/stations"]
    assert OWN in texts["/api/patients"] and house.own["name"] in texts["/api/stations"]
    assert {line["patient"] for line in house.client.get("/api/audit").json()} <= {None, house.own["patient"]}  # fmt: skip
    search = house.client.get("/api/patients", params={"search": OTHER, "archived": True})
    assert (search.json(), search.headers["x-total-count"]) == ([], "0")


def test_bodies_and_queries_reach_no_other_ward_either(house: House) -> None:
    own, other, client = house.own, house.other, house.client
    tried = [
        client.get(f"/api/results/{own['result']}/comparison", params={"other": other["result"]}),
        client.post(f"/api/results/{own['result']}/replay", params={"other": other["result"]}),
        client.post(f"/api/results/{own['result']}/references", json={"before": other["result"]}),
        client.post(f"/api/results/{own['result']}/references", json={"other": other["result"]}),
        client.post(
            f"/api/patients/{own['patient']}/self-calibrations", json={"result": other["result"]}
        ),
        client.put(
            f"/api/sessions/{own['session']}/reuse",
            json={"parts": "lengths", "self_calibration": other["self_calibration"]},
        ),
        client.post("/api/patients", json={"pseudonym": "P-77", "ward": 3}),
    ]
    assert [t.status_code // 100 for t in tried] == [4] * len(tried), [t.text for t in tried]
    assert not any(OTHER in t.text for t in tried)


def test_an_administrator_of_a_ward_manages_no_accounts_and_no_wards(house: House) -> None:
    listed = house.client.get("/api/accounts").json()
    assert [a["name"] for a in listed] == ["anna"]
    number = listed[0]["id"]
    tried = [
        house.client.patch(f"/api/accounts/{number}", json={"version": 1, "wards": [1]}),
        house.client.post("/api/accounts", json={"name": "c", "roles": ["clinician"]}),
        house.client.post(f"/api/accounts/{number + 1}/code"),
        house.client.delete(f"/api/accounts/{number + 1}/second-factors"),
        house.client.post("/api/wards", json={"name": "Burns"}),
        house.client.patch("/api/wards/3", json={"name": "Mine"}),
        house.client.delete("/api/wards/3"),
    ]
    assert [t.status_code for t in tried] == [403] * len(tried)


def test_an_emergency_opens_one_patient_and_the_ward_is_shown_it(house: House) -> None:
    client, other = house.client, house.other
    asked = {"pseudonym": OTHER, "reason": WHY}
    made = client.post("/api/emergency-accesses", json=asked)
    assert made.status_code == 201 and made.json()["patient"] == other["patient"]
    patient = client.get(f"/api/patients/{other['patient']}").json()
    assert patient["emergency_accesses"][0]["reason"] == WHY
    assert client.get(f"/api/sessions/{other['session']}").status_code == 200
    assert [a["id"] for a in client.get("/api/emergency-accesses?own=true").json()] == [made.json()["id"]]  # fmt: skip
    version = patient["version"]
    beyond = [
        client.patch(f"/api/patients/{other['patient']}", json={"version": version, "ward": 2}),
        client.post(f"/api/patients/{other['patient']}/erasure", json={"pseudonym": OTHER}),
        client.post(f"/api/stations/{other['name']}/streams", json={}),
    ]
    assert [b.status_code for b in beyond] == [403] * 3, "not moved, not erased, not passed on"
    house.log_in("berta")
    (shown,) = client.get("/api/emergency-accesses").json()
    assert (shown["by"], shown["pseudonym"], shown["lasts"]) == ("anna", OTHER, True)
    lines = client.get("/api/audit", params={"patient": other["patient"]}).json()
    assert ("anna", "emergency_access") in {(line["who"], line["kind"]) for line in lines}
    house.log_in("anna")
    assert client.get("/api/emergency-accesses").json() == []
    assert client.delete(f"/api/emergency-accesses/{made.json()['id']}").status_code == 204
    assert client.get(f"/api/patients/{other['patient']}").status_code == 403


def test_a_stream_ends_with_what_its_account_may_see(house: House) -> None:
    parts = house.client.app.state.parts  # type: ignore[attr-defined]
    _, token = parts.permits.grant(house.other["name"], 10.0, "anna")
    headers = {"Authorization": f"Bearer {token}", **ORIGIN}
    with (
        house.client.websocket_connect("ws://127.0.0.1:8420/api/stream", headers=headers) as socket,
        pytest.raises(WebSocketDisconnect) as closed,
    ):
        socket.receive_json()
    assert closed.value.code == 4401
    with parts.store.database() as db:
        assert sees_session(db, "berta", house.other["session"])
        assert not sees_session(db, "anna", house.other["session"])
        accounts.change(db, accounts.find_by_name(db, "berta"), disabled=True)
        assert not sees_session(db, "berta", house.other["session"])
        accounts.change(db, accounts.find_by_name(db, "berta"), disabled=False)


def test_a_patient_who_is_moved_is_the_new_wards(house: House) -> None:
    made = house.client.post("/api/patients", json={"pseudonym": "P-MOVED-3"}).json()
    assert made["ward_name"] == "Hand surgery"
    change = {"version": made["version"], "ward": 3}
    moved = house.client.patch(f"/api/patients/{made['id']}", json=change)
    assert (moved.status_code, moved.json()["ward_name"]) == (200, "Neurology")
    assert house.client.get(f"/api/patients/{made['id']}").status_code == 403
    house.log_in("berta")
    assert house.client.get(f"/api/patients/{made['id']}").status_code == 200
