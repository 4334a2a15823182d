"""A camera's landmarks beside a result through the API: bounded, compared, and gone afterwards."""

import json

import numpy as np
import pytest
from pydantic import TypeAdapter
from starlette.testclient import TestClient

from handscope.app.api.answers import LandmarkAnswer
from handscope.app.auth import request_limits
from handscope.app.settings import Settings
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from tests.app.api.conftest import files_in
from tests.app.api.test_recordings import finished, upload
from tests.sessions.formats.test_landmarks import as_json, seen
from tests.simulated import pose_and_wiggle

LATER = 5.25  # s that the camera's clock reads more


@pytest.fixture(scope="module")
def packed() -> bytes:
    made = pose_and_wiggle("left")
    recording = LoadedRecording(made.hand, made.geometry, {}, made.samples, made.events)
    return writer.pack(writer.tree(recording, "01", "wiggle"))


@pytest.fixture(scope="module")
def camera() -> bytes:
    truth = pose_and_wiggle("left").truth
    return as_json(truth.t[::3] + LATER, seen(truth.angles, "left")[::3]).encode()


def test_a_result_stands_beside_a_camera_and_nothing_of_it_is_kept(
    client: TestClient, patient: int, packed: bytes, camera: bytes, settings: Settings
) -> None:
    result = upload(client, patient, packed).json()["result"]
    assert finished(client, result)["state"] == "done"
    before = files_in(settings)
    at = f"/api/results/{result}/landmark-comparisons"
    answer = client.post(at, files={"file": ("../camera .json", camera)})
    assert answer.status_code == 200, answer.text
    found = answer.json()
    TypeAdapter(LandmarkAnswer).validate_python(found)
    assert found["lag"]["seconds"] == pytest.approx(-LATER, abs=0.01)
    assert found["name"] == "camera .json"
    (whole, task) = found["stretches"]
    assert (whole["event"], task["event"]) == (None, 1)
    pip = next(a for a in whole["angles"] if a["what"] == "index_pip_flexion")
    assert (pip["unit"], pip["rom_a"]) == ("deg", pytest.approx(pip["rom_b"], abs=2.0))
    curve = next(c for c in found["curves"] if c["what"] == "index_pip_flexion")
    a, b, d = (np.array(curve[name], float) for name in ("a", "b", "difference"))
    assert np.sqrt(np.nanmean(d**2)) == pytest.approx(pip["drms"], abs=1.0)
    assert np.nanmax(np.abs(b - a)) < 15.0
    assert files_in(settings) == before

    for name, content, status, words in (
        ("camera.json", camera[:-40], 422, "no JSON"),
        ("camera.json", json.dumps({"fps": 30, "frames": [[], []]}).encode(), 422, "shows no hand"),
        ("camera.avi", b"RIFF", 422, "neither JSON nor CSV"),
    ):
        refused = client.post(at, files={"file": (name, content)})
        assert (refused.status_code, words in refused.json()["error"]) == (status, True), name
        assert files_in(settings) == before
    assert (
        client.post(
            "/api/results/99999/landmark-comparisons", files={"file": ("l.json", b"x")}
        ).status_code
        == 404
    )


def test_a_landmark_file_is_bounded(
    client: TestClient, monkeypatch: pytest.MonkeyPatch, settings: Settings
) -> None:
    monkeypatch.setattr(request_limits, "LANDMARKS", 10_000)
    large = {"file": ("l.json", bytes(request_limits.FORM + 20_000))}
    assert client.post("/api/results/1/landmark-comparisons", files=large).status_code == 413
