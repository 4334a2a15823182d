"""What a scientist is shown of a patient: everything measured, nothing that somebody typed, no year of birth."""

import io
import re
import zipfile
from collections.abc import Callable

from starlette.testclient import TestClient

from handscope.app.auth.roles import RouteTable
from handscope.estimators.data.samples import Event
from handscope.sessions.db.roles import CLINICIAN, SCIENTIST
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from tests.app.api.test_recordings import finished, upload
from tests.simulated import pose_and_wiggle

SECRET, YEAR = "Gooseberry", "1937"
TELLING = re.compile(
    rf"{SECRET}|(?<![\w.+/]){YEAR}(?![\w+/])".encode()
)  # a number of four digits, not some of a longer one or of packed bytes


def test_no_address_shows_a_scientist_what_somebody_typed(
    log_in_as: Callable[..., TestClient],
) -> None:
    client = log_in_as(CLINICIAN)
    ids = planted(client)
    assert leaks(client, ids) >= {
        "/api/patients/{patient_id}",
        "/api/sessions/{session_id}",
        "/api/results/{result_id}",
        "/api/recordings/{recording_id}/file",
        "/api/patients/{patient_id}/export.zip",
    }, "the search finds what is there"
    client = log_in_as(SCIENTIST)
    assert leaks(client, ids) == set()
    patient = client.get(f"/api/patients/{ids['patient_id']}").json()
    assert (patient["year_of_birth"], patient["notes"], patient["dominant_hand"]) == (
        None,
        [],
        "left",
    )
    assert client.get(f"/api/results/{ids['result_id']}").json()["figures"]
    assert (
        client.post(f"/api/sessions/{ids['session_id']}/results", json={"method": "m1"}).status_code
        == 201
    )


def planted(client: TestClient) -> dict[str, int]:
    """A patient with the secret in every place for text, and the numbers of what belongs to it."""
    made = pose_and_wiggle("left")
    typed = {
        "outcome": f"unable: says {SECRET}",
        "reason": f"pain, says {SECRET}",
        "comment": SECRET,
    }
    events = (
        *made.events,
        Event(1.0, 0.5, "annotation", typed),
        Event(4.0, 3.0, "task", {"task_name": "rom_fist", **typed}),
    )
    packed = writer.pack(
        writer.tree(
            LoadedRecording(made.hand, made.geometry, {}, made.samples, events), "01", "wiggle"
        )
    )
    new = {
        "pseudonym": "P-plum",
        "year_of_birth": int(YEAR),
        "dominant_hand": "left",
        "note": f"fell, {SECRET}",
    }
    patient = client.post("/api/patients", json=new).json()["id"]
    told = upload(client, patient, packed, f"{SECRET}.zip").json()
    finished(client, told["result"])
    version = client.get(f"/api/sessions/{told['session']}").json()["version"]
    typed_now = {
        "version": version,
        "notes": SECRET,
        "conclusion": SECRET,
        "examiner": f"Dr {SECRET}",
        "started": "2026-11-01T10:00:00Z",
        "date_reason": SECRET,
    }
    assert client.patch(f"/api/sessions/{told['session']}", json=typed_now).status_code == 200
    recording = client.get(f"/api/sessions/{told['session']}").json()["recordings"][0]["id"]
    wish = {"event": len(events) - 1, "kind": "exclude", "reason": SECRET}
    corrected = client.post(f"/api/recordings/{recording}/corrections", json=wish).json()[
        "results"
    ][0]["now"]
    assert finished(client, corrected)["state"] == "done"
    event = {"kind": "other", "hand": "left", "day": "2026-05-01", "comment": SECRET}
    assert client.post(f"/api/patients/{patient}/treatment-events", json=event).status_code == 201
    note = client.get(f"/api/patients/{patient}").json()["notes"][0]["id"]
    return {
        "patient_id": patient,
        "session_id": told["session"],
        "result_id": corrected,
        "recording_id": recording,
        "note_id": note,
    }


def leaks(client: TestClient, ids: dict[str, int]) -> set[str]:
    """Addresses whose answer holds the secret or the year."""
    found = set()
    for route, _ in RouteTable(client.app.routes).all:  # type: ignore[attr-defined]
        if "GET" in (getattr(route, "methods", None) or ()) and str(route.path).startswith("/api/"):
            path = (
                str(route.path)
                .replace("report.{form}", "report.json")
                .format_map(
                    {
                        **ids,
                        "name": "none",
                        "form": "json",
                        "table": 1,
                        "photograph_id": 1,
                        "plan": "crps",
                    }
                )
            )
            answer = client.get(
                path, params={"what": "aperture", "other": ids["result_id"], "named": "true"}
            )
            if any(TELLING.search(part) for part in unpacked(answer.content)):
                found.add(str(route.path))
    return found


def unpacked(content: bytes) -> list[bytes]:
    """The bytes themselves, or those of every file of a zip."""
    if not content.startswith(b"PK"):
        return [content]
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return [part for name in archive.namelist() for part in unpacked(archive.read(name))]
