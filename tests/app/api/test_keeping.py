"""What becomes of everything about a patient: taken away in one file, erased for good."""

import hashlib
import io
import json
import zipfile
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from starlette.testclient import TestClient

from handscope.app.settings import Settings
from handscope.estimators.data.samples import Event
from handscope.sessions.db.tables import PatientSession, RecordingFile
from handscope.sessions.files.recorder import Recorder
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.store.store import open_store
from handscope.sessions.wire.framing import Encoder
from tests.app.api.conftest import files_in
from tests.app.api.test_recordings import finished, upload
from tests.glove import whole_session
from tests.simulated import in_strips


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A native recording of two strips with an initial pose."""
    path, encoder = tmp_path_factory.mktemp("native") / "glove.mcap", Encoder()
    with Recorder(path, {"hand": "left"}, 100.0) as recorder:
        for sent in whole_session(
            {name: in_strips("left").samples[name] for name in ("hand", "index")}
        ):
            recorder.write(encoder.frame(sent.message), sent.arrival)
        recorder.event("pose", Event(1.5, 3.0, "initial_pose"), 103.0)
    return path.read_bytes()


def test_everything_about_a_patient_comes_in_one_file_that_can_be_checked(
    client: TestClient, patient: int, native: bytes, tmp_path: Path, settings: Settings
) -> None:
    client.post(f"/api/patients/{patient}/notes", json={"text": "prefers mornings"})
    made = upload(client, patient, native, "glove.mcap").json()
    figures = finished(client, made["result"])["figures"]
    answer = client.get(f"/api/patients/{patient}/export.zip")
    assert answer.headers["content-disposition"].startswith('attachment; filename="handscope-P-')
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.testzip() is None
        files = {name: archive.read(name) for name in archive.namelist()}
        archive.extractall(tmp_path)
    manifest = json.loads(files.pop("manifest.json"))
    sums = dict(
        reversed(line.split("  ")) for line in files.pop("SHA256SUMS").decode().splitlines()
    )
    assert sums == {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
    assert {(f["path"], f["bytes"], f["sha256"]) for f in manifest["files"]} == {
        (n, len(d), sums[n]) for n, d in files.items()
    }
    assert manifest["problems"] == []
    assert [n["text"] for n in json.loads(files["patient.json"])["notes"]] == ["prefers mornings"]
    folder = f"sessions/{made['session']}"
    (kept,) = [data for name, data in files.items() if name.startswith(f"{folder}/recording-")]
    assert kept == native
    told = json.loads(files[f"{folder}/result-{made['result']}-ekf.json"])
    assert told["figures"] == figures
    with np.load(io.BytesIO(files[f"{folder}/result-{made['result']}.npz"])) as replay:
        assert len(replay["t"]) == len(replay["angles"]) > 100
    (bids,) = (tmp_path / folder).glob("motion-bids-*")
    one, other = (
        formats_recordings.load(bids),
        formats_recordings.load(next((tmp_path / folder).glob("*.mcap"))),
    )
    np.testing.assert_array_equal(one.samples["index"].values, other.samples["index"].values)


def test_a_recording_that_is_damaged_or_gone_is_named_and_the_rest_is_there(
    client: TestClient, patient: int, native: bytes, settings: Settings
) -> None:
    sessions = [upload(client, patient, native, "glove.mcap").json()["session"] for _ in range(2)]
    with open_store(settings.data).database() as db:
        damaged, gone = (
            settings.data / f.file
            for f in db.query(RecordingFile).order_by(RecordingFile.id.desc()).limit(2)
        )
    damaged.write_bytes(native[:-100])
    gone.unlink()
    with zipfile.ZipFile(
        io.BytesIO(client.get(f"/api/patients/{patient}/export.zip").content)
    ) as archive:
        problems = json.loads(archive.read("manifest.json"))["problems"]
        assert {f"sessions/{s}/session.json" for s in sessions} <= set(archive.namelist())
    assert len(problems) == 2
    assert any("is not what was kept" in p for p in problems)
    assert any("could not be read from the disk" in p for p in problems)


def test_an_erased_patient_is_gone_with_files_and_replays(
    client: TestClient, patient: int, native: bytes, settings: Settings
) -> None:
    before = files_in(settings)
    made = upload(client, patient, native, "glove.mcap").json()
    finished(client, made["result"])
    station = client.post(f"/api/results/{made['result']}/replay").json()["station"]
    pseudonym = client.get(f"/api/patients/{patient}").json()["pseudonym"]
    slip = client.post(f"/api/patients/{patient}/erasure", json={"pseudonym": pseudonym + "0"})
    assert (slip.status_code, "nothing was erased" in slip.json()["error"]) == (422, True)
    erased = client.post(f"/api/patients/{patient}/erasure", json={"pseudonym": pseudonym})
    assert erased.status_code == 200, erased.text
    assert (erased.json()["sessions"], erased.json()["recordings"]) == (1, 1)
    assert files_in(settings) == before
    line = client.get("/api/erasures").json()[0]
    assert (line["what"], line["counts"]) == ("patient erased", erased.json())
    addresses = (
        f"patients/{patient}",
        f"sessions/{made['session']}",
        f"results/{made['result']}",
        f"stations/{station}",
    )
    assert {client.get(f"/api/{a}").status_code for a in addresses} == {404}
    assert client.post("/api/patients", json={"pseudonym": pseudonym}).json()["id"] > patient


def test_a_session_that_runs_is_unfinished_and_keeps_its_patient(
    client: TestClient, patient: int, settings: Settings
) -> None:
    client.patch(f"/api/patients/{patient}", json={"version": 1, "trunk_height": 0.42})
    begun = client.post(
        f"/api/patients/{patient}/sessions", json={"hand": "left", "port": "/dev/ttyABSENT"}
    ).json()
    assert client.get(f"/api/sessions/{begun['session']}").json()["trunk_height"] == 0.42
    (unfinished,) = client.get("/api/sessions/unfinished").json()
    assert (unfinished["id"], unfinished["station"], unfinished["patient"]["id"]) == (
        begun["session"],
        begun["station"],
        patient,
    )
    refused = client.post(
        f"/api/patients/{patient}/erasure", json={"pseudonym": unfinished["patient"]["pseudonym"]}
    )
    assert "is not finished" in refused.json()["error"]
    assert unfinished["overnight"] is False
    with open_store(settings.data).database() as db:
        db.get_one(PatientSession, begun["session"]).started -= timedelta(hours=20)
        db.commit()
    assert client.get("/api/sessions/unfinished").json()[0]["overnight"] is True
    assert client.get(f"/api/patients/{patient}").json()["sessions"][0]["doubts"] == ["overnight"]
    assert client.post(f"/api/sessions/{begun['session']}/closing").status_code == 204
    assert client.get("/api/sessions/unfinished").json() == []
    assert client.get("/api/stations").json() == []


def test_an_upload_is_dated_by_the_recording(
    client: TestClient, patient: int, tmp_path: Path, native: bytes
) -> None:
    path, encoder = tmp_path / "old.mcap", Encoder()
    with Recorder(
        path, {"hand": "left"}, 100.0, utc=datetime(2024, 2, 29, 8, 30, tzinfo=UTC)
    ) as recorder:
        for sent in whole_session(
            {name: in_strips("left").samples[name] for name in ("hand", "index")}
        ):
            recorder.write(encoder.frame(sent.message), sent.arrival)
    upload(client, patient, path.read_bytes(), "old.mcap")
    upload(client, patient, native, "new.mcap")
    new, old = client.get(f"/api/patients/{patient}").json()["sessions"]
    assert (old["started"], old["doubts"], new["doubts"]) == ("2024-02-29T08:30:00Z", [], [])
