"""Closed files move into an object storage and none is lost on the way: not by a storage that is away, not by one that gives back something else."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import fsspec
import pytest
from sqlalchemy import select

from handscope.estimators.errors import InputError
from handscope.sessions.clinic import patients
from handscope.sessions.db.tables import ErasedFile, PatientSession, RecordingFile, Result
from handscope.sessions.files import object_storage
from handscope.sessions.files.native import file_checksum
from handscope.sessions.files.object_storage import UnreachableError
from handscope.sessions.store import backup, erasure, stored_files
from handscope.sessions.store.store import Store, open_store, store_at
from handscope.sessions.store.stored_files import Round
from tests import object_store
from tests.object_store import S3Server

ROOM = 10**9
CLOSED, RUNNING, FIGURES = "recordings/closed.mcap", "recordings/runs.mcap", "results/1.npz"


@pytest.fixture(scope="module")
def s3() -> Iterator[S3Server]:
    with object_store.server() as found:
        yield found


@pytest.fixture(params=["s3", "file"])
def url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    if request.param == "file":
        return f"file://{tmp_path / 'away'}"
    request.getfixturevalue("s3")
    return f"s3://{object_store.BUCKET}/{tmp_path.name}"


def filled(folder: Path, url: str | None) -> Store:
    """A patient with a closed recording of 256 kB and its result, and a recording that is still written."""
    store = open_store(folder, None, url)
    (folder / "results").mkdir()
    (folder / CLOSED).write_bytes(bytes(range(256)) * 1_000)
    (folder / RUNNING).write_bytes(b"as far as it goes")
    (folder / FIGURES).write_bytes(b"figures")
    with store.database() as db:
        session = PatientSession(patient=patients.create(db, "P-1"), hand="left", state="processed")
        file = RecordingFile(
            session=session,
            format="native",
            file=CLOSED,
            sha256=file_checksum(folder / CLOSED),
            bytes=256_000,
        )
        db.add(Result(recording=file, key="k", method="m2", version="1", state="done"))
        db.add(RecordingFile(session=session, format="native", file=RUNNING))
        db.commit()
    return store


def lying(folder: Path) -> set[str]:
    return {
        p.relative_to(folder).as_posix()
        for place in ("recordings", "results")
        for p in (folder / place).rglob("*")
        if p.is_file()
    }


def away(url: str) -> dict[str, bytes]:
    """What lies in the storage, by its path there."""
    fs, root = fsspec.core.url_to_fs(url)
    fs.invalidate_cache()
    return {path.partition(f"{root}/")[2]: fs.cat_file(path) for path in fs.find(root)}


def test_what_is_closed_leaves_the_folder_and_is_read_from_the_storage_as_it_was(
    url: str, tmp_path: Path
) -> None:
    store = filled(tmp_path / "data", url)
    whole, sha256 = (store.folder / CLOSED).read_bytes(), file_checksum(store.folder / CLOSED)
    assert stored_files.move_out(store, ROOM) == Round(moved=2, waiting=0, problem="")
    assert lying(store.folder) == {RUNNING}
    assert {name: data for name, data in away(url).items() if "/" in name} == {
        CLOSED: whole,
        FIGURES: b"figures",
    }
    shutil.rmtree(store.folder / "cache")
    other = store_at(store.folder)  # another process: the folder itself knows where its files are
    assert stored_files.fetch_local(other, CLOSED, sha256).read_bytes() == whole
    assert stored_files.fetch_local(other, FIGURES).read_bytes() == b"figures"
    assert stored_files.fetch_local(other, RUNNING) == store.folder / RUNNING
    assert not stored_files.fetch_local(other, "recordings/never.mcap").exists()
    assert stored_files.files_of_result(other, 1) == [FIGURES]
    assert stored_files.move_out(store, ROOM) == Round()


def test_the_cache_lets_go_of_what_was_not_read_for_longest(url: str, tmp_path: Path) -> None:
    store = filled(tmp_path / "data", url)
    stored_files.move_out(store, ROOM)
    stored_files.fetch_local(store, FIGURES)
    stored_files.move_out(store, 1000)
    assert [p.name for p in (store.folder / "cache").rglob("*") if p.is_file()] == ["1.npz"]


def test_what_comes_back_changed_is_refused(url: str, tmp_path: Path) -> None:
    store = filled(tmp_path / "data", url)
    sha256 = file_checksum(store.folder / CLOSED)
    stored_files.move_out(store, 0)
    fs, root = fsspec.core.url_to_fs(url)
    fs.pipe_file(f"{root}/{CLOSED}", b"something else")
    with pytest.raises(
        InputError,
        match="is not what was recorded: its checksum is another; restore it from a backup",
    ):
        stored_files.fetch_local(store, CLOSED, sha256)
    assert list(store.incoming.iterdir()) == [] and not (store.folder / "cache" / CLOSED).exists()


def test_a_recording_that_is_not_what_was_recorded_stays_where_it_is(
    url: str, tmp_path: Path
) -> None:
    store = filled(tmp_path / "data", url)
    (store.folder / CLOSED).write_bytes(b"damaged")
    assert stored_files.move_out(store, ROOM) == Round(moved=1, waiting=1)
    assert lying(store.folder) == {RUNNING, CLOSED} and CLOSED not in away(url)


@pytest.mark.slow
def test_while_the_storage_is_away_everything_waits_in_the_folder(
    s3: S3Server, tmp_path: Path
) -> None:
    url = f"s3://{object_store.BUCKET}/{tmp_path.name}"
    store = filled(tmp_path / "data", url)
    whole = (store.folder / CLOSED).read_bytes()
    s3.stop()
    try:
        before = lying(store.folder)
        found = stored_files.move_out(
            open_store(store.folder), ROOM
        )  # a server starts without it, too
        assert (found.moved, found.waiting) == (0, 2)
        assert found.problem.startswith(
            f"the object storage {url} cannot be reached (Could not connect to the endpoint URL"
        )
        assert lying(store.folder) == before and (store.folder / CLOSED).read_bytes() == whole
        with pytest.raises(UnreachableError, match="try again later"):
            stored_files.fetch_local(store, "results/1.report.npz")
        with store.database() as db, pytest.raises(UnreachableError):
            erasure.erase(db, store, 1, "P-1")
        with store.database() as db:
            assert patients.get(db, 1).pseudonym == "P-1", "nothing was erased"
        with pytest.raises(UnreachableError):
            open_store(
                tmp_path / "new", None, f"{url}-new"
            )  # an address that was never reached is a slip, said at once
    finally:
        s3.start()
    assert stored_files.move_out(store, ROOM) == Round(moved=2)


def test_an_erased_patient_is_erased_in_the_storage_too(url: str, tmp_path: Path) -> None:
    store = filled(tmp_path / "data", url)
    stored_files.move_out(store, ROOM)
    with store.database() as db:
        for session in db.scalars(select(PatientSession)):
            session.state = "processed"
        assert erasure.erase(db, store, 1, "P-1")["bytes"] == 256_000 + len("figures") + len(
            "as far as it goes"
        )
    assert lying(store.folder) == lying(store.folder / "cache") == set()
    assert stored_files.move_out(store, ROOM) == Round()
    assert list(away(url)) == [object_storage.MARK]
    with store.database() as db:
        assert db.scalars(select(ErasedFile)).all() == []


def test_a_backup_holds_what_was_moved_out_and_is_restored_into_a_folder_alone(
    url: str, tmp_path: Path
) -> None:
    store = filled(tmp_path / "data", url)
    before = {name: (store.folder / name).read_bytes() for name in lying(store.folder)}
    stored_files.move_out(store, 0)
    assert backup.write(store.folder, None, tmp_path / "b.zip", "1").problems == []
    backup.restore(tmp_path / "b.zip", tmp_path / "restored")
    assert {
        name: (tmp_path / "restored" / name).read_bytes() for name in lying(tmp_path / "restored")
    } == before
    assert store_at(tmp_path / "restored").away is None
    with pytest.raises(
        InputError,
        match=r"holds the recordings of another data folder; give this one a folder of its own",
    ):
        open_store(tmp_path / "restored", None, url)  # or the one would erase what the other has
    fs, root = fsspec.core.url_to_fs(url)
    fs.rm(root, recursive=True)
    told = backup.write(store.folder, None, tmp_path / "c.zip", "1").problems
    assert "is not the one that the recordings were put into; was it emptied?" in told[0]
    assert told[1:] == [f"{CLOSED} is missing in the data folder"]


@pytest.mark.parametrize(
    ("url", "sentence"),
    [
        ("/mnt/nas", "/mnt/nas is no place for recordings; name it like s3://bucket/folder"),
        ("s3://", "is no place for recordings"),
        ("s3://me:secret@bucket/x", "a password does not belong in the address"),
        ("nothing://bucket/x", "cannot be reached"),
    ],
)
def test_an_address_that_cannot_be_is_refused_before_anything_is_kept_there(
    url: str, sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=sentence):
        open_store(tmp_path, None, url)
    assert store_at(tmp_path).away is None


def test_a_folder_keeps_to_the_storage_that_it_was_given(tmp_path: Path) -> None:
    open_store(tmp_path / "data", None, f"file://{tmp_path / 'a'}")
    open_store(tmp_path / "data", None, f"file://{tmp_path / 'a'}")
    with pytest.raises(InputError, match="to move them, restore a backup elsewhere"):
        open_store(tmp_path / "data", None, f"file://{tmp_path / 'b'}")
