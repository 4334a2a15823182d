"""A full disk: said in clear words, nothing half-written stays, and when there is room again everything goes on."""

import errno
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from sqlalchemy import event
from sqlalchemy.orm import Session, sessionmaker
from starlette.testclient import TestClient

from handscope.app.api import sessions as session_routes
from handscope.app.results import make as results_make
from handscope.app.settings import Settings
from handscope.sessions.db.tables import PatientSession, RecordingFile, Result
from handscope.sessions.store.store import Store
from handscope.sessions.tables_io import writing
from tests.app.api.conftest import files_in
from tests.app.api.test_recordings import upload


class Full:
    """A file that takes nothing."""

    def __init__(self, handle: int) -> None:
        self._handle = handle

    def __enter__(self) -> "Full":
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._handle)

    def write(self, data: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")


@contextmanager
def no_more_pages(database: sessionmaker[Session]) -> Iterator[None]:
    """SQLite itself says that the database or disk is full."""
    engine: Any = database.kw["bind"]
    limit: Callable[[Any, object], object] = lambda connection, record: connection.execute(  # noqa: E731
        "PRAGMA max_page_count = 1"
    )
    event.listen(engine, "connect", limit)
    engine.dispose()
    try:
        yield
    finally:
        event.remove(engine, "connect", limit)
        engine.dispose()


def test_an_upload_that_finds_no_room_says_so_and_leaves_nothing(
    client: TestClient, patient: int, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = files_in(settings)
    with monkeypatch.context() as full:
        full.setattr(session_routes.os, "fdopen", lambda handle, mode: Full(handle))
        answer = upload(client, patient, b"PK" + bytes(100))
    assert (answer.status_code, "the disk is full" in answer.json()["error"]) == (507, True)
    assert files_in(settings) == before
    assert client.get(f"/api/patients/{patient}").json()["sessions"] == []


def test_a_database_that_finds_no_room_says_so_and_keeps_what_it_had(
    client: TestClient, patient: int
) -> None:
    text = "x" * 15_000  # several pages: more than lie free
    note = client.post(f"/api/patients/{patient}/notes", json={"text": "before"}).json()
    store = client.app.state.parts.store  # type: ignore[attr-defined]
    with no_more_pages(store.database):
        answers = [
            client.post(f"/api/patients/{patient}/notes", json={"text": text}) for _ in range(40)
        ]
        assert (answers[-1].status_code, "the disk is full" in answers[-1].json()["error"]) == (
            507,
            True,
        )
        kept = [a for a in answers if a.status_code == 201]
        assert len(client.get(f"/api/patients/{patient}").json()["notes"]) == 1 + len(
            kept
        )  # reading goes on
    changed = client.patch(
        f"/api/notes/{note['id']}", json={"version": note["version"], "text": "after"}
    )
    assert changed.status_code == 200


@pytest.mark.parametrize("full", ["the file", "the database"])
def test_a_result_that_finds_no_room_is_failed_in_words(
    full: str, client: TestClient, patient: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    store: Store = client.app.state.parts.store  # type: ignore[attr-defined]
    with store.database() as db:
        file = RecordingFile(
            session=PatientSession(patient_id=patient, hand="left"),
            format="native",
            file="recordings/none.mcap",
        )
        result = Result(recording=file, key="k", method="m2", version="1")
        db.add(result)
        db.commit()

    def computed(store: Store, result: Result, progress: object) -> None:
        if full == "the file":
            raise_full = lambda *_: (_ for _ in ()).throw(  # noqa: E731
                OSError(errno.ENOSPC, "No space left on device")
            )
            monkeypatch.setattr(writing.os, "replace", raise_full)
            writing.save_file(b"movement", store.folder / "movement.npz")
        else:
            with no_more_pages(store.database), store.database() as db:
                db.add_all(
                    [
                        Result(
                            recording_id=result.recording_id,
                            key=f"{k}",
                            method="x" * 9000,
                            version="1",
                        )
                        for k in range(60)
                    ]
                )
                db.commit()

    monkeypatch.setattr(results_make, "process_result", computed)
    results_make.make(store, result.id)
    told = client.get(f"/api/results/{result.id}").json()
    assert (told["state"], "the disk is full" in told["error"]) == ("failed", True)
    assert not list(store.folder.glob("*movement*"))
