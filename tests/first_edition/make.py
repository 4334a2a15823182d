"""The files of this folder, made once by the first edition; kept as documentation of how.

Run with the first edition alone (commit 5fb8325), in the repository's root: `.venv/bin/python -m tests.first_edition.make`.
A later version must not run it: the files would then be of that version.
"""

import contextlib
import io
import json
import os
import shutil
import sqlite3
import tempfile
import time
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from starlette.testclient import TestClient

from estimators import quaternions as quat
from estimators.hand_geometry import sized
from estimators.samples import ACC, GYR, MAG, Block, Stream
from estimators.simulation.magnetic_field import MagneticField, homogeneous
from sessions import formats, motion_bids
from sessions.recording import LoadedRecording
from tests.app.devices.virtual import virtual_glove
from tests.first_edition.observed import expected, run, served
from tests.laid_down import laid_down, many_positions

FILES = Path(__file__).resolve().parent / "files"
PASSWORD = "seven hands on a table"  # of the account anna
WAIT = 300.0  # s until the script gives up
PATIENT = {"pseudonym": "F-001", "year_of_birth": 1960, "dominant_hand": "right", "affected_hand": "left"}
MEASURES = {"hand_length": 0.189, "hand_breadth": 0.085, "finger_length": {"index": 0.072, "thumb": 0.06}}
OWN_TASK = {
    "name": "short_taps",
    "title": "Short tapping",
    "instruction": "Tap thumb and index finger for four seconds.",
    "group": "own",
    "order": 1,
    "routine": True,
    "duration": 4.0,
    "countdown": 1.0,
    "curve": "aperture",
    "needs": ["hand", "index_proximal", "thumb_proximal"],
    "cue": "tapping",
}


INDEX = ("index_proximal", "index_middle", "index_distal")
THUMB = ("thumb_metacarpal", "thumb_proximal", "thumb_distal")
MAGNETOMETERS = ("trunk_mag_1", "trunk_mag_2", "trunk_mag_3", "trunk_mag_4")
CUT: tuple[tuple[str, float, float, list[object], tuple[str, ...]], ...] = (  # task, Hz, end in s, more words, sensors
    ("wiggle", 20, 10.0, ["--seed", 2], ("hand", *THUMB, *INDEX)),
    ("free", 20, 18.0, ["--seed", 3, "--pose-error", 3], ("hand", *INDEX)),
    ("functional_calibration", 20, 20.0, ["--seed", 4, "--hand", "right"], ("hand", *INDEX)),
    ("lift", 20, 17.0, ["--seed", 5], ("hand", *THUMB, *INDEX, "thumb_tip_force", "index_tip_force")),
    ("reach", 20, 20.0, ["--seed", 6, "--trunk"], ("hand", "trunk", *MAGNETOMETERS)),
)


def make() -> None:
    shutil.rmtree(FILES, ignore_errors=True)
    FILES.mkdir()
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):  # so that no path of the machine gets into a file
        os.environ["LOGNAME"] = "examiner"  # stands in the audit trail
        work = Path()
        make_recordings(work)
        make_tables()
        make_native(work)
        make_outputs(work)
        make_data_folder(work)
    (FILES / "expected.json").write_text(json.dumps(expected(FILES), separators=(",", ":")) + "\n")


def make_recordings(work: Path) -> None:
    """Motion-BIDS: one as `simulate` wrote it, the others with fewer sensors."""
    run("simulate", "initial_pose", "--rate", 10, "--hand", "right", "--seed", 1, "--out", FILES / "simulated.zip")
    for task, rate, end, words, sensors in CUT:
        run("simulate", task, "--rate", rate, *words, "--out", work / f"{task}.zip")
        made = cut(formats.load(work / f"{task}.zip"), end, sensors)
        place = work / "functional.zip" if task == "functional_calibration" else FILES / f"{task}.zip"
        motion_bids.write(made, place, "01", task.replace("_", ""))


def cut(recording: LoadedRecording, end: float, sensors: tuple[str, ...]) -> LoadedRecording:
    """The first seconds of these sensors in a few digits; of the hand no magnetometers, of the trunk's every third reading."""
    samples = {}
    for name, block in recording.samples.items():
        columns = [k for k, s in enumerate(block.stream.sensors) if s in sensors]
        if columns and name != "mag":
            step, digits = (3, 9) if MAG in block.stream.quantities else (1, 4)
            stream = replace(block.stream, sensors=tuple(block.stream.sensors[k] for k in columns), rate=block.stream.rate / step)
            short = block.between(-1.0, end)
            samples[name] = Block(stream, short.t[::step].round(6), short.values[::step, columns].round(digits))
    events = tuple(replace(e, duration=min(e.duration, end - 0.5 - e.onset)) for e in recording.events if e.onset < end - 2)
    return replace(recording, samples=samples, events=events)


def make_tables() -> None:
    """What people write themselves: loads, a geometry, an array's description and its readings; a sensor that was laid down."""
    rng = np.random.default_rng(1)
    gains, offset = (np.array([[0.11, 0.004, -0.003], [0.002, 0.095, 0.005], [-0.004, 0.003, 0.21]]), np.array([1.2, 1.3, 0.9]))
    lines = ["f1 [V],f2 [V],f3 [V],mass [g],down"]
    for grams, down in [(0, "none"), *((g, s + a) for g in (200, 500) for a in "xyz" for s in "+-")]:
        axis = np.eye(3)["xyz".index(down[1])] * float(f"{down[0]}1") if grams else np.zeros(3)
        read = gains @ (-9.80665e-3 * grams * axis) + offset + 2e-3 * rng.normal(size=3)
        lines.append(",".join([*(f"{v:.5f}" for v in read), str(grams), down]))
    (FILES / "loads.csv").write_text("\n".join(lines) + "\n")
    (FILES / "geometry.json").write_text(json.dumps(MEASURES, indent=2) + "\n")
    make_array(rng)
    r = laid_down(many_positions(1), 2, rest=2.0, turn=1.0)
    values = np.concatenate([r.gyr, r.acc], axis=1)[::4, None]
    block = Block(Stream("hand", ("hand",), (GYR, ACC), 25.0, "hand"), r.t[::4], np.round(values, 5))
    recording = LoadedRecording("left", sized("left"), {}, {"hand": block}, (), source={"device": "simulated"})
    motion_bids.write(recording, FILES / "laid_down.zip", "01", "laiddown")


def make_array(rng: np.random.Generator) -> None:
    """A board with five magnetometers: turned by hand, then a magnet before it."""
    places = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.12, 0], [0.1, 0.12, 0.03], [0.05, 0.06, 0.0]])
    hard, earth = 2e-5 * rng.normal(size=(5, 3)), homogeneous().earth
    board = {"unit": "G", "moment": 0.32, "magnetometers": {f"m{k}": {"place": p.tolist()} for k, p in enumerate(places)}}
    (FILES / "array.json").write_text(json.dumps(board) + "\n")
    header = ",".join(["t", *(f"m{k}_{axis}" for k in range(5) for axis in "xyz")])

    def write(name: str, field: Any) -> None:
        read = 1e4 * (field + hard + 1e-7 * rng.normal(size=field.shape))
        rows = np.column_stack([np.arange(len(read)) / 20.0, read.reshape(len(read), -1)])
        np.savetxt(FILES / name, rows, delimiter=",", header=header, comments="", fmt="%.5f")

    t = np.arange(300) / 20.0
    q = quat.multiply(quat.about(2, 2 * np.pi * 0.31 * t), quat.multiply(quat.about(0, 2 * np.pi * 0.17 * t), quat.about(1, np.sin(t))))
    write("turned.csv", np.repeat(quat.rotate(quat.conjugate(q), np.broadcast_to(earth, (300, 3)))[:, None], 5, axis=1))
    t = np.arange(60) / 10.0
    p = places.mean(axis=0) + np.column_stack([0.05 * np.cos(t), 0.05 * np.sin(t), 0.13 + 0.02 * np.sin(2 * t)])
    write("magnet.csv", np.array([MagneticField(earth, one[None], np.array([[0.32, 0.0, 0.0]])).at(places) for one in p]))


def make_native(work: Path) -> None:
    """Native recordings by `record`: steps of a functional calibration replayed, and a glove with force sensors and calibrated strips."""
    with virtual_glove(work / "glove", "--replay", str(work / "functional.zip"), "--format", "int16", "--speed", "6") as port:
        run("record", port, "--out", FILES / "functional.mcap")
    for finger in ("thumb", "index"):
        run("calibrate-force", FILES / "loads.csv", "--finger", finger, "--out", FILES / "force_setup.json")
    words = ("--strips", "thumb,index,force", "--rate", "25", "--task", "tapping", "--force-setup", str(FILES / "force_setup.json"))
    with virtual_glove(work / "glove", *words) as port:
        run("record", port, "--out", FILES / "glove.mcap", "--seconds", 4, "--geometry", FILES / "geometry.json")


def make_outputs(work: Path) -> None:
    """What commands write: derivatives, measures, calibrations, a comparison."""
    for method, source in (("m2", "wiggle"), ("ekf", "wiggle"), ("map", "free")):
        run("process", FILES / f"{source}.zip", "--method", method, "--out", work / method, "--option", OPTIONS[method])
        if method != "map":
            pack(work / method, FILES / f"derivative_{method}.zip")
    calibration = next((work / "map").rglob("*_calibration.json"))
    shutil.copy(calibration, FILES / "self_calibration.json")
    run("assess", FILES / "wiggle.zip", "--method", "m2", "--out", FILES / "assessed", "--patient", "F-001")
    run("calibrate-strip", FILES / "laid_down.zip", "--out", FILES / "strip_calibration.json")
    run("learn-magnet", FILES / "reach.zip", "--out", FILES / "magnet_setup.json")
    words = ["--array", FILES / "array.json", "--turned", FILES / "turned.csv"]
    run("locate", FILES / "magnet.csv", *words, "--out", FILES / "located.tsv")
    run("compare", FILES / "derivative_m2.zip", FILES / "derivative_ekf.zip", "--out", work / "compared")
    shutil.copy(work / "compared" / "comparison.json", FILES / "comparison.json")


OPTIONS = {"m2": "gyr_reading=instant", "ekf": "gyr_reading=instant", "map": "longest=20"}


def pack(folder: Path, target: Path) -> None:
    """A folder as a zip, its files in order of name."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for path in sorted(p for p in folder.rglob("*") if not p.is_symlink()):
            archive.write(path, path.relative_to(folder))


def make_data_folder(work: Path) -> None:
    """A data folder as a server leaves it, zipped, and its backup."""
    data = work / "data"
    (data / "protocols").mkdir(parents=True)
    (data / "protocols" / "short_taps.json").write_text(json.dumps(OWN_TASK, indent=2) + "\n")
    with served(data) as client:
        first, second = (client.post("/api/patients", json=about).json()["id"] for about in (PATIENT, {"pseudonym": "F-002"}))
        facts = {"version": 1, "hand_measures": {"left": MEASURES}, "trunk_height": 0.41}
        assert client.patch(f"/api/patients/{first}", json=facts).status_code == 200
        for text in ("Glove on the left hand, little swelling.", "Written by mistake."):
            note = client.post(f"/api/patients/{first}/notes", json={"text": text}).json()
        client.patch(f"/api/notes/{note['id']}", json={"version": note["version"], "removed": True})
        measure_live(client, first, work / "glove", data)
        upload(client, first, second)
    run("account", "add", "anna", "--role", "clinician", "--role", "scientist", "--data", data)
    with mock.patch("sys.stdin", io.StringIO(f"{PASSWORD}\n")):
        run("account", "password", "anna", "--data", data)
    for passing in ("address", "tokens", "incoming"):
        shutil.rmtree(data / passing, ignore_errors=True)
        (data / passing).unlink(missing_ok=True)
    with contextlib.closing(sqlite3.connect(data / "handscope.sqlite")) as db:
        db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    run("backup", FILES / "backup.zip", "--data", data)
    pack(data, FILES / "data.zip")


def until(condition: Callable[[], Any]) -> Any:
    end = time.monotonic() + WAIT
    while not (value := condition()):
        assert time.monotonic() < end, "what is waited for did not happen"
        time.sleep(0.1)
    return value


def measure_live(client: TestClient, patient: int, glove: Path, data: Path) -> None:
    """A live session with the force sensors' calibration kept: initial pose, an own task, one skipped."""
    words = ("--strips", "thumb,index,force", "--rate", "20", "--force-setup", str(FILES / "force_setup.json"), "--untold")
    with virtual_glove(glove, *words) as port:
        for finger in ("thumb", "index"):
            run("calibrate-force", FILES / "loads.csv", "--finger", finger, "--keep", port, "--data", data)
        begun = client.post(f"/api/patients/{patient}/sessions", json={"hand": "left", "port": str(port), "examiner": "anna"})
        assert begun.status_code == 201, begun.text
        at = f"/api/stations/{begun.json()['station']}"
        for state, act in (
            ("connect", {"action": "continue"}),
            ("pose_ready", {"action": "start"}),
            ("pose_review", {"action": "accept"}),
            ("tasks", {"action": "choose", "task": "short_taps"}),
            ("task_ready", {"action": "start"}),
            ("task_review", {"action": "accept"}),
            ("tasks", {"action": "choose", "task": "tapping"}),
            ("task_ready", {"action": "skip", "reason": "Pain"}),
            ("tasks", {"action": "finish"}),
        ):
            until(lambda state=state: client.get(at).json()["wizard"]["state"] == state)
            until(lambda act=act: client.post(f"{at}/actions", json=act).status_code == 200)
        until(lambda: client.get(at).status_code == 404)
    session = begun.json()["session"]
    until(lambda: client.get(f"/api/sessions/{session}").json()["state"] == "processed")
    answer = client.patch(f"/api/sessions/{session}", json={"version": 1, "notes": "Calm, a little tired."})
    assert answer.status_code == 200, answer.text


def upload(client: TestClient, first: int, second: int) -> None:
    """Recordings made elsewhere: results by three methods and with options, a correction, a self-calibration kept and taken over."""
    path = FILES / "wiggle.zip"
    made = client.post(f"/api/patients/{first}/recordings", files={"file": (path.name, path.read_bytes())}).json()
    done(client, made["result"])
    file = client.get(f"/api/sessions/{made['session']}").json()["recordings"][0]
    event = next(k for k, e in enumerate(file["summary"]["events"]) if e["trial_type"] == "task")
    wish = {"event": event, "kind": "leave_out", "reason": "Glove slipped", "onset": 8.0, "end": 9.0}
    corrected = client.post(f"/api/recordings/{file['id']}/corrections", json=wish).json()
    for pair in corrected["results"]:
        done(client, pair["now"])
    for method, options in (("ekf", {}), ("m2", {"alignment": "heading"})):
        again = client.post(f"/api/sessions/{made['session']}/results", json={"method": method, "options": options}).json()
        done(client, again["result"])
    path = FILES / "free.zip"
    free = client.post(f"/api/patients/{second}/recordings", files={"file": (path.name, path.read_bytes())}, data={"method": "map"}).json()
    done(client, free["result"])
    kept = client.post(f"/api/patients/{second}/self-calibrations", json={"result": free["result"]}).json()
    m2 = client.post(f"/api/sessions/{free['session']}/results", json={"method": "m2", "options": {}}).json()
    done(client, m2["result"])
    decided = client.put(f"/api/sessions/{free['session']}/reuse", json={"parts": "lengths", "self_calibration": kept["id"]}).json()
    for pair in decided["results"]:
        done(client, pair["now"])


def done(client: TestClient, result: int) -> None:
    until(lambda: client.get(f"/api/results/{result}").json()["state"] not in ("queued", "running"))
    found = client.get(f"/api/results/{result}").json()
    assert found["state"] == "done", found["error"]


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    make()
