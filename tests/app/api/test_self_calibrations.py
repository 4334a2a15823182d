"""What self-calibration found, over the API: kept by a press, listed, taken over as decided; scientists may look."""

from collections.abc import Callable

import pytest
from starlette.testclient import TestClient

from handscope.sessions.db.roles import CLINICIAN, SCIENTIST
from handscope.sessions.db.tables import RecordingFile, Result
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from tests.app.api.test_recordings import finished, upload
from tests.sessions.clinic.test_self_calibrations import found
from tests.simulated import pose_and_wiggle


@pytest.fixture(scope="module")
def packed() -> bytes:
    made = pose_and_wiggle("left")
    return writer.pack(
        writer.tree(
            LoadedRecording(made.hand, made.geometry, {}, made.samples, made.events), "01", "wiggle"
        )
    )


def by_map(client: TestClient, session: int) -> int:
    """A result of self-calibration, as if it had been computed."""
    one = found()
    content = {
        "self_calibration": {
            "table": one.table,
            "told": one.messages,
            "onset": one.onset,
            "end": one.end,
            "given": {"index_proximal": 0.0412},
        }
    }
    with client.app.state.parts.store.database() as db:  # type: ignore[attr-defined]
        file = db.query(RecordingFile).filter_by(session_id=session).one()
        made = Result(
            recording=file, key="k", method="map", version="1", state="done", content=content
        )
        db.add(made)
        db.commit()
        return int(made.id)


def test_it_is_kept_by_a_press_and_taken_over_as_somebody_decides(
    client: TestClient, patient: int, packed: bytes, log_in_as: Callable[..., TestClient]
) -> None:
    made = upload(client, patient, packed).json()
    session, first = made["session"], made["result"]
    finished(client, first)
    address, reuse = f"/api/patients/{patient}/self-calibrations", f"/api/sessions/{session}/reuse"
    assert client.get(reuse).json() == {"decided": None, "offers": []}
    assert "no self-calibration" in client.post(address, json={"result": first}).json()["error"]
    source = by_map(client, session)
    told = client.get(f"/api/results/{source}").json()["self_calibration"]
    assert ["index proximal", "43.00 ± 0.20", "found by the movement"] in told["lengths"]
    assert told["changes"] == [["index proximal", "41.2", "43.00 ± 0.20"]]
    assert client.get(f"/api/results/{first}").json()["self_calibration_gains"] == []
    kept = client.post(address, json={"result": source})
    assert kept.status_code == 201, kept.text
    (offer,) = client.get(reuse).json()["offers"]
    assert (offer["id"], offer["parts"], offer["session"]) == (
        kept.json()["id"],
        ["lengths", "lengths_and_seats"],
        session,
    )

    wish = {"parts": "lengths", "self_calibration": kept.json()["id"]}
    decided = client.put(reuse, json=wish).json()
    assert (decided["decided"]["parts"], decided["decided"]["self_calibration"]) == (
        "lengths",
        kept.json()["id"],
    )
    (pair,) = [p for p in decided["results"] if p["before"] == first]
    result = finished(client, pair["now"])
    assert (result["state"], result["reused"]) == (
        "done",
        {"self_calibration": kept.json()["id"], "parts": "lengths"},
    )
    assert (
        result["content"]["calibration"]["source"] == "initial pose, lengths from self-calibration"
    )
    back = client.put(reuse, json={"parts": "nothing"}).json()["results"]
    assert {"before": pair["now"], "now": first} in back

    begin = f"/api/patients/{patient}/sessions", {"hand": "left", "port": "/dev/ttyABSENT"}
    undecided = client.post(begin[0], json=begin[1])
    assert (undecided.status_code, "takes over" in undecided.json()["error"]) == (422, True)
    assert [s["id"] for s in client.get(f"/api/patients/{patient}").json()["sessions"]] == [session]
    begun = client.post(begin[0], json={**begin[1], "reuse": {"parts": "nothing"}}).json()[
        "session"
    ]
    assert client.get(f"/api/sessions/{begun}/reuse").json()["decided"]["parts"] == "nothing"
    assert client.post(f"/api/sessions/{begun}/closing").status_code == 204

    other = client.post("/api/patients", json={"pseudonym": "P-other"}).json()["id"]
    assert (
        "another patient"
        in client.post(f"/api/patients/{other}/self-calibrations", json={"result": source}).json()[
            "error"
        ]
    )
    withdrawn = client.patch(
        f"/api/self-calibrations/{kept.json()['id']}", json={"withdrawn": True}
    ).json()
    assert withdrawn["withdrawn"]
    assert client.get(reuse).json()["offers"] == []

    assert log_in_as(SCIENTIST).get(address).json()[0]["id"] == kept.json()["id"]
    assert client.put(reuse, json=wish).status_code == 403
    log_in_as(CLINICIAN)
