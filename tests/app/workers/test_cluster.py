"""Reports, exports and self-calibrations on a Dask cluster: a scheduler and two workers of this machine, on loopback."""

import asyncio
import os
import time
import zipfile
from collections.abc import Awaitable, Callable, Iterator
from io import BytesIO
from multiprocessing import forkserver
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from handscope.app.auth.gate import new_token
from handscope.app.documents import Documents, LeftError, make_report
from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.app.workers.cluster import ClusterWorker
from handscope.app.workers.process import DiedError, Send, no_context
from handscope.app.workers.self_calibration import SelfCalibrationSolver, _outcome
from handscope.estimators.errors import InputError
from handscope.sessions.motion_bids import writer
from handscope.sessions.store.store import Store, open_store
from tests.simulated import loaded, pose_and_wiggle

distributed = pytest.importorskip("distributed", reason="Dask is not installed: make lock")
dask = pytest.importorskip("dask")

NOBODY = "tcp://127.0.0.1:9"
CHEAP = {
    "distributed.worker.multiprocessing-method": "forkserver",  # else each imports everything anew
    "distributed.scheduler.allowed-failures": 1,  # of 3: two workers die in place of four
}


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    forkserver.ensure_running()  # with what CONTEXT preloads, not with what Dask does
    with (
        dask.config.set(CHEAP),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", memory_limit=None
        ) as made,
    ):
        yield made


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return open_store(tmp_path)


@pytest.fixture
def documents(store: Store, cluster: Any) -> Iterator[Documents]:
    with Documents(store, cluster.scheduler_address) as made:
        yield made


async def stays() -> bool:
    return False


def after(path: Path) -> Callable[[], Awaitable[bool]]:
    """Somebody who leaves as soon as the file is there."""

    async def gone() -> bool:
        return path.exists()

    return gone


def process_of(store: Store) -> tuple[str, int]:
    return store.folder.name, os.getpid()


def die_once(store: Store) -> str:
    mark = store.folder / "died"
    if not mark.exists():
        mark.touch()
        os._exit(3)
    return "done the second time"


def seven(_: None) -> int:
    return 7


def die_always(_: None) -> None:
    os._exit(3)


def wait_long(store: Store) -> None:
    (store.folder / "begun").touch()
    time.sleep(3)


def count(_: None, send: Send, file: str) -> None:
    for k in range(600):
        send(("share", k / 600))
        Path(file).write_text(str(k))
        time.sleep(0.05)


def test_work_is_done_on_the_store_by_a_worker_and_refused_with_its_reason(
    documents: Documents, store: Store
) -> None:
    folder, process = asyncio.run(documents.run(stays, process_of))
    assert folder == store.folder.name
    assert process != os.getpid()
    with pytest.raises(InputError, match="there is no result 99"):
        asyncio.run(documents.run(stays, make_report, 99, "pdf"))


def test_what_a_worker_that_died_was_doing_is_done_by_another(documents: Documents) -> None:
    assert asyncio.run(documents.run(stays, die_once)) == "done the second time"


def test_work_of_which_every_worker_dies_ends_and_the_next_is_done(cluster: Any) -> None:
    worker = ClusterWorker(cluster.scheduler_address, no_context)
    with pytest.raises(DiedError):
        worker.do(die_always)
    assert worker.do(seven) == 7


def test_one_who_leaves_does_not_wait(documents: Documents, store: Store) -> None:
    with pytest.raises(LeftError):
        asyncio.run(documents.run(after(store.folder / "begun"), wait_long))
    assert asyncio.run(documents.run(stays, process_of))[0] == store.folder.name


def test_progress_comes_and_work_that_tells_it_ends_when_it_is_stopped(
    cluster: Any, tmp_path: Path
) -> None:
    worker, file = ClusterWorker(cluster.scheduler_address, no_context), tmp_path / "counted"
    shares = worker.stream(count, str(file))
    assert [next(shares) for _ in range(5)] == [("share", k / 600) for k in range(5)]
    worker.kill()
    with pytest.raises(DiedError):
        list(shares)
    time.sleep(1.0)  # the worker notices at its next message
    counted = file.read_text()
    time.sleep(0.5)
    assert file.read_text() == counted


def test_a_self_calibration_tells_what_one_on_this_machine_tells(cluster: Any) -> None:
    recording = loaded(pose_and_wiggle("left"))
    solver = SelfCalibrationSolver(recording, cluster.scheduler_address)
    until = time.monotonic() + 120
    while not solver.is_over:
        assert time.monotonic() < until
        time.sleep(0.1)
    solver.close()
    name, value = _outcome(recording, lambda share: None)
    assert str(getattr(solver, name)) == str(value)


def test_a_scheduler_that_does_not_answer_is_named(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("handscope.app.workers.cluster.PATIENCE", 0.5)
    with (
        Documents(store, NOBODY) as documents,
        pytest.raises(InputError, match=f"scheduler {NOBODY} cannot be reached"),
    ):
        asyncio.run(documents.run(stays, process_of))
    solver = SelfCalibrationSolver(loaded(pose_and_wiggle("left")), NOBODY)
    while not solver.is_over:
        time.sleep(0.05)
    solver.close()
    assert NOBODY in solver.refusal


class Seen(distributed.diagnostics.plugin.SchedulerPlugin):  # type: ignore[misc]
    """The tasks that were done."""

    def __init__(self) -> None:
        self.keys: list[str] = []

    def transition(self, key: str, start: str, finish: str, *_: Any, **__: Any) -> None:
        if finish == "memory":
            self.keys.append(key)


def test_a_server_has_its_reports_and_exports_made_there(cluster: Any, tmp_path: Path) -> None:
    seen = Seen()
    cluster.scheduler.add_plugin(seen)
    settings = Settings(data=tmp_path, scheduler=cluster.scheduler_address)
    packed = writer.pack(writer.tree(loaded(pose_and_wiggle("left")), "01", "wiggle"))
    with TestClient(create_app(settings), base_url="http://127.0.0.1:8420") as client:
        client.post("/api/login", json={"token": new_token(settings.data)})
        patient = client.post("/api/patients", json={"pseudonym": "P-1"}).json()["id"]
        uploaded = client.post(
            f"/api/patients/{patient}/recordings", files={"file": ("r.zip", packed)}
        ).json()
        base, until = f"/api/results/{uploaded['result']}", time.monotonic() + 60
        while client.get(base).json()["state"] in ("queued", "running"):
            assert time.monotonic() < until
            time.sleep(0.1)
        assert client.get(f"{base}/report.pdf").content.startswith(b"%PDF")
        with zipfile.ZipFile(BytesIO(client.get(f"{base}/exports/opensim").content)) as model:
            assert set(model.namelist()) == {"motion.mot", "orientations.sto", "hand.osim"}
    assert [key.rpartition("-")[0] for key in seen.keys] == [
        "handscope-make_report",
        "handscope-make_export",
    ]
