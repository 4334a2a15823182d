"""Uploads, results and exports over the API: real files, a real process for long work."""

import io
import time
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sqlalchemy import select
from starlette.testclient import TestClient

from handscope.app.settings import Settings
from handscope.estimators.hand.anatomy import FINGERS
from handscope.sessions import motion_bids
from handscope.sessions.db.tables import RecordingFile
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from handscope.sessions.store.store import open_store
from tests.app.api.conftest import files_in
from tests.oriented import fused
from tests.simulated import loaded, pose_and_wiggle


@pytest.fixture(scope="module")
def recording() -> LoadedRecording:
    made = pose_and_wiggle("left")
    return LoadedRecording(
        made.hand, made.geometry, {}, made.samples, made.events, source={"device": "simulated"}
    )


@pytest.fixture(scope="module")
def packed(recording: LoadedRecording) -> bytes:
    return writer.pack(writer.tree(recording, "01", "wiggle"))


def upload(client: TestClient, patient: int, data: bytes, name: str = "r.zip", **form: str) -> Any:
    return client.post(
        f"/api/patients/{patient}/recordings", files={"file": (name, data)}, data=form
    )


def finished(client: TestClient, result: int) -> dict[str, Any]:
    until = time.monotonic() + 60
    while (found := client.get(f"/api/results/{result}").json())["state"] in ("queued", "running"):
        assert time.monotonic() < until
        time.sleep(0.2)
    return dict(found)


def changed(packed: bytes, name: str, change: Any) -> bytes:
    """The zip with one file's bytes changed."""
    files = {}
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        for entry in archive.namelist():
            files[entry] = (
                change(archive.read(entry)) if entry.endswith(name) else archive.read(entry)
            )
    return writer.pack(files)


def test_a_report_has_the_date_of_the_recording_or_none(
    client: TestClient, patient: int, packed: bytes
) -> None:
    name = "motion/sub-01_task-wiggle_tracksys-imu_motion.tsv"
    scans = f"filename\tacq_time\n{name}\t2025-03-01T12:00:00Z\n".encode()
    dated = io.BytesIO(packed)
    with zipfile.ZipFile(dated, "a") as archive:
        archive.writestr("sub-01/sub-01_scans.tsv", scans)
    for data, expected in ((packed, None), (dated.getvalue(), "2025-03-01T12:00:00+00:00")):
        made = upload(client, patient, data).json()
        assert finished(client, made["result"])["state"] == "done"
        told = client.get(f"/api/results/{made['result']}/report.json").json()
        session = client.get(f"/api/sessions/{made['session']}").json()
        assert (told["session"]["date"], session["dated"]) == (expected, expected is not None)


def test_an_upload_becomes_a_session_with_figures_and_exports(
    client: TestClient, patient: int, packed: bytes, settings: Settings
) -> None:
    made = upload(client, patient, packed)
    assert made.status_code == 201, made.text
    result = finished(client, made.json()["result"])
    assert (result["state"], result["error"]) == ("done", "")
    assert {f["name"] for f in result["figures"]} >= {
        "index_pip_flexion_max",
        "thumb_ip_flexion_range",
    }
    (largest,) = [f for f in result["readings"]["figures"] if f["name"] == "index_pip_flexion_max"]
    assert (largest["part"], largest["what"], largest["unit"], largest["norm"]) == (
        "index_pip",
        "flexion_max",
        "deg",
        None,
    )
    assert 1 < largest["sd"] < 5
    assert "own standard deviation" in largest["sd_basis"]
    session = client.get(f"/api/sessions/{made.json()['session']}").json()
    assert (session["state"], session["hand"], session["source"], session["tasks"]) == (
        "processed",
        "left",
        "upload",
        ["wiggle"],
    )
    file = session["recordings"][0]
    kept = client.get(f"/api/recordings/{file['id']}/file")
    assert kept.content == packed
    base = f"/api/results/{result['id']}"
    made = client.get(f"{base}/report.pdf").content
    assert made.startswith(b"%PDF")
    (
        settings.data / "results" / f"{result['id']}.report.npz"
    ).unlink()  # made anew from the recording it is the same, and kept again
    assert client.get(f"{base}/report.pdf").content == made
    assert (settings.data / "results" / f"{result['id']}.report.npz").exists()
    assert b"index_pip_flexion_max" in client.get(f"{base}/report.csv").content
    assert client.get(f"{base}/report.json").json()
    assert client.get(f"{base}/report.docx").status_code == 404
    lean = client.get(base, params={"lean": True}).json()
    assert ("figures" in lean, "tasks" in lean["content"], "figures" in lean["readings"]) == (
        False,
        False,
        False,
    )
    assert lean["readings"]["ranges"] == result["readings"]["ranges"]
    pseudonym = client.get(f"/api/patients/{patient}").json()["pseudonym"]
    nameless, named = (
        client.get(f"{base}/replay.html", params={"named": asked}) for asked in (False, True)
    )
    assert nameless.headers["content-disposition"].startswith("attachment")
    heads = [answer.text.partition("<script")[0] for answer in (nameless, named)]
    assert [pseudonym in head for head in heads] == [False, True]
    with zipfile.ZipFile(io.BytesIO(client.get(f"{base}/derivative.zip").content)) as derivative:
        assert any(
            name.endswith("_tracksys-handscope_desc-ekf_motion.tsv")
            for name in derivative.namelist()
        )
    offered = {f["name"] for f in client.get(f"{base}/exports").json()}
    assert {"opensim", "fhir", "parquet"} <= offered
    with zipfile.ZipFile(io.BytesIO(client.get(f"{base}/exports/opensim").content)) as model:
        assert set(model.namelist()) == {"motion.mot", "orientations.sto", "hand.osim"}
    with zipfile.ZipFile(io.BytesIO(client.get(f"{base}/exports/bvh").content)) as animated:
        assert set(animated.namelist()) == {"handscope-bvh.bvh", "handscope-bvh.json"}
        hierarchy = animated.read("handscope-bvh.bvh").decode()
    assert hierarchy.startswith("HIERARCHY")
    bundle = client.get(f"{base}/exports/fhir")
    assert bundle.headers["content-type"] == "application/fhir+json"
    assert pseudonym not in bundle.text
    trail = client.get("/api/audit", params={"what": "exported"}).json()
    assert "fhir" in str(trail)
    refused = client.get(f"{base}/exports/docx")
    assert refused.status_code == 404 and "opensim" in refused.json()["error"]


def test_a_second_session_says_what_changed_since_the_first(
    client: TestClient, patient: int, packed: bytes
) -> None:
    alone = finished(client, upload(client, patient, packed, method="m2").json()["result"])[
        "readings"
    ]
    assert alone["changes"] is None
    assert {str(r["changes"]) for r in alone["ranges"][0]["rows"]} == {"{}"}
    another = changed(
        packed, "dataset_description.json", lambda data: data + b" "
    )  # a recording of its own with the same movement
    result = finished(client, upload(client, patient, another, method="m2").json()["result"])
    (row,) = [
        r
        for r in result["readings"]["ranges"][0]["rows"]
        if (r["group"], r["joint"]) == ("Index", "PIP")
    ]
    assert row["changes"]["flexion"] == "unchanged"
    assert "Reissner 2019" in result["readings"]["changes"]["sources"]["range_of_motion"][0]
    course = client.get(f"/api/patients/{patient}/progress").json()
    pip = next(s for s in course["series"] if s["name"] == "index_pip_flexion_max")
    points = pip["hands"]["left"]["points"]
    assert [p[0] for p in points] == [s["session"] for s in course["sessions"]["left"]]
    assert (points[0][2:], points[1][2:], points[0][1] == points[1][1]) == (
        [None, None],
        [False, False],
        True,
    )
    assert course["judges"][pip["hands"]["left"]["judge"]]["mdc95"] == 12
    assert client.get("/api/patients/99999/progress").status_code == 404
    told = client.get(f"/api/results/{result['id']}/report.json").json()["changes"]
    assert {c["value"] for c in told["each"]} == {0.0}
    assert client.get(f"/api/results/{result['id']}/report.pdf").content.startswith(b"%PDF")


def test_curves_are_thinned_and_in_units_for_people(
    client: TestClient, patient: int, packed: bytes
) -> None:
    result = finished(client, upload(client, patient, packed, method="m2").json()["result"])
    curves = client.get(
        f"/api/results/{result['id']}/curves",
        params={"what": ["index_pip_flexion", "aperture"], "points": 50},
    ).json()
    assert len(curves["t"]) <= 50
    flexion = np.array(curves["curves"]["index_pip_flexion"], float)
    assert 55 < flexion.max() < 75  # 28 deg at rest and 35 more
    assert 20 < np.array(curves["curves"]["aperture"], float).mean() < 150
    refused = client.get(f"/api/results/{result['id']}/curves", params={"what": "elbow"})
    assert (refused.status_code, "no curve 'elbow'" in refused.json()["error"]) == (404, True)


def test_the_same_method_and_options_give_the_result_that_is_there(
    client: TestClient, patient: int, packed: bytes
) -> None:
    made = upload(client, patient, packed).json()
    again = client.post(
        f"/api/sessions/{made['session']}/results", json={"method": "ekf", "options": {}}
    ).json()
    assert again["result"] == made["result"]
    other = client.post(
        f"/api/sessions/{made['session']}/results",
        json={"method": "m2", "options": {"alignment": "heading"}},
    ).json()
    assert other["result"] != made["result"]
    assert finished(client, other["result"])["parameters"] == {"alignment": "heading"}
    for options, sentence in (
        ({"speed": 1}, "no option 'speed'"),
        ({"alignment": "best"}, "one of full, common, heading"),
    ):
        refused = client.post(
            f"/api/sessions/{made['session']}/results", json={"method": "m2", "options": options}
        )
        assert sentence in refused.json()["error"]


def test_two_results_stand_on_one_clock(client: TestClient, patient: int, packed: bytes) -> None:
    made = upload(client, patient, packed, method="m2").json()
    other = client.post(
        f"/api/sessions/{made['session']}/results",
        json={"method": "m2", "options": {"alignment": "heading"}},
    ).json()["result"]
    another = upload(
        client,
        patient,
        changed(packed, "dataset_description.json", lambda data: data + b" "),
        method="m2",
    ).json()
    for result in (made["result"], other, another["result"]):
        assert finished(client, result)["state"] == "done"
    base, pip = f"/api/results/{made['result']}/comparison", {"what": "index_pip_flexion"}
    methods = client.get(base, params={"other": other, **pip}).json()
    a, b = (np.array(methods[side], float) for side in "ab")
    assert methods["agreement"]["drms"] == pytest.approx(np.sqrt(np.mean((b - a) ** 2)), abs=0.05)
    assert methods["agreement"]["unit"] == "deg"
    sessions = client.get(base, params={"other": another["result"], "event": 1, **pip}).json()
    assert (sessions["agreement"], sessions["t"][0], sessions["a"] == sessions["b"]) == (
        None,
        pytest.approx(0, abs=0.02),
        True,
    )
    for params, sentence in (
        ({"other": another["result"]}, "say which task"),
        ({"other": other, "event": 77}, "there is no task 77"),
    ):
        assert sentence in client.get(base, params={**params, **pip}).json()["error"]
    stranger = client.post("/api/patients", json={"pseudonym": f"S-{patient}"}).json()["id"]
    theirs = upload(client, stranger, packed, method="m2").json()["result"]
    finished(client, theirs)
    assert "two patients" in client.get(base, params={"other": theirs, **pip}).json()["error"]
    replay = f"/api/results/{made['result']}/replay"
    assert "two patients" in client.post(replay, params={"other": theirs}).json()["error"]
    pair = client.get(
        f"/api/stations/{client.post(replay, params={'other': another['result'], 'at': 7.0}).json()['station']}"
    ).json()
    assert (pair["beside"], pair["replay"]["t"]) == (
        {"session": another["session"], "result": another["result"], "hand": "left"},
        7.0,
    )


def test_a_trial_is_left_out_with_a_reason_and_taken_back(
    client: TestClient, patient: int, packed: bytes
) -> None:
    made = upload(client, patient, packed, method="m2").json()
    first = finished(client, made["result"])
    file = client.get(f"/api/sessions/{made['session']}").json()["recordings"][0]
    event = next(k for k, e in enumerate(file["summary"]["events"]) if e["trial_type"] == "task")
    told = client.post(
        f"/api/recordings/{file['id']}/corrections",
        json={"event": event, "kind": "exclude", "reason_code": "pain"},
    )
    assert told.status_code == 201, told.text
    (pair,) = told.json()["results"]
    second = finished(client, pair["now"])
    assert (pair["before"], second["state"], second["figures"]) == (first["id"], "done", [])
    assert any("left out of the figures (Pain)" in w for w in second["warnings"])
    read = client.get(f"/api/results/{second['id']}", params={"language": "de"}).json()
    assert any("(Schmerzen)" in w for w in read["warnings"])
    told_in_german = client.get(
        f"/api/results/{second['id']}/report.html", params={"language": "de"}
    ).text
    assert ("Schmerzen" in told_in_german, "Pain" in told_in_german) == (True, False)
    kept = client.get(f"/api/results/{first['id']}").json()
    assert kept["figures"] == first["figures"]  # what was computed before stays as it was
    row = client.get(f"/api/sessions/{made['session']}").json()["recordings"][0]
    assert {r["id"]: r["current"] for r in row["results"]} == {
        first["id"]: False,
        second["id"]: True,
    }
    assert row["corrections"][0]["reason_code"] == "pain"
    back = client.delete(f"/api/corrections/{told.json()['correction']['id']}").json()
    assert back["results"] == [{"before": second["id"], "now": first["id"]}]
    assert back["correction"]["undone"]
    assert client.delete("/api/corrections/99999").status_code == 404
    assert (
        "needs a reason"
        in client.post(
            f"/api/recordings/{file['id']}/corrections",
            json={"event": event, "kind": "exclude", "reason": ""},
        ).json()["error"]
    )


def test_a_height_of_the_trunk_told_afterwards_is_computed_with_and_put_back(
    client: TestClient, patient: int, packed: bytes, settings: Settings
) -> None:
    made = upload(client, patient, packed, method="m2").json()
    finished(client, made["result"])
    at = f"/api/sessions/{made['session']}"
    refused = client.patch(at, json={"version": 1, "trunk_height": 0.42})
    assert (refused.status_code, "no sensor on the trunk" in refused.json()["error"]) == (422, True)
    with open_store(settings.data).database() as db:  # as if one had been worn
        file = db.scalars(
            select(RecordingFile).where(RecordingFile.session_id == made["session"])
        ).one()
        file.summary = {**file.summary, "streams": [{"name": "trunk", "sensors": ["trunk"]}]}
        db.commit()
    told = client.patch(at, json={"version": 1, "trunk_height": 0.42}).json()
    assert (told["trunk_height"], told["trunk_corrected"], told["results"][0]["before"]) == (
        0.42,
        True,
        made["result"],
    )
    events = finished(client, told["results"][0]["now"])["content"]["events"]
    assert [e["trunk_height"] for e in events if e["trial_type"] == "task"] == [0.42]
    assert client.patch(at, json={"version": 1, "trunk_height": None}).status_code == 409
    back = client.patch(at, json={"version": 2, "trunk_height": None}).json()
    assert (back["trunk_height"], back["trunk_corrected"], back["results"][0]["now"]) == (
        None,
        False,
        made["result"],
    )


def test_a_replay_moves_along_its_time_line(
    client: TestClient, patient: int, packed: bytes
) -> None:
    result = finished(client, upload(client, patient, packed, method="m2").json()["result"])
    station = client.post(f"/api/results/{result['id']}/replay").json()["station"]
    assert (
        client.post(f"/api/results/{result['id']}/replay").json()["station"] != station
    )  # every viewer has a time line of his own
    told = client.get(f"/api/stations/{station}").json()["replay"]
    assert told["playing"] is False
    moved = client.post(
        f"/api/stations/{station}/actions", json={"action": "seek", "value": 8.0}
    ).json()["replay"]
    assert moved["t"] == 8.0
    with client.websocket_connect(
        f"ws://127.0.0.1:8420/api/stations/{station}/live",
        headers={"Origin": "http://127.0.0.1:8420"},
    ) as socket:
        client.post(f"/api/stations/{station}/actions", json={"action": "play"})
        times = [socket.receive_json()["pulse"]["t"] for _ in range(10)]
    assert times[-1] > 8.0
    assert (
        client.post(f"/api/stations/{station}/actions", json={"action": "fly"}).status_code == 404
    )
    assert client.delete(f"/api/stations/{station}").status_code == 204
    assert client.get(f"/api/stations/{station}").status_code == 404


@pytest.mark.parametrize(
    ("name", "spoil", "sentence"),
    [
        ("r.zip", lambda z: b"hello", "neither a folder, a zip nor a native recording"),
        ("r.zip", lambda z: z[: len(z) // 2], "cut off"),
        ("r.mcap", lambda z: b"hello", "no Handscope recording: nothing in it"),
        ("r.mcap", lambda z: b"", "r.mcap is empty; copy the recording again"),
        (
            "r.zip",
            lambda z: changed(z, "imu_channels.tsv", lambda t: t.replace(b"rad/s", b"rpm")),
            "unknown unit 'rpm'",
        ),
        ("r.zip", lambda z: changed(z, "imu_motion.tsv", lambda t: b""), "0 samples"),
        (
            "r.zip",
            lambda z: changed(z, "motion.json", lambda t: t.replace(b'"left"', b'"third"')),
            "left or right",
        ),
        (
            "r.zip",
            lambda z: changed(z, "imu_motion.json", lambda t: t.replace(b'"left"', b'"right"')),
            "two hands",
        ),
    ],
)
def test_a_bad_upload_says_what_is_wrong_and_leaves_nothing(
    client: TestClient,
    patient: int,
    packed: bytes,
    settings: Settings,
    name: str,
    spoil: Any,
    sentence: str,
) -> None:
    files, sessions = files_in(settings), client.get(f"/api/patients/{patient}").json()["sessions"]
    answer = upload(client, patient, spoil(packed), name)
    assert answer.status_code == 422
    assert sentence in answer.json()["error"]
    assert files_in(settings) == files
    assert client.get(f"/api/patients/{patient}").json()["sessions"] == sessions


def test_a_recording_without_initial_pose_is_kept_and_its_result_says_what_is_missing(
    client: TestClient, patient: int, recording: LoadedRecording
) -> None:
    without = recording.with_events(
        tuple(e for e in recording.events if e.trial_type != "initial_pose")
    )
    made = upload(client, patient, writer.pack(writer.tree(without, "01", "wiggle")))
    result = finished(client, made.json()["result"])
    assert result["state"] == "failed"
    assert "no initial_pose event" in result["error"]
    assert client.get(f"/api/results/{result['id']}/report.pdf").status_code == 422


def test_a_hand_that_contradicts_the_recording_is_refused(
    client: TestClient, patient: int, packed: bytes
) -> None:
    answer = upload(client, patient, packed, hand="right")
    assert answer.status_code == 422
    assert "recorded on the left hand, not on the right one" in answer.json()["error"]
    assert answer.json()["code"] == "motion_bids.other_hand"
    assert answer.json()["values"]["name"] == "r.zip"
    german = {"Accept-Language": "de"}
    told = client.post(
        f"/api/patients/{patient}/recordings",
        files={"file": ("r.zip", packed)},
        data={"hand": "right"},
        headers=german,
    )
    assert "r.zip" in told.json()["error"] and told.json()["error"] != answer.json()["error"]


def test_an_upload_that_is_too_large_is_refused_while_it_comes(
    client: TestClient, patient: int, settings: Settings
) -> None:
    before = files_in(settings)
    answer = upload(client, patient, bytes(settings.largest_upload + 1))
    assert answer.status_code == 422
    assert "larger than 8 MB" in answer.json()["error"]
    assert files_in(settings) == before


def test_a_full_disk_refuses_uploads_and_sessions_in_words(
    client: TestClient,
    patient: int,
    packed: bytes,
    settings: Settings,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from collections import namedtuple

    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(
        "handscope.sessions.store.store.shutil.disk_usage", lambda path: usage(10**9, 10**9, 5_000)
    )
    before = files_in(settings)
    for answer in (
        upload(client, patient, packed),
        client.post(
            f"/api/patients/{patient}/sessions", json={"hand": "left", "port": "/dev/ttyABSENT"}
        ),
    ):
        assert answer.status_code == 422
        assert "disk is nearly full" in answer.json()["error"]
    assert files_in(settings) == before
    assert client.get(f"/api/patients/{patient}").json()["sessions"] == []


def test_only_measured_fingers_are_told(
    client: TestClient, patient: int, recording: LoadedRecording, tmp_path: Path
) -> None:
    whole = recording.samples["imu"]
    kept = [k for k, s in enumerate(whole.stream.sensors) if s == "hand" or s.startswith("index")]
    stream = type(whole.stream)(
        "imu",
        tuple(whole.stream.sensors[k] for k in kept),
        whole.stream.quantities,
        whole.stream.rate,
    )
    one = LoadedRecording(
        recording.hand,
        recording.geometry,
        {},
        {"imu": type(whole)(stream, whole.t, whole.values[:, kept])},
        recording.events,
    )
    motion_bids.write(one, tmp_path / "one.zip")
    result = finished(
        client, upload(client, patient, (tmp_path / "one.zip").read_bytes()).json()["result"]
    )
    named = {f["name"].split("_")[0] for f in result["figures"] if f["value"] is not None}
    assert named & set(FINGERS) == {"index"}


def test_orientations_alone_are_processed_by_a_method_that_takes_them(
    client: TestClient, patient: int
) -> None:
    oriented = loaded(fused(pose_and_wiggle("left")))
    made = upload(client, patient, writer.pack(writer.tree(oriented, "01", "wiggle")))
    result = finished(client, made.json()["result"])
    assert (result["method"], result["state"], result["error"]) == ("m2", "done", "")


def test_a_recording_that_is_there_already_is_kept_again_and_named(
    client: TestClient, patient: int, packed: bytes
) -> None:
    first = upload(client, patient, packed).json()
    again = upload(client, patient, packed).json()
    elsewhere = client.post("/api/patients", json={"pseudonym": "P-other"}).json()["id"]
    for new in (first, upload(client, elsewhere, packed).json()):
        assert (new["warnings"], new["same_recording"]) == ([], [])
        assert client.get(f"/api/sessions/{new['session']}").json()["same_recording"] == []
    assert again["session"] != first["session"]
    (sentence,), (there,) = again["warnings"], again["same_recording"]
    assert f"is there already: session {first['session']} of {there['started'][:10]}" in sentence
    told = client.get(f"/api/sessions/{again['session']}").json()["same_recording"]
    assert [row["session"] for row in told] == [first["session"]] == [there["session"]]
