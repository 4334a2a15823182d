"""Long work in its process: whatever ends that process, every result is settled and the queue goes on."""

import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import delete, update

from handscope.app import job_queue
from handscope.app.job_queue import Jobs
from handscope.app.results import make as results_make
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import patients
from handscope.sessions.clinic.results import ATTEMPTS, ENDED, STOPPED, begin, stop
from handscope.sessions.db.tables import PatientSession, RecordingFile, Result
from handscope.sessions.store.store import Store, open_store

WAIT = 120.0  # s until a test gives up
DEATHS: dict[str, Callable[[], object]] = {
    "aborts": os.abort,
    "runs out of memory": lambda: os.kill(os.getpid(), signal.SIGKILL),
    "exits": lambda: os._exit(0),
}


def make(store: Store, result_id: int) -> None:
    """In the working process: what app.results does, with computations that end as their method's name says."""
    results_make.process_result = computed  # type: ignore[assignment]  # of this process only
    results_make.make(store, result_id)


def computed(store: Store, result: Result, progress: Callable[[float], None]) -> None:
    if result.method in DEATHS:
        DEATHS[result.method]()
    if result.method == "has a bug":
        raise ValueError("bug")
    if result.method == "is stopped":
        with store.database() as other:
            stop(other, result.id)
        progress(0.5)
    if result.method == "takes long":
        threading.Event().wait(WAIT)
    if result.method == "is told to end once" and not (told := store.folder / "told").exists():
        told.touch()
        os.kill(os.getpid(), signal.SIGTERM)
    raise InputError(f"{result.method}, attempt {result.attempts}")


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    monkeypatch.setattr(job_queue, "_make", make)
    return open_store(tmp_path)


def queued(store: Store, *methods: str, **state: Any) -> list[int]:
    """Results of these methods in the database."""
    with store.database() as db:
        patient = patients.create(db, "P-1")
        file = RecordingFile(
            session=PatientSession(patient=patient, hand="left"),
            format="native",
            file="recordings/none.mcap",
        )
        made = [
            Result(recording=file, key=str(k), method=m, version="1", **state)
            for k, m in enumerate(methods)
        ]
        db.add_all(made)
        db.commit()
        return [r.id for r in made]


def told(store: Store, result_id: int) -> tuple[str, str, int]:
    with store.database() as db:
        result = db.get(Result, result_id)
        assert result is not None
        return result.state, result.error, result.attempts


def settled(store: Store, result_id: int) -> tuple[str, str]:
    """State and error as soon as the result is neither queued nor running."""
    until = time.monotonic() + WAIT
    while (now := told(store, result_id))[0] in ("queued", "running"):
        assert time.monotonic() < until, now
        time.sleep(0.01)
    return now[:2]


@pytest.fixture
def quick_leaving(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(job_queue, "CLOSE_WAIT", 0.05)


@pytest.mark.parametrize("death", DEATHS)
def test_a_result_whose_process_dies_is_failed_and_those_behind_it_are_computed(
    death: str, store: Store
) -> None:
    first, second = queued(store, death, "refused")
    with Jobs(store):
        assert settled(store, first) == ("failed", ENDED)
        assert settled(store, second) == ("failed", "refused, attempt 1")
    with Jobs(store):
        pass
    assert told(store, first) == ("failed", ENDED, 1)


def test_a_result_whose_computation_has_a_bug_is_failed(store: Store) -> None:
    (only,) = queued(store, "has a bug")
    with Jobs(store):
        assert settled(store, only) == ("failed", ENDED)


def test_a_result_that_somebody_stopped_ends_with_its_next_step_or_does_not_begin(
    store: Store,
) -> None:
    running, waiting, behind = queued(store, "is stopped", "refused", "refused")
    with store.database() as db:
        stop(db, waiting)
    with Jobs(store):
        assert settled(store, behind) == ("failed", "refused, attempt 1")
    assert told(store, running) == ("failed", STOPPED, 1)
    assert told(store, waiting) == ("failed", STOPPED, 0)


def test_a_server_that_died_computing_takes_the_result_up_once(store: Store) -> None:
    once, often = queued(store, "once", "often", state="running", attempts=1)
    with store.database() as db:
        db.get_one(Result, often).attempts = ATTEMPTS
        db.commit()
    with Jobs(store):
        assert settled(store, once) == ("failed", "once, attempt 2")
        assert settled(store, often) == ("failed", ENDED)


def test_a_process_told_to_end_leaves_its_result_to_the_next(store: Store) -> None:
    (only,) = queued(store, "is told to end once")
    with Jobs(store):
        assert settled(store, only) == ("failed", "is told to end once, attempt 1")


def test_leaving_does_not_wait_for_ever_and_the_next_start_goes_on(
    store: Store, quick_leaving: None
) -> None:
    first, second = queued(store, "takes long", "refused")
    with Jobs(store):
        until = time.monotonic() + WAIT
        while told(store, first)[0] != "running":
            assert time.monotonic() < until
            time.sleep(0.01)
    assert told(store, first) == ("queued", "", 0)
    assert told(store, second) == ("queued", "", 0)


def test_what_was_erased_while_it_was_computed_leaves_nothing(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    (only,) = queued(store, "erased meanwhile")
    replay = store.path_of(results_make.replay_file(only))

    def erased(store: Store, result: Result, progress: object) -> None:
        replay.parent.mkdir()
        replay.write_bytes(b"movement")
        with store.database() as db:
            db.execute(delete(Result))
            db.commit()
        raise InputError("nothing to see")

    monkeypatch.setattr(results_make, "process_result", erased)
    results_make.make(store, only)
    assert not replay.exists()
    results_make.make(store, only)  # it waited in the queue when it was erased


def test_result_settled_by_a_worker_that_outlived_its_server_stays_settled(
    store: Store,
) -> None:
    (only,) = queued(store, "m2", state="running")
    with store.database() as late, store.database() as outlived:
        read = late.get(Result, only)
        outlived.execute(update(Result).values(state="done", progress=1.0))
        outlived.commit()
        assert begin(late, only) is None
        late.refresh(read)
        assert (read.state, read.progress, read.attempts) == ("done", 1.0, 0)
