"""What a past result is compared with: as it was when it was made, whatever is measured later."""

from collections.abc import Callable

import pytest
from starlette.testclient import TestClient

from handscope.app.report.references import newest
from handscope.sessions.clinic import references
from handscope.sessions.db.tables import Patient, PatientSession, RecordingFile, Result
from tests.sessions.clinic.test_repeatability import MAY

DEG = 3.141592653589793 / 180
Measured = Callable[..., int]


@pytest.fixture
def measured(server: TestClient) -> Measured:
    """Stores a session with the total active motion of one finger (deg); gives its result."""
    count = 0

    def make(patient: int, hand: str, tam: float) -> int:
        nonlocal count
        count += 1
        with server.app.state.parts.store.database() as db:  # type: ignore[attr-defined]
            db.get_one(Patient, patient).affected_hand = "left"
            session = PatientSession(
                patient_id=patient,
                hand=hand,
                started=MAY.replace(hour=9 + count),
                state="processed",
            )
            file = RecordingFile(
                session=session, format="native", file=f"{count}", sha256=f"{patient}-{count}"
            )
            row = {"task": "rom_fist", "measure": "total_active_motion", "onset": 1.0, "sd": None}
            row |= {"grade": "good", "reason": "", "source": "ASSH", "part": "index"}
            figures = [
                {**row, "name": "index_tam", "what": "tam", "value": tam * DEG, "unit": "rad"},
                {
                    **row,
                    "name": "index_tam_share",
                    "what": "tam_share",
                    "value": tam / 260,
                    "unit": "1",
                },
                *(
                    {
                        **row,
                        "name": f"index_{joint}_{what}",
                        "what": what,
                        "part": f"index_{joint}",
                        "value": size * DEG,
                        "unit": "rad",
                    }
                    for joint, size in (("mcp", tam), ("pip", 0.0), ("dip", 0.0))
                    for what, size in (
                        ("composite_flexion", size),
                        ("extension_deficit", 0.0),
                        ("hyperextension", 0.0),
                    )
                ),
            ]
            task = {"task": "rom_fist", "measure": "total_active_motion", "onset": 1.0, "end": 9.0}
            result = Result(
                recording=file,
                key="k",
                method="m2",
                version="1",
                state="done",
                figures=figures,
                content={"tasks": [task], "span": [0.0, 10.0]},
            )
            db.add(result)
            db.commit()
            references.current(db, result, newest().data)  # as app/results/make.py does
            return result.id

    return make


def share(client: TestClient, result: int, **query: int) -> tuple[str, str]:
    """The row on the share of total active motion: its name and value."""
    found = client.get(f"/api/results/{result}", params={"lean": True, **query}).json()
    (section,) = found["readings"]["others"]
    (row,) = [r for r in section["rows"] if "TAM against" in r[0]]
    return row[0], row[1][0]


def test_a_later_session_of_the_other_hand_leaves_an_older_page_as_it_was(
    client: TestClient, patient: int, measured: Measured
) -> None:
    right = measured(patient, "right", 250)
    left = measured(patient, "left", 130)
    before = client.get(f"/api/results/{left}").json()
    name, value = share(client, left)
    assert name == "Index: TAM against the right hand of 12 May 2026, 10:00 UTC"
    assert value.startswith("52") and value.endswith("(fair)")
    measured(patient, "right", 134)  # stopped early
    assert client.get(f"/api/results/{left}").json() == before
    assert before["references"]["other"]["result"] == right


def test_another_reference_is_a_new_version_that_the_report_names(
    client: TestClient, patient: int, measured: Measured
) -> None:
    first, left = measured(patient, "right", 250), measured(patient, "left", 130)
    later = measured(patient, "right", 134)
    base = f"/api/results/{left}/references"
    offered = {c["result"]: c["hand"] for c in client.get(base).json()}
    assert offered == {first: "right", later: "right"}
    assert client.post(base, json={"other": later}).status_code == 201
    assert share(client, left)[1].startswith("97")
    assert share(client, left, references=1)[1].startswith("52")
    found = client.get(f"/api/results/{left}").json()["references"]
    assert [(v["number"], bool(v["author"])) for v in found["versions"]] == [(1, False), (2, True)]
    assert "references" in str(client.get("/api/audit", params={"what": "changed"}).json())
    refused = client.post(base, json={"before": first})
    assert "cannot be compared" in refused.json()["error"]
    assert client.get(f"/api/results/{left}", params={"references": 9}).status_code == 404


def test_the_affected_hand_that_is_corrected_later_leaves_the_shares_as_they_were(
    client: TestClient, patient: int, measured: Measured
) -> None:
    measured(patient, "right", 250)
    left = measured(patient, "left", 130)
    told = client.get(f"/api/patients/{patient}").json()
    changed = {"affected_hand": "right", "version": told["version"]}
    assert client.patch(f"/api/patients/{patient}", json=changed).status_code == 200
    assert share(client, left)[1].startswith("52")


def test_the_other_hand_of_the_same_visit_is_offered_until_it_is_taken(
    server: TestClient, client: TestClient, patient: int, measured: Measured
) -> None:
    measured(patient, "right", 250)
    left, right = measured(patient, "left", 200), measured(patient, "right", 240)
    with server.app.state.parts.store.database() as db:  # type: ignore[attr-defined]
        mine, theirs = (db.get_one(Result, r).recording.session for r in (left, right))
        theirs.continues_id = mine.id
        db.commit()
    found = client.get(f"/api/results/{left}?lean=true").json()["references"]
    assert (found["other"]["result"] != right, found["same_visit"]["result"]) == (True, right)
    client.post(f"/api/results/{left}/references", json={"before": None, "other": right})
    found = client.get(f"/api/results/{left}?lean=true").json()["references"]
    assert (found["other"]["result"], found["same_visit"]) == (right, None)
