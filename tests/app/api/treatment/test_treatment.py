"""Treatment events and goals over the API: kept, shown with progress, refused where they make no sense."""

import io
import json
import zipfile
from datetime import timedelta
from typing import Any

import pytest
from starlette.testclient import TestClient

from handscope.app.language import ENGLISH
from handscope.app.report.progress import stored
from handscope.app.results.report import goal_readings
from handscope.sessions.clinic import patients, repeatability
from handscope.sessions.db.tables import PatientSession, RecordingFile, Result, now
from tests.app.report.progress.test_series import PIP, visit

OPERATION = {"kind": "operation", "hand": "left", "day": "2026-05-20", "comment": "zone II"}


def _progress(client: TestClient, patient: int) -> Any:
    return client.get(f"/api/patients/{patient}/progress").json()


def test_treatment_is_read_with_progress_in_the_order_of_its_days(
    client: TestClient, patient: int
) -> None:
    address = f"/api/patients/{patient}/treatment-events"
    splint = {"kind": "splint", "hand": "both", "day": "2026-05-02"}
    for new in (OPERATION, splint):
        assert client.post(address, json=new).status_code == 201
    first, second = _progress(client, patient)["treatment_events"]
    assert (first["kind"], first["comment"], second["day"]) == ("splint", "", "2026-05-20")
    assert client.delete(f"/api/treatment-events/{first['id']}").status_code == 204
    assert [e["kind"] for e in _progress(client, patient)["treatment_events"]] == ["operation"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"day": (now().date() + timedelta(days=3)).isoformat()}, "has not come yet"),
        ({"day": "1850-01-01"}, "before the patient's year of birth"),
        ({"kind": "prayer"}, "kind"),
        ({"day": "yesterday"}, "day"),
    ],
)
def test_treatment_that_cannot_have_been_is_refused(
    client: TestClient, patient: int, change: dict[str, str], words: str
) -> None:
    answer = client.post(f"/api/patients/{patient}/treatment-events", json={**OPERATION, **change})
    assert answer.status_code in (400, 422) and words in answer.text
    assert _progress(client, patient)["treatment_events"] == []


def test_a_figure_has_one_goal_for_each_hand(
    client: TestClient, patient: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(repeatability, "history", lambda *_: [visit(0, 60), visit(9, 66)])
    measure, task, name = PIP
    goal = {"hand": "left", "measure": measure, "task": task, "name": name, "unit": "deg"}
    address = f"/api/patients/{patient}/goals"
    for low in (70, 80):
        made = client.put(address, json={**goal, "low": low, "high": 95})
    assert made.status_code == 200
    (series,) = _progress(client, patient)["series"]
    assert series["goals"].keys() == {"left"}
    assert (series["goals"]["left"]["low"], series["goals"]["left"]["high"]) == (80, 95)
    assert client.put(address, json={**goal, "low": 90, "high": 80}).status_code == 422
    assert client.delete(f"/api/goals/{made.json()['id']}").status_code == 204
    assert _progress(client, patient)["series"][0]["goals"] == {}


@pytest.mark.parametrize(("unit", "is_shown"), [("deg", True), ("rad", False)])
def test_a_goal_in_another_unit_is_beside_no_figure(
    client: TestClient, patient: int, monkeypatch: pytest.MonkeyPatch, unit: str, is_shown: bool
) -> None:
    """In the API's progress, the printed one, and beside a result's figures."""
    measure, task, name = PIP
    goal = {"hand": "left", "measure": measure, "task": task, "name": name, "unit": unit}
    client.put(f"/api/patients/{patient}/goals", json={**goal, "low": 1, "high": 2})
    monkeypatch.setattr(repeatability, "history", lambda *_: [visit(0, 60), visit(9, 66)])
    monkeypatch.setattr(stored, "pdf_of", lambda page, *_: json.dumps(page).encode())
    figure = {"measure": measure, "task": task, "name": name, "unit": "rad", "value": 1.1}
    store = client.app.state.parts.store  # type: ignore[attr-defined]
    with store.database() as db, db.no_autoflush:
        session = PatientSession(patient=patients.get(db, patient), hand="left")
        result = Result(figures=[{**figure, "grade": "good"}])
        result.recording = RecordingFile(session=session)
        readings = goal_readings(result)
        db.expunge_all()
        page = json.loads(stored.progress_report(db, store, patient, "left", ENGLISH, "a4"))
    assert [(r.unit, r.low, r.high) for r in readings] == [("deg", 1, 2)] * is_shown
    assert bool(_progress(client, patient)["series"][0]["goals"]) is is_shown
    assert bool(page["tasks"][0][1][0][-1]) is is_shown


def test_what_a_patient_takes_along_has_treatment_and_goals(
    client: TestClient, patient: int
) -> None:
    client.post(f"/api/patients/{patient}/treatment-events", json=OPERATION)
    goal = {"hand": "left", "measure": "tapping", "task": "tapping", "name": "rate"}
    client.put(f"/api/patients/{patient}/goals", json={**goal, "unit": "1/s", "low": 3, "high": 4})
    content = client.get(f"/api/patients/{patient}/export.zip").content
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        kept = json.loads(archive.read("patient.json"))
    assert kept["treatment_events"][0]["day"] == "2026-05-20"
    assert kept["goals"][0]["high"] == 4
