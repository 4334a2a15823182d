"""ASVS 5, 14.1 and 11.7: with a data key nothing of the data folder's files is plain, everything works as before, and another key takes its place."""

import hashlib
import io
import json
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from handscope.app.auth.gate import new_token
from handscope.app.cli import main
from handscope.app.results import make as making
from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.app.version import software_version
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import patients, results
from handscope.sessions.files import native
from handscope.sessions.files.recorder import Recorder
from handscope.sessions.hand_photographs import photographs
from handscope.sessions.motion_bids import writer
from handscope.sessions.sealing.keys import VARIABLE
from handscope.sessions.sealing.stored import is_sealed, open_stored
from handscope.sessions.store import crash_repair, erasure, records
from handscope.sessions.store.store import Store, open_store
from tests.sessions.store.left_open import write_left_open
from tests.simulated import loaded, pose_and_wiggle

pytest.importorskip("cryptography")
PICTURE = b"\xff\xd8 a picture"


@pytest.fixture
def key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    assert main(["data-key", "make", str(tmp_path / "key")]) == 0
    monkeypatch.setenv(VARIABLE, str(tmp_path / "key"))
    return tmp_path / "key"


@pytest.fixture
def store(key: Path, tmp_path: Path) -> Iterator[Store]:
    opened = open_store(tmp_path / "data")
    yield opened
    opened.close()


def _upload(store: Store) -> int:
    """A session with a result and its files; the patient has a photograph. Gives the result's number."""
    place = store.incoming / "r.zip"
    place.write_bytes(writer.pack(writer.tree(loaded(pose_and_wiggle("left")), "01", "wiggle")))
    with store.database() as db:
        patient = patients.create(db, "P-1")
        made = {"geometry": {}, "initial_pose": {}}
        photographs.store(db, patient, "left", {}, made, software_version(), PICTURE)
        session = records.add_upload(db, store, patient, place, "r.zip", None)
        queued = results.find_matching(db, session.recordings[0], "m2", {}, software_version()).id
    making.make(store, queued)
    return queued


def _files(store: Store) -> list[Path]:
    places = (store.folder / name for name in ("recordings", "results"))
    return [p for place in places for p in place.iterdir()]


def test_recordings_and_results_lie_sealed_and_are_read_as_ever(store: Store) -> None:
    number = _upload(store)
    assert len(_files(store)) == 3
    assert all(is_sealed(path) for path in _files(store))
    assert PICTURE not in (store.folder / "handscope.sqlite").read_bytes()
    with store.database() as db:
        result = results.get(db, number)
        assert (result.state, result.error) == ("done", "")
        assert len(making.load_replay(store, result)["t"]) > 100
        assert records.open_recording(store, result.recording).duration > 1.0
        assert photographs.picture_of(photographs.get(db, 1)) == PICTURE


def test_a_live_recording_is_sealed_as_it_grows_and_listed_from_its_ends(store: Store) -> None:
    with store.database() as db:
        session, file = records.begin(db, store, patients.create(db, "P-1"), "left", {})
        path = store.path_of(file.file)
        write_left_open(path, 0.5, stored=True)
        assert is_sealed(path)
        assert crash_repair.close_from_ends(db, store, session.id).state == "recorded"
        assert crash_repair.read_whole(db, store, session.id).state == "recorded"
        assert file.summary["events"]


def test_a_killed_recorder_has_lost_nothing_that_it_wrote(key: Path, tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "r.mcap", {"hand": "left"}, 0.0, stored=True)
    for k in range(100):
        recorder.write(bytes([k]) * 50, 0.01 * k)
    shutil.copy(tmp_path / "r.mcap", tmp_path / "killed.mcap")  # as the disk is at this moment
    recorder.close()
    contents = native.read(tmp_path / "killed.mcap")
    assert [data[0] for _, data in contents.wire] == list(range(100))
    assert contents.file.damaged == 0


def test_without_the_key_nothing_opens_and_the_folder_is_refused(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    _upload(store)
    monkeypatch.delenv(VARIABLE)
    with pytest.raises(InputError, match="is sealed by a key that is not named"):
        open_stored(_files(store)[0])
    with pytest.raises(InputError, match="is sealed, and no key is named"):
        open_store(store.folder)


def test_another_key_takes_the_place_of_one_and_the_first_opens_nothing(
    store: Store, key: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    number, new = _upload(store), tmp_path / "new"
    assert main(["data-key", "make", str(new)]) == 0
    sizes = {path: path.stat().st_size for path in _files(store)}
    words = ["data-key", "change", "--key", str(key), "--new", str(new)]
    assert main([*words, "--data", str(store.folder)]) == 0
    assert {path: path.stat().st_size for path in _files(store)} == sizes
    with pytest.raises(InputError, match="key"):
        open_stored(_files(store)[0])
    monkeypatch.setenv(VARIABLE, str(new))
    with store.database() as db:
        assert len(making.load_replay(store, results.get(db, number))["t"]) > 100
        assert photographs.picture_of(photographs.get(db, 1)) == PICTURE
    assert main([*words, "--data", str(store.folder)]) == 0  # again does no harm


def test_what_lay_plain_is_sealed_in_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = open_store(tmp_path / "data")
    number = _upload(store)
    with store.database() as db:
        file = results.get(db, number).recording
        path, sha256 = store.path_of(file.file), file.sha256
    words = ["data-key", "seal", "--data", str(store.folder)]
    assert main(words) == 2  # no key is named
    assert main(["data-key", "make", str(tmp_path / "key")]) == 0
    monkeypatch.setenv(VARIABLE, str(tmp_path / "key"))
    assert main(words) == 0
    assert all(is_sealed(p) for p in _files(store))
    assert native.file_checksum(path) == sha256
    with store.database() as db:
        assert photographs.picture_of(photographs.get(db, 1)) == PICTURE
    store.close()


def test_a_backup_of_sealed_data_is_sealed_and_is_restored_sealed(
    store: Store, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pyrage")
    _upload(store)
    words = ["backup", str(tmp_path / "b.zip.age"), "--data", str(store.folder)]
    assert main(words) == 2
    assert "--recipient" in capsys.readouterr().err
    assert main(["backup-key", "make", str(tmp_path / "backup-key")]) == 0
    recipient = capsys.readouterr().out.split()[-1]
    assert main([*words, "--recipient", recipient]) == 0
    back = ["restore", str(tmp_path / "b.zip.age"), "--key", str(tmp_path / "backup-key")]
    assert main([*back, "--data", str(tmp_path / "new")]) == 0
    restored = open_store(tmp_path / "new")
    assert len(_files(restored)) == 3
    assert all(is_sealed(path) for path in _files(restored))
    with restored.database() as db:
        file = results.get(db, 1).recording
        assert native.file_checksum(restored.path_of(file.file)) == file.sha256
        assert photographs.picture_of(photographs.get(db, 1)) == PICTURE
    restored.close()


def test_a_download_and_an_export_hold_what_was_recorded(store: Store) -> None:
    _upload(store)
    with store.database() as db:
        sha256 = results.get(db, 1).recording.sha256
    app = create_app(Settings(data=store.folder))
    with TestClient(app, base_url="http://127.0.0.1:8420") as client:
        client.post("/api/login", json={"token": new_token(store.folder)})
        assert hashlib.sha256(client.get("/api/recordings/1/file").content).hexdigest() == sha256
        exported = client.get("/api/patients/1/export.zip").content
    with zipfile.ZipFile(io.BytesIO(exported)) as archive:
        assert json.loads(archive.read("manifest.json"))["problems"] == []
        assert archive.read("photographs/1.jpg") == PICTURE


def test_an_erased_patient_s_sealed_files_are_gone(store: Store) -> None:
    _upload(store)
    with store.database() as db:
        erasure.erase(db, store, 1, "P-1")
    assert _files(store) == []


@pytest.mark.process
def test_a_command_of_its_own_reads_a_sealed_recording_by_the_key(
    store: Store, tmp_path: Path
) -> None:
    _upload(store)
    [recording] = (store.folder / "recordings").iterdir()
    words = [sys.executable, "-P", "-m", "handscope.app.cli", "info", str(recording)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
