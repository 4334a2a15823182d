"""Sessions that a killed server left open are closed while the next one serves already."""

from pathlib import Path

from handscope.app.workers.session_repair import SessionRepair
from handscope.sessions.clinic import patients
from handscope.sessions.files import native
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from handscope.sessions.store import records
from handscope.sessions.store.store import Store, open_store
from tests.faults.victim import wait_for
from tests.security.conftest import locked
from tests.sessions.store.left_open import write_left_open
from tests.simulated import pose_and_wiggle


def _left_open(store: Store) -> list[int]:
    """A session with a recording, and one whose recording never began."""
    made = pose_and_wiggle("left")
    recording = LoadedRecording(
        made.hand, made.geometry, {}, made.samples, made.events, source={"device": "simulated"}
    )
    with store.database() as db:
        patient = patients.create(db, "P-1")
        whole, file = records.begin(db, store, patient, "left", {})
        file.format, file.file = "motion-bids", "recordings/r.zip"
        store.path_of(file.file).write_bytes(writer.pack(writer.tree(recording, "01", "wiggle")))
        empty, _ = records.begin(db, store, patient, "left", {})
        db.commit()
        return [whole.id, empty.id]


def test_sessions_are_repaired_one_after_the_other_while_others_work(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    sessions, finished = _left_open(store), list[int]()
    with SessionRepair(store, sessions, [], finished.append) as repair:
        with locked(tmp_path):  # it cannot have ended yet
            assert [repair.progress(s) for s in sessions] == [(1, 2), (1, 2)]
        wait_for(lambda: repair.progress(sessions[-1]) is None)
        assert repair.progress(sessions[0]) is None
    with store.database() as db:
        assert [records.get(db, s).state for s in sessions] == ["recorded", "failed"]
    assert finished == [sessions[0]]
    store.close()


def test_leaving_stops_a_repair_and_the_session_stays_open_for_the_next_start(
    tmp_path: Path,
) -> None:
    store = open_store(tmp_path)
    sessions, finished = _left_open(store), list[int]()
    with locked(tmp_path), SessionRepair(store, sessions, [], finished.append):
        pass
    with store.database() as db:
        assert [session.id for session in records.list_abandoned(db)] == sessions
    assert finished == []
    store.close()


def test_a_long_recording_is_closed_from_its_ends_then_read_whole_then_processed(
    tmp_path: Path,
) -> None:
    store, finished = open_store(tmp_path), list[int]()
    with store.database() as db:
        session, file = records.begin(db, store, patients.create(db, "P-1"), "left", {})
        write_left_open(store.path_of(file.file), 0.5)
        number, path = session.id, store.path_of(file.file)
    states = []

    def finish(session: int) -> None:
        with store.database() as db:
            states.append(records.get(db, session).recordings[0].sha256)
        finished.append(session)

    with SessionRepair(store, [number], [], finish) as repair:
        wait_for(lambda: finished)
        assert (repair.progress(number), repair.reading(number)) in [(None, None), (None, (1, 1))]
    assert states == [native.file_checksum(path)]
    store.close()
