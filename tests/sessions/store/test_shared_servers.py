"""Several servers on one PostgreSQL database and one object storage: each keeps what is its own, and none takes another's for its own."""

from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import pytest

from handscope.estimators.errors import InputError
from handscope.sessions.clinic import patients, results
from handscope.sessions.db.patientless_tables import ErasedFile, Server
from handscope.sessions.db.tables import Result
from handscope.sessions.files import object_storage
from handscope.sessions.files.native import file_checksum
from handscope.sessions.store import erasure, records, shared_servers, stored_files
from handscope.sessions.store.database import connect, upgrade
from handscope.sessions.store.folder_lock import hold_folder
from handscope.sessions.store.store import Store, open_store, store_at
from tests import postgres

ROOM = 10**9


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    with postgres.server() as found:
        yield found


@pytest.fixture
def url(server: str) -> Iterator[str]:
    with postgres.empty_database(server) as found:
        yield found


@pytest.fixture
def stores(url: str, tmp_path: Path) -> Iterator[tuple[Store, Store]]:
    """Two servers that share the database and a storage."""
    away = f"file://{tmp_path / 'away'}"
    pair = tuple(
        open_store(tmp_path / name, url, away, f"https://{name}.example.org")
        for name in ("one", "two")
    )
    yield pair[0], pair[1]
    for store in pair:
        store.close()


def recorded(store: Store, pseudonym: str, closed: bool) -> tuple[int, int]:
    """A session that this server records, or whose recording is closed with a result; numbers of patient and session."""
    with store.database() as db:
        patient = patients.create(db, pseudonym)
        session, file = records.begin(db, store, patient, "left", {})
        store.path_of(file.file).write_bytes(b"samples")
        if closed:
            file.sha256, session.state = file_checksum(store.path_of(file.file)), "processed"
            db.add(
                Result(
                    recording=file,
                    key="k",
                    method="m2",
                    version="1",
                    state="done",
                    server=store.server,
                )
            )
        db.commit()
        return patient.id, session.id


def test_each_finishes_its_own_sessions_and_results_alone(stores: tuple[Store, Store]) -> None:
    one, two = stores
    _, first = recorded(one, "P-1", closed=False)
    _, second = recorded(two, "P-2", closed=False)
    with one.database() as db:
        assert [s.id for s in records.list_abandoned(db, one.server)] == [first]
        assert [s.id for s in records.list_abandoned(db, two.server)] == [second]
        assert [s.id for s in records.list_abandoned(db)] == [first, second]
        file = records.get(db, second).recordings[0]
        made = results.find_matching(db, file, "m2", {}, "1", two.server)
        assert results.unfinished(db, one.server) == []
        assert results.unfinished(db, two.server) == [made.id]
        other = shared_servers.find_other(db, file.server, one.server)
        assert other and (other.address, other.answers) == ("https://two.example.org", True)
        assert shared_servers.find_other(db, file.server, two.server) is None


def test_a_recording_is_read_everywhere_once_it_is_in_the_storage(
    stores: tuple[Store, Store],
) -> None:
    one, two = stores
    _, session = recorded(one, "P-1", closed=True)
    with two.database() as db:
        file = records.get(db, session).recordings[0]
    with pytest.raises(InputError, match="still lies at the server"):
        stored_files.fetch_local(two, file.file, file.sha256)
    assert stored_files.move_out(one, ROOM).moved == 1
    assert stored_files.fetch_local(two, file.file, file.sha256).read_bytes() == b"samples"


def test_a_patient_erased_at_one_server_leaves_nothing_at_another(
    stores: tuple[Store, Store], tmp_path: Path
) -> None:
    one, two = stores
    moved, moved_session = recorded(one, "P-1", closed=True)
    stored_files.move_out(one, ROOM)
    kept, _ = recorded(one, "P-2", closed=True)
    (one.folder / "results").mkdir(exist_ok=True)
    (one.folder / "results" / "999.npz").write_bytes(b"of a result that another server erased")
    being_written = one.folder / "results" / ".1000.npz.partial"
    being_written.write_bytes(b"of a result that is computed")
    with two.database() as db:
        file = records.get(db, moved_session).recordings[0].file
        stored_files.fetch_local(two, file)
        for patient, pseudonym in ((moved, "P-1"), (kept, "P-2")):
            erasure.erase(db, two, patient, pseudonym)
    assert list((one.folder / "recordings").iterdir()), "the other server has not looked yet"
    for store in (one, two, one):
        stored_files.move_out(store, ROOM)
    left = [
        p for p in tmp_path.rglob("*") if p.is_file() and p.parent.name in ("recordings", "results")
    ]
    assert left == [being_written]
    with one.database() as db:
        assert db.query(ErasedFile).count() == 0


def test_an_upload_that_another_server_receives_is_not_taken_for_a_leftover(
    stores: tuple[Store, Store], url: str
) -> None:
    one, two = stores
    with one.database() as db:
        db.add(ErasedFile(file="recordings/upload.mcap", server=one.server))
        db.commit()
    open_store(two.folder, url).close()
    with one.database() as db:
        assert db.get(ErasedFile, "recordings/upload.mcap") is not None


def test_the_first_that_shares_keeps_what_it_recorded_before(url: str, tmp_path: Path) -> None:
    away = f"file://{tmp_path / 'away'}"
    alone = open_store(tmp_path / "one", url, away)
    _, session = recorded(alone, "P-1", closed=True)
    alone.close()
    shared = open_store(tmp_path / "one", url, None, "")
    with shared.database() as db:
        assert records.get(db, session).recordings[0].server == shared.server != ""
    shared.close()
    again = store_at(tmp_path / "one", url)
    again.close()
    assert again.server == shared.server, "kept in the folder"


def test_what_cannot_be_shared_is_refused(url: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="PostgreSQL"):
        open_store(tmp_path / "a", None, f"file://{tmp_path / 'away'}", "")
    with pytest.raises(InputError, match="--recordings"):
        open_store(tmp_path / "b", url, None, "")
    open_store(tmp_path / "one", url, f"file://{tmp_path / 'away'}", "").close()
    with pytest.raises(InputError, match="not the object storage of the other servers"):
        open_store(tmp_path / "two", url, f"file://{tmp_path / 'elsewhere'}", "")
    (tmp_path / "old" / "results").mkdir(parents=True)
    (tmp_path / "old" / "results" / "1.npz").write_bytes(b"of another clinic's result 1")
    with pytest.raises(InputError, match="begins with an empty"):
        open_store(tmp_path / "old", url, f"file://{tmp_path / 'away'}", "")
    with pytest.raises(InputError, match="another data folder"):
        open_store(tmp_path / "three", url, f"file://{tmp_path / 'away'}")


def test_the_database_is_held_by_one_alone_or_by_several_that_share_it(
    url: str, tmp_path: Path
) -> None:
    a, b = tmp_path / "a", tmp_path / "b"
    with hold_folder(a, url):
        assert refusal(b, url, shared=True).startswith("the database is in use by process")
    with hold_folder(a, url, shared=True):
        assert refusal(b, url).startswith("the database is in use by process")
        assert "stop every server" in refusal(b, url, shared=True), "the schema is older"
    bring_up_to_date(url)
    with hold_folder(a, url, shared=True):
        assert refusal(b, url, shared=True) == ""


def test_a_copy_of_a_data_folder_does_not_start_beside_it(
    stores: tuple[Store, Store], url: str, tmp_path: Path
) -> None:
    copy, mark = tmp_path / "copy", shared_servers.MARK
    copy.mkdir()
    (copy / mark).write_bytes((stores[0].folder / mark).read_bytes())
    with hold_folder(stores[0].folder, url):
        assert "a copy of this data folder" in refusal(copy, url)
        assert refusal(stores[1].folder, url) == ""


def refusal(folder: Path, url: str, shared: bool = False) -> str:
    """Why a server may not start; "" where it may."""
    try:
        with hold_folder(folder, url, shared):
            return ""
    except InputError as why:
        return str(why)


def bring_up_to_date(url: str) -> None:
    engine = connect(Path(), url)
    upgrade(engine)
    engine.dispose()


def test_a_server_that_is_silent_for_a_minute_does_not_answer(
    stores: tuple[Store, Store],
) -> None:
    one, two = stores
    with one.database() as db:
        db.get_one(Server, two.server).seen -= timedelta(minutes=2)
        db.commit()
        assert [o.answers for o in shared_servers.list_others(db, one.server)] == [False]
        shared_servers.record_heartbeat(db, two.server)
        assert [o.answers for o in shared_servers.list_others(db, one.server)] == [True]


def test_what_a_lost_server_left_open_is_anothers_once_it_is_retired(
    stores: tuple[Store, Store],
) -> None:
    one, two = stores
    _, session = recorded(two, "P-1", closed=False)
    with one.database() as db:
        name = db.get_one(Server, two.server).name
        with pytest.raises(InputError, match="answers; stop it"):
            shared_servers.retire(db, name, one.server)
        db.get_one(Server, two.server).seen -= timedelta(minutes=2)
        db.commit()
        with pytest.raises(InputError, match="0 other servers are called nobody"):
            shared_servers.retire(db, "nobody", one.server)
        assert shared_servers.retire(db, name, one.server) == 1
        assert [s.id for s in records.list_abandoned(db, one.server)] == [session]
        assert shared_servers.list_others(db, one.server) == []
    assert records.close(one.database(), one, session).state == "failed"


def test_a_file_that_is_erased_while_it_is_moved_does_not_stay_in_the_storage(
    stores: tuple[Store, Store], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, two = stores
    patient, _ = recorded(one, "P-1", closed=True)
    put = object_storage.put

    def erase_meanwhile(*given: object) -> str:
        with two.database() as db:
            erasure.erase(db, two, patient, "P-1")
        stored_files.move_out(two, ROOM)
        return put(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(object_storage, "put", erase_meanwhile)
    stored_files.move_out(one, ROOM)
    assert [p for p in (tmp_path / "away").rglob("*.mcap") if p.is_file()] == []
