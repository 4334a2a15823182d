"""The other hand in the same visit: the first session ends, the second begins in its place, and only where it can."""

from typing import Any

import pytest
from starlette.testclient import TestClient

from handscope.app.live.station import Station
from handscope.app.state import Parts
from tests.app.api.conftest import patient_with_name


@pytest.fixture
def first(client: TestClient, patient: int) -> dict[str, Any]:
    """A live session of the left hand at a port without a glove."""
    client.patch(
        f"/api/patients/{patient}",
        json={"version": 1, "hand_measures": {"right": {"hand_length": 0.2}}},
    )
    new = {"hand": "left", "port": "/dev/ttyABSENT", "examiner": "An examiner"}
    new["options"] = {"gyr_noise": 1e-3}  # type: ignore[assignment]
    answer = client.post(f"/api/patients/{patient}/sessions", json=new)
    assert answer.status_code == 201, answer.text
    return {**answer.json(), "patient": patient, "port": new["port"]}


def station_of(client: TestClient, name: str) -> Station:
    parts: Parts = client.app.state.parts  # type: ignore[attr-defined]
    found = parts.stations.get(name)
    assert isinstance(found, Station)
    return found


def test_the_other_hand_follows_with_everything_as_it_was(
    client: TestClient, first: dict[str, Any]
) -> None:
    answer = client.post(f"/api/stations/{first['station']}/other-hand", json={})
    assert answer.status_code == 201, answer.text
    second = answer.json()
    assert client.get(f"/api/stations/{first['station']}").status_code == 404
    before, now = (client.get(f"/api/sessions/{s['session']}").json() for s in (first, second))
    assert before["state"] != "open" and before["other_hand"]["session"] == now["id"]
    assert (now["hand"], now["continues"], now["examiner"]) == (
        "right",
        before["id"],
        "An examiner",
    )
    assert now["other_hand"] == {"session": before["id"], "hand": "left"}
    assert now["geometry"] == {"hand_length": 0.2}
    setup = station_of(client, second["station"]).setup
    assert (setup.port, setup.params.gyr_noise) == (first["port"], 1e-3)
    client.delete(f"/api/stations/{second['station']}")


def test_the_patients_screen_follows_to_the_other_hand(
    client: TestClient, first: dict[str, Any]
) -> None:
    parts: Parts = client.app.state.parts  # type: ignore[attr-defined]
    client.post(f"/api/stations/{first['station']}/screens", json={"language": "en"})
    second = client.post(f"/api/stations/{first['station']}/other-hand", json={}).json()
    assert [s.language for s in parts.screens.list_of(second["station"])] == ["en"]
    client.delete(f"/api/stations/{second['station']}")
    assert parts.screens.list_of(second["station"]) == []


def test_what_cannot_begin_ends_nothing(client: TestClient, first: dict[str, Any]) -> None:
    path = f"/api/stations/{first['station']}/other-hand"
    new = {"hand": "right", "port": "/dev/ttyABSENT2"}
    patient_with_name.count += 1
    other = client.post("/api/patients", json={"pseudonym": f"P-{patient_with_name.count}"}).json()[
        "id"
    ]
    taken = client.post(f"/api/patients/{other}/sessions", json=new).json()
    refused = [
        client.post(path, json={"port": port}).json()["code"]
        for port in (new["port"], "socket://10.0.0.1:4000", "relay://")
    ]
    assert refused == ["live.glove_in_use", "device.port_not_allowed", "api.other_hand_of_relay"]
    assert client.get(f"/api/stations/{first['station']}").json()["hand"] == "left"
    for name in (first["station"], taken["station"]):
        client.delete(f"/api/stations/{name}")


def test_a_visit_stays_whole_when_its_first_session_is_deleted(
    client: TestClient, first: dict[str, Any]
) -> None:
    second = client.post(f"/api/stations/{first['station']}/other-hand", json={}).json()
    client.delete(f"/api/stations/{second['station']}")
    assert client.delete(f"/api/sessions/{first['session']}").status_code == 204
    now = client.get(f"/api/sessions/{second['session']}").json()
    assert (now["continues"], now["other_hand"]) == (None, None)
