"""Patients over the API."""

import time

import pytest
from starlette.testclient import TestClient

from handscope.app.api import progress
from handscope.app.example_patients.patients import UNFINISHED
from handscope.app.example_patients.stories import STORIES
from handscope.app.settings import Settings
from handscope.sessions.db.columns import now
from handscope.sessions.store.store import Store
from tests.app.closed_connection import status_of

WAIT = 120.0  # s until a test gives up


def test_a_patient_is_made_found_and_changed(client: TestClient) -> None:
    made = client.post(
        "/api/patients",
        json={
            "pseudonym": "  Ada   17 ",
            "year_of_birth": 1960,
            "dominant_hand": "right",
            "affected_hand": "both",
        },
    )
    assert made.status_code == 201
    patient = made.json()
    assert patient["pseudonym"] == "Ada 17"
    assert [p["id"] for p in client.get("/api/patients", params={"search": "ada 1"}).json()] == [
        patient["id"]
    ]
    assert client.get("/api/patients", params={"search": "bob"}).json() == []
    change = {
        "version": patient["version"],
        "hand_measures": {"left": {"hand_length": 0.181}},
        "affected_hand": None,
    }
    changed = client.patch(f"/api/patients/{patient['id']}", json=change).json()
    assert (changed["affected_hand"], changed["hand_measures"]["left"]["hand_length"]) == (
        None,
        0.181,
    )
    assert changed["version"] == patient["version"] + 1


def test_a_patient_says_how_many_sessions_a_demonstration_will_have_made(
    client: TestClient, patient: int
) -> None:
    story, folder = STORIES[0], client.app.state.parts.store.folder  # type: ignore[attr-defined]
    made = client.post("/api/patients", json={"pseudonym": story.code, "confirmed": True}).json()
    numbers = [len(list(story.sessions())), 0]
    for touched, planned in ((True, numbers), (False, [0, 0])):
        (folder / UNFINISHED).touch() if touched else (folder / UNFINISHED).unlink()
        listed = {p["id"]: p["planned"] for p in client.get("/api/patients").json()}
        assert [listed[made["id"]], listed[patient]] == planned
        assert client.get(f"/api/patients/{made['id']}").json()["planned"] == planned[0]


def test_two_editors_at_once_are_told(client: TestClient, patient: int) -> None:
    version = client.get(f"/api/patients/{patient}").json()["version"]
    assert (
        client.patch(
            f"/api/patients/{patient}", json={"version": version, "year_of_birth": 1961}
        ).status_code
        == 200
    )
    late = client.patch(
        f"/api/patients/{patient}", json={"version": version, "year_of_birth": 1962}
    )
    assert late.status_code == 409
    assert "changed in another window" in late.json()["error"]
    assert client.get(f"/api/patients/{patient}").json()["year_of_birth"] == 1961


def test_a_list_comes_in_pages_that_together_hold_every_patient_once(client: TestClient) -> None:
    made = {
        client.post("/api/patients", json={"pseudonym": f"page {k}"}).json()["id"] for k in range(7)
    }
    pages = [
        client.get("/api/patients", params={"search": "page", "offset": k, "limit": 3})
        for k in (0, 3, 6)
    ]
    assert [p.headers["X-Total-Count"] for p in pages] == ["7"] * 3
    found = [row["id"] for p in pages for row in p.json()]
    assert len(found) == 7
    assert set(found) == made
    assert client.get("/api/patients", params={"limit": 100_000}).status_code == 422


def test_a_note_is_written_corrected_removed_and_brought_back(
    client: TestClient, patient: int
) -> None:
    def texts() -> list[str]:
        return [n["text"] for n in client.get(f"/api/patients/{patient}").json()["notes"]]

    first = client.post(
        f"/api/patients/{patient}/notes", json={"text": " prefers mornings "}
    ).json()
    client.post(f"/api/patients/{patient}/notes", json={"text": "splint since May"})
    assert texts() == ["splint since May", "prefers mornings"]
    address = f"/api/notes/{first['id']}"
    removed = client.patch(address, json={"version": first["version"], "removed": True}).json()
    assert texts() == ["splint since May"]
    back = client.patch(address, json={"version": removed["version"], "removed": False}).json()
    assert (texts()[1], back["written"]) == ("prefers mornings", first["written"])
    late = client.patch(address, json={"version": first["version"], "text": "prefers evenings"})
    assert (late.status_code, texts()[1]) == (409, "prefers mornings")
    empty = client.patch(address, json={"version": back["version"], "text": "  "})
    assert (empty.status_code, texts()[1]) == (422, "prefers mornings")


@pytest.mark.parametrize(
    ("facts", "sentence"),
    [
        ({"pseudonym": "   "}, "1 to 64 characters"),
        ({"pseudonym": "x" * 65}, "1 to 64 characters"),
        ({"pseudonym": "x" * 500}, "1 to 64 characters"),
        ({"pseudonym": "y", "year_of_birth": 12}, "year of birth 12 is outside"),
        (
            {"pseudonym": "y", "year_of_birth": now().year + 1},
            f"is outside 1900 to {now().year}",
        ),
        ({"pseudonym": "y", "dominant_hand": "both"}, "dominant hand is left or right"),
        ({"pseudonym": "y", "name": "Ada"}, "name: "),
    ],
)
def test_facts_that_make_no_sense_are_refused(
    client: TestClient, facts: dict[str, object], sentence: str
) -> None:
    before = client.get("/api/patients").json()
    answer = client.post("/api/patients", json=facts)
    assert answer.status_code == 422
    assert sentence in answer.json()["error"]
    assert client.get("/api/patients").json() == before


def test_a_body_that_is_no_json_is_refused_with_the_place(client: TestClient) -> None:
    json = {"Content-Type": "application/json"}
    answer = client.post("/api/patients", content=b'{"pseudonym": }', headers=json)
    assert (answer.status_code, answer.json()["code"]) == (422, "server.not_json")
    assert "is no JSON (Expecting value, at character 14)" in answer.json()["error"]


def test_letters_beyond_ascii_are_found_in_either_case(client: TestClient) -> None:
    made = client.post("/api/patients", json={"pseudonym": "Ünï-Ω-42"}).json()
    for search in ("ünï", "ÜNÏ-ω", "Ünï-Ω-42", "Ω-4"):
        found = client.get("/api/patients", params={"search": search})
        assert [p["id"] for p in found.json()] == [made["id"]]
        assert found.headers["X-Total-Count"] == "1"


def test_a_pseudonym_is_given_once(client: TestClient) -> None:
    assert client.post("/api/patients", json={"pseudonym": "twice"}).status_code == 201
    again = client.post("/api/patients", json={"pseudonym": "twice"})
    assert again.status_code == 422
    assert "already a patient 'twice'" in again.json()["error"]


def test_hand_measures_and_a_trunk_height_in_millimetres_are_refused(
    client: TestClient, patient: int
) -> None:
    version = client.get(f"/api/patients/{patient}").json()["version"]
    high = client.patch(f"/api/patients/{patient}", json={"version": version, "trunk_height": 420})
    assert (high.status_code, "420000 mm" in high.json()["error"]) == (422, True)
    answer = client.patch(
        f"/api/patients/{patient}",
        json={"version": version, "hand_measures": {"left": {"hand_length": 181}}},
    )
    assert answer.status_code == 422
    assert (
        answer.json()["error"]
        == "hand length: 181000 mm is outside 50 to 300 mm (files and programs give metres)"
    )


def test_a_patient_that_is_not_there_is_404(client: TestClient) -> None:
    answer = client.get("/api/patients/99999")
    assert answer.status_code == 404
    assert "there is no patient 99999" in answer.json()["error"]


def test_a_name_in_place_of_a_code_is_kept_only_when_somebody_confirms_it(
    client: TestClient, patient: int
) -> None:
    facts = {"pseudonym": "Anna Berg", "year_of_birth": 1961}
    asked = client.post("/api/patients", json=facts)
    assert (asked.status_code, asked.json()["confirm"]) == (422, ["words", "name"])
    assert "may be a person's name" in asked.json()["error"]
    assert client.get("/api/patients", params={"search": "anna"}).json() == []
    made = client.post("/api/patients", json={**facts, "confirmed": True}).json()
    assert made["pseudonym"] == "Anna Berg"
    again = client.patch(
        f"/api/patients/{made['id']}",
        json={"version": made["version"], "pseudonym": "Anna Berg", "year_of_birth": 1962},
    )
    assert again.status_code == 200  # nobody is asked twice about the same
    version = client.get(f"/api/patients/{patient}").json()["version"]
    changed = client.patch(
        f"/api/patients/{patient}", json={"version": version, "pseudonym": "Berg, Anna"}
    )
    assert (changed.status_code, "comma" in changed.json()["confirm"]) == (422, True)


def take_long(store: Store, *_: object) -> bytes:
    (store.folder / "begun").touch()
    time.sleep(WAIT)
    return b""


def test_a_closed_connection_ends_what_is_made_for_it_and_the_next_is_served(
    client: TestClient, patient: int, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = f"/api/patients/{patient}/progress.pdf"
    with monkeypatch.context() as patch:
        patch.setattr(progress, "make_progress_report", take_long)
        begun = settings.data / "begun"
        status = status_of(client, "GET", path, b"hand=left", left=begun.exists)
    assert status == 499
    # nothing was measured yet: said at once
    assert client.get(f"{path}?hand=left").status_code == 422
