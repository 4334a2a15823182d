"""Patients over the API."""

import pytest
from starlette.testclient import TestClient


def test_a_patient_is_made_found_and_changed(client: TestClient) -> None:
    made = client.post(
        "/api/patients", json={"pseudonym": "  Ada   17 ", "year_of_birth": 1960, "dominant_hand": "right", "affected_hand": "both"}
    )
    assert made.status_code == 201
    patient = made.json()
    assert patient["pseudonym"] == "Ada 17"
    assert [p["id"] for p in client.get("/api/patients", params={"search": "ada 1"}).json()] == [patient["id"]]
    assert client.get("/api/patients", params={"search": "bob"}).json() == []
    change = {"version": patient["version"], "hand_measures": {"left": {"hand_length": 0.181}}, "notes": "tired"}
    changed = client.patch(f"/api/patients/{patient['id']}", json=change).json()
    assert (changed["notes"], changed["hand_measures"]["left"]["hand_length"]) == ("tired", 0.181)
    assert changed["version"] == patient["version"] + 1


def test_two_editors_at_once_are_told(client: TestClient, patient: int) -> None:
    version = client.get(f"/api/patients/{patient}").json()["version"]
    assert client.patch(f"/api/patients/{patient}", json={"version": version, "notes": "mine"}).status_code == 200
    late = client.patch(f"/api/patients/{patient}", json={"version": version, "notes": "theirs"})
    assert late.status_code == 422
    assert "changed in another window" in late.json()["error"]
    assert client.get(f"/api/patients/{patient}").json()["notes"] == "mine"


@pytest.mark.parametrize(
    ("facts", "sentence"),
    [
        ({"pseudonym": "   "}, "1 to 64 characters"),
        ({"pseudonym": "x" * 65}, "1 to 64 characters"),
        ({"pseudonym": "y", "year_of_birth": 12}, "year of birth 12 is outside"),
        ({"pseudonym": "y", "dominant_hand": "both"}, "dominant hand is left or right"),
        ({"pseudonym": "y", "name": "Ada"}, "name: "),
    ],
)
def test_facts_that_make_no_sense_are_refused(client: TestClient, facts: dict[str, object], sentence: str) -> None:
    before = client.get("/api/patients").json()
    answer = client.post("/api/patients", json=facts)
    assert answer.status_code == 422
    assert sentence in answer.json()["error"]
    assert client.get("/api/patients").json() == before


def test_a_pseudonym_is_given_once(client: TestClient) -> None:
    assert client.post("/api/patients", json={"pseudonym": "twice"}).status_code == 201
    again = client.post("/api/patients", json={"pseudonym": "twice"})
    assert again.status_code == 422
    assert "already a patient 'twice'" in again.json()["error"]


def test_hand_measures_in_millimetres_are_refused(client: TestClient, patient: int) -> None:
    version = client.get(f"/api/patients/{patient}").json()["version"]
    answer = client.patch(f"/api/patients/{patient}", json={"version": version, "hand_measures": {"left": {"hand_length": 181}}})
    assert answer.status_code == 422
    assert "give lengths in metres" in answer.json()["error"]


def test_a_patient_that_is_not_there_is_404(client: TestClient) -> None:
    answer = client.get("/api/patients/99999")
    assert answer.status_code == 404
    assert "there is no patient 99999" in answer.json()["error"]
