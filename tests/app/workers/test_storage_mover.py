"""A server with an object storage: recordings move there while it runs, pages read them from there, and whoever watches is told how that goes."""

import shutil
import socket
import urllib.request
from pathlib import Path

import fsspec
import pytest
from starlette.testclient import TestClient

from handscope.app.auth.gate import new_token
from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.app.workers import storage_mover
from handscope.sessions.motion_bids import writer
from tests import object_store
from tests.app.api.test_recordings import upload
from tests.app.devices.virtual import wait_for
from tests.simulated import loaded, pose_and_wiggle


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.mark.slow
def test_a_recording_moves_away_and_pages_still_have_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(storage_mover, "PAUSE", 0.3)
    with object_store.server() as server:
        url, port = f"s3://{object_store.BUCKET}/site", free_port()
        app = create_app(Settings(data=tmp_path, recordings=url, metrics=("127.0.0.1", port)))
        with TestClient(app, base_url="http://127.0.0.1:8420") as client:

            def health() -> dict[str, object]:
                return dict(client.get("/api/health").json()["object_storage"])

            client.post("/api/login", json={"token": new_token(tmp_path)})
            patient = client.post("/api/patients", json={"pseudonym": "P-1"}).json()["id"]
            packed = writer.pack(writer.tree(loaded(pose_and_wiggle("left")), "01", "wiggle"))
            made = upload(client, patient, packed).json()
            assert wait_for(
                lambda: client.get(f"/api/results/{made['result']}").json()["state"] == "done"
            )
            fs, root = fsspec.core.url_to_fs(url, use_listings_cache=False)
            assert wait_for(
                lambda: len(fs.find(root)) == 4 and not any((tmp_path / "recordings").iterdir())
            )  # ours, recording, replay, report
            assert wait_for(lambda: health() == {"status": "ok", "files_waiting": 0})
            shutil.rmtree(tmp_path / "cache")
            recording = client.get(f"/api/sessions/{made['session']}").json()["recordings"][0]["id"]
            assert client.get(f"/api/recordings/{recording}/file").content == packed
            assert client.get(f"/api/results/{made['result']}/report.json").status_code == 200
            server.stop()
            shutil.rmtree(tmp_path / "cache")
            assert wait_for(lambda: health()["status"] == "cannot be used")
            told = client.get(
                f"/api/recordings/{recording}/file", headers={"Accept-Language": "de"}
            )
            assert told.status_code == 422 and told.json()["error"].startswith(
                f"Der Objektspeicher {url} ist nicht zu erreichen ("
            )
            again = upload(client, patient, packed).json()
            assert again["session"] != made["session"], "what comes meanwhile is kept here"
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics") as answer:
                assert "handscope_object_storage_up 0.0" in answer.read().decode()
            server.start()
            assert wait_for(
                lambda: health()["status"] == "ok" and not any((tmp_path / "recordings").iterdir())
            )
