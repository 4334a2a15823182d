"""Photographs over the API: proposed, measured, kept only where asked, erased; the next pose at a station takes the angles."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

from handscope.sessions.db.roles import SCIENTIST

pytest.importorskip("cv2")

from handscope.validation.studies.rendered_photographs import Rendered, render, render_sides


@pytest.fixture(scope="module")
def taken() -> Rendered:
    return render(np.random.default_rng(8), "left", "a4", np.radians(15))


def measured(client: TestClient, patient: int, taken: Rendered, **more: Any) -> Any:
    marks = json.dumps({name: list(map(float, at)) for name, at in taken.marks.items()})
    return client.post(
        f"/api/patients/{patient}/photographs",
        files={"file": ("hand.jpg", taken.jpeg, "image/jpeg")},
        data={"hand": "left", "marks": marks, **more},
    )


def test_landmarks_are_proposed_and_measured_and_the_picture_kept_only_where_asked(
    client: TestClient, patient: int, taken: Rendered, log_in_as: Callable[..., TestClient]
) -> None:
    address = f"/api/patients/{patient}/photographs"
    proposed = client.post(
        f"{address}/landmarks",
        files={"file": ("hand.jpg", taken.jpeg, "image/jpeg")},
        data={"hand": "left"},
    ).json()
    assert set(proposed["landmarks"]) == set(taken.marks) and proposed["markers"] >= 4
    made = measured(client, patient, taken)
    assert made.status_code == 201, made.text
    first = made.json()
    assert first["geometry"]["palm_length"] == pytest.approx(taken.geometry.palm_length, abs=2e-3)
    assert first["initial_pose"]["index_mcp_deviation_sd_deg"] > 0 and first["picture"] is False
    assert client.get(f"/api/photographs/{first['id']}/picture.jpg").status_code == 422
    kept = measured(client, patient, taken, keep="true").json()
    picture = client.get(f"/api/photographs/{kept['id']}/picture.jpg")
    assert picture.headers["content-type"] == "image/jpeg" and b"Exif" not in picture.content
    assert [p["id"] for p in client.get(address).json()] == [kept["id"], first["id"]]
    assert client.delete(f"/api/photographs/{kept['id']}").status_code == 204
    assert [p["id"] for p in client.get(address).json()] == [first["id"]]
    scientist = log_in_as(SCIENTIST)
    assert len(scientist.get(address).json()) == 1
    assert scientist.delete(f"/api/photographs/{first['id']}").status_code == 403


def test_a_second_picture_from_the_other_side_makes_the_figures_surer(
    client: TestClient, patient: int
) -> None:
    tilts = np.radians([20, 20])
    sides = render_sides(np.random.default_rng(9), "left", "a4", list(tilts))
    first, second = ({k: list(map(float, at)) for k, at in s.marks.items()} for s in sides)
    alone = measured(client, patient, sides[0]).json()
    form = {"hand": "left", "marks": json.dumps({**first, "second": second})}
    files = {
        name: ("hand.jpg", side.jpeg, "image/jpeg") for name, side in zip(("file", "second"), sides)
    }
    address = f"/api/patients/{patient}/photographs"
    both = client.post(address, files=files, data=form)
    assert both.status_code == 201, both.text
    sds = [
        np.array([row["sd"] for row in found["table"] if row["unit"] == "°"])
        for found in (alone, both.json())
    ]
    assert (sds[1] < sds[0]).all()
    second["index_tip"][0] += 60.0  # pixels, some 20 mm
    moved = {**form, "marks": json.dumps({**first, "second": second})}
    refused = client.post(address, files=files, data=moved)
    assert refused.status_code == 422 and "index tip" in refused.json()["error"]
    without = client.post(address, files=files, data={**form, "marks": json.dumps(first)})
    assert without.status_code == 422 and "landmark" in without.json()["error"]


def test_photographs_are_erased_with_the_patient(client: TestClient, taken: Rendered) -> None:
    patient = client.post("/api/patients", json={"pseudonym": "PH-1"}).json()["id"]
    kept = measured(client, patient, taken, keep="true").json()["id"]
    assert b"photographs/" in client.get(f"/api/patients/{patient}/export.zip").content
    client.post(f"/api/patients/{patient}/erasure", json={"pseudonym": "PH-1"})
    assert "no photograph" in client.get(f"/api/photographs/{kept}/picture.jpg").json()["error"]


def test_a_picture_of_the_other_hand_is_refused(
    client: TestClient, patient: int, taken: Rendered
) -> None:
    answer = measured(client, patient, taken, hand="right")
    assert answer.status_code == 422 and "left hand" in answer.json()["error"]
    assert measured(client, patient, taken, marks="[]").status_code == 422


def test_the_sheet_is_made_for_the_patients_hand(client: TestClient, patient: int) -> None:
    address = f"/api/patients/{patient}/pose-sheet.pdf"
    sheet = client.get(address, params={"hand": "left", "paper": "letter"})
    assert sheet.content.startswith(b"%PDF")
    assert client.get(address, params={"hand": "left", "paper": "a9"}).status_code == 404
