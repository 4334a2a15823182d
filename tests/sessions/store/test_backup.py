"""A backup restored is what was backed up, row by row and byte by byte, on either database; a damaged one is refused and leaves nothing."""

import hashlib
import io
import json
import threading
import zipfile
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import MetaData, create_engine, select, text

from handscope.estimators.errors import InputError
from handscope.sessions.clinic import accounts, audit, notes, patients
from handscope.sessions.db.tables import Login, Note, Patient, PatientSession, RecordingFile, Result
from handscope.sessions.files.native import file_checksum
from handscope.sessions.store import backup, database_dump, erasure
from handscope.sessions.store.database import FILE, connect, upgrade
from handscope.sessions.store.store import Store, open_store
from tests import postgres


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """Two patients with sessions, a third erased, so that its numbers are never given again; a browser logged in, a recording that runs."""
    store = filled(open_store(tmp_path / "data"))
    (store.folder / "tokens").mkdir()
    (store.folder / "tokens" / "secret").touch()
    return store


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    with postgres.server() as url:
        yield url


def filled(store: Store) -> Store:
    with store.database() as db:
        for k, word in enumerate(("Plum", "Grüße ✓", "Quince")):
            patient = patients.create(
                db, word, confirmed=True, year_of_birth=1950 + k, note=f"fell from a {word}"
            )
            session = PatientSession(
                patient=patient,
                hand="left",
                state="processed",
                started=datetime(2026, 3, 4, 5, 6, 7, 89, UTC),
            )
            name = f"recordings/{k}.mcap"
            (store.folder / name).write_bytes(bytes(range(256)) * (k + 1))
            file = RecordingFile(
                session=session,
                format="native",
                file=name,
                sha256=file_checksum(store.folder / name),
                summary={"duration": 0.1 + k},
            )
            made = Result(
                recording=file,
                key="k",
                method="m2",
                version="1",
                state="done",
                content={"of": [word, None, 1e-17, True]},
                progress=1 / 3,
            )
            db.add(made)
            db.commit()
            (store.folder / "results").mkdir(exist_ok=True)
            (store.folder / f"results/{made.id}.npz").write_bytes(word.encode())
        running = PatientSession(patient_id=1, hand="right")
        login = Login(token_hash="0" * 64, account=accounts.local_account(db))
        db.add_all(
            [RecordingFile(session=running, format="native", file="recordings/runs.mcap"), login]
        )
        db.commit()
        (store.folder / "recordings/runs.mcap").write_bytes(b"as far as it goes")
        erasure.erase(db, store, 3, "Quince")
    return store


def rows(folder: Path, url: str | None = None) -> dict[str, list[Any]]:
    """Every row of every table but logins."""
    engine, metadata = connect(folder, url), MetaData()
    metadata.reflect(engine)
    with engine.connect() as connection:
        found = {
            t.name: sorted(map(repr, connection.execute(select(t))))
            for t in metadata.sorted_tables
            if t.name != "login"
        }
    engine.dispose()
    return found


def files(folder: Path) -> dict[str, bytes]:
    found = [p for p in folder.rglob("*") if p.is_file() and not p.name.startswith(FILE)]
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in found}


def test_what_is_restored_is_what_was_backed_up(store: Store, tmp_path: Path) -> None:
    made = backup.write(store.folder, None, tmp_path / "b.zip", "1")
    assert made.problems == []
    assert (tmp_path / "b.zip").stat().st_mode & 0o077 == 0  # nobody else may read it
    manifest = backup.restore(tmp_path / "b.zip", tmp_path / "new")
    before, after = rows(store.folder), rows(tmp_path / "new")
    assert (
        before == after
        and len(before["patient"]) == 2
        and sum("'erased', 'patient'" in line for line in before["audit"]) == 1
    )
    assert files(tmp_path / "new") == {
        n: data for n, data in files(store.folder).items() if not n.startswith("tokens/")
    }
    assert manifest["files"].keys() == {"database.jsonl", *files(tmp_path / "new")}
    again = open_store(tmp_path / "new")
    with again.database() as db:
        assert db.scalar(select(Login)) is None
        assert audit.verify(db).broken == "" and audit.verify(db).lines == len(before["audit"])
        assert patients.create(db, "P-4").id == 4, (
            "the number of an erased patient is never given again"
        )
        assert db.scalars(
            select(PatientSession.started).where(PatientSession.id == 1)
        ).one() == datetime(2026, 3, 4, 5, 6, 7, 89, UTC)


def test_a_database_without_a_schema_is_refused_on_one_line(tmp_path: Path, server: str) -> None:
    data = tmp_path / "data"
    data.mkdir()
    with (
        postgres.empty_database(server) as url,
        pytest.raises(InputError, match=r"\(relation .* does not exist LINE 1: \S.*\); no backup"),
    ):
        backup.write(data, url, tmp_path / "b.zip", "1")
    assert not list(tmp_path.glob("*.zip"))


def test_a_backup_moves_to_postgresql_and_back(store: Store, tmp_path: Path, server: str) -> None:
    backup.write(store.folder, None, tmp_path / "b.zip", "1")
    with postgres.empty_database(server) as url:
        backup.restore(tmp_path / "b.zip", tmp_path / "moved", url)
        assert not (tmp_path / "moved" / FILE).exists()
        moved = open_store(tmp_path / "moved", url)
        with moved.database() as db:
            assert patients.create(db, "P-4").id == 4
        with pytest.raises(InputError, match="holds tables already"):
            backup.restore(tmp_path / "b.zip", tmp_path / "other", url)
        assert not (tmp_path / "other").exists()
        backup.write(tmp_path / "moved", url, tmp_path / "c.zip", "1")
        moved.close()
    backup.restore(tmp_path / "c.zip", tmp_path / "back")
    with store.database() as db, open_store(tmp_path / "back").database() as other:
        whole = audit.verify(db)
        patients.create(db, "P-4", created=other.get_one(Patient, 4).created)
        found = audit.verify(
            other, [(whole.lines, whole.last), backup.read_audit_head(tmp_path / "b.zip")]
        )
    assert (found.lines, found.broken) == (whole.lines + 1, "")
    before, after = ({**rows(folder), "audit": []} for folder in (store.folder, tmp_path / "back"))
    assert before == after


def test_a_backup_made_while_others_write_is_of_one_moment(store: Store, tmp_path: Path) -> None:
    """Two notes are always written together, to two patients: every backup holds as many of the one as of the other."""
    stop = threading.Event()

    def write() -> None:
        while not stop.is_set():
            with store.database() as db:
                db.add_all([Note(patient_id=p, text="x" * 2000) for p in (1, 2)])
                db.commit()

    writer = threading.Thread(target=write)
    writer.start()
    try:
        for k in range(4):
            backup.write(store.folder, None, tmp_path / f"{k}.zip", "1")
    finally:
        stop.set()
        writer.join()
    counts = []
    for k in range(4):
        backup.restore(tmp_path / f"{k}.zip", tmp_path / f"r{k}")
        with open_store(tmp_path / f"r{k}").database() as db:
            counts.append([len(patients.get(db, p).notes) for p in (1, 2)])
    assert all(a == b for a, b in counts)
    assert counts[-1] > counts[0], "writing went on meanwhile"


def test_a_patient_erased_while_the_backup_is_made_is_not_in_it(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    others, erased = backup._others, []

    def slow(folder: Path) -> Iterator[str]:
        if not erased:
            with store.database() as db:
                erased.append(erasure.erase(db, store, 2, "Grüße ✓"))
        return others(folder)

    monkeypatch.setattr(backup, "_others", slow)
    assert backup.write(store.folder, None, tmp_path / "b.zip", "1").problems == []
    with zipfile.ZipFile(tmp_path / "b.zip") as archive:
        assert "Grüße" not in "".join(
            archive.read(name).decode("latin-1") for name in archive.namelist()
        )
        assert "Grüße".encode() not in archive.read("database.jsonl")


def test_a_recording_missing_or_changed_on_the_disk_is_named(store: Store, tmp_path: Path) -> None:
    (store.folder / "recordings/0.mcap").unlink()
    (store.folder / "recordings/1.mcap").write_bytes(b"not this")
    problems = backup.write(store.folder, None, tmp_path / "b.zip", "1").problems
    assert [p[: p.index(" ")] for p in problems] == ["recordings/0.mcap", "recordings/1.mcap"]
    backup.restore(tmp_path / "b.zip", tmp_path / "new")
    assert rows(store.folder) == rows(tmp_path / "new")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("whole")
    backup.write(filled(open_store(folder / "data")).folder, None, folder / "b.zip", "1")
    return (folder / "b.zip").read_bytes()


@given(data=st.data())
def test_a_backup_with_a_wrong_byte_or_cut_short_is_refused_or_restores_the_same(
    data: st.DataObject, whole: bytes, tmp_path_factory: Any
) -> None:
    """A byte that no checksum guards (a date in the zip's directory) may differ; what is restored may not."""
    folder = tmp_path_factory.mktemp("damaged")
    at = data.draw(st.integers(0, len(whole) - 1))
    cut = data.draw(st.booleans())
    (folder / "b.zip").write_bytes(
        whole[:at]
        if cut
        else whole[:at] + bytes([whole[at] ^ data.draw(st.integers(1, 255))]) + whole[at + 1 :]
    )
    try:
        manifest = backup.restore(folder / "b.zip", folder / "new")
    except InputError:
        assert not (folder / "new").exists()
    else:
        (folder / "w.zip").write_bytes(whole)
        backup.restore(folder / "w.zip", folder / "again")
        assert rows(folder / "new") == rows(folder / "again")
        assert {n: told["sha256"] for n, told in manifest["files"].items()}.items() == {
            n: told["sha256"] for n, told in backup.check(folder / "w.zip")["files"].items()
        }.items()


@pytest.mark.parametrize(
    "name", ["../outside", "/tmp/handscope-outside", "a/../../outside", "restoring"]
)
def test_a_crafted_backup_writes_nowhere_else(name: str, whole: bytes, tmp_path: Path) -> None:
    (tmp_path / "w.zip").write_bytes(whole)
    with (
        zipfile.ZipFile(tmp_path / "w.zip") as good,
        zipfile.ZipFile(tmp_path / "b.zip", "w") as bad,
    ):
        manifest = json.loads(good.read("manifest.json"))
        manifest["files"][name] = {
            "bytes": 0,
            "sha256": "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855",
        }
        for kept in set(good.namelist()) - {"manifest.json"}:
            bad.writestr(kept, good.read(kept))
        bad.writestr(name, b"")
        bad.writestr("manifest.json", json.dumps(manifest))
    with pytest.raises(InputError, match="outside the data folder"):
        backup.restore(tmp_path / "b.zip", tmp_path / "new" / "data")
    assert sorted(p.name for p in tmp_path.rglob("*") if p.is_file()) == ["b.zip", "w.zip"]


def _rows_exchanged(whole: bytes, lines: bytes) -> bytes:
    """A backup with other rows, and a manifest that was made to fit."""
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(whole)) as old, zipfile.ZipFile(made, "w") as new:
        manifest = json.loads(old.read("manifest.json"))
        manifest["files"]["database.jsonl"]["sha256"] = hashlib.sha256(lines).hexdigest()
        for name in old.namelist():
            new.writestr(
                name,
                {"manifest.json": json.dumps(manifest).encode(), "database.jsonl": lines}.get(name)
                or old.read(name),
            )
    return made.getvalue()


@pytest.mark.parametrize(
    ("spoilt", "sentence"),
    [
        (lambda whole: whole[100:], "is damaged or no backup"),
        (lambda whole: _rows_exchanged(whole, b"{}"), "not those of a Handscope database"),
        (
            lambda whole: _rows_exchanged(whole, b'{"revision":"0001"}\n{"table":"nobody"}'),
            "not those of a Handscope database",
        ),
    ],
)
def test_a_backup_without_its_beginning_or_with_other_rows_is_refused_in_words(
    spoilt: Callable[[bytes], bytes], sentence: str, whole: bytes, tmp_path: Path
) -> None:
    (tmp_path / "b.zip").write_bytes(spoilt(whole))
    with pytest.raises(InputError, match=sentence):
        backup.restore(tmp_path / "b.zip", tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_what_stands_in_the_way_is_said(store: Store, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no Handscope data"):
        backup.write(tmp_path / "nowhere", None, tmp_path / "b.zip", "1")
    with pytest.raises(InputError, match="inside the data folder"):
        backup.write(store.folder, None, store.folder / "b.zip", "1")
    backup.write(store.folder, None, tmp_path / "b.zip", "1")
    with pytest.raises(InputError, match="there already"):
        backup.write(store.folder, None, tmp_path / "b.zip", "1")
    with pytest.raises(InputError, match="not an empty folder"):
        backup.restore(tmp_path / "b.zip", store.folder)
    for junk in (b"", b"PK", b"hello" * 100):
        (tmp_path / "junk.zip").write_bytes(junk)
        with pytest.raises(InputError, match="no backup"):
            backup.restore(tmp_path / "junk.zip", tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_an_interrupted_restore_is_not_taken_for_data(store: Store, tmp_path: Path) -> None:
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / "restoring").touch()
    with pytest.raises(InputError, match="empty the folder and restore again"):
        open_store(tmp_path / "new")


def test_a_backup_of_an_earlier_schema_is_brought_up_to_date(tmp_path: Path) -> None:
    old, new = (
        create_engine(f"sqlite:///{tmp_path}/old.db"),
        create_engine(f"sqlite:///{tmp_path}/new.db"),
    )
    upgrade(old, "0001")
    with old.begin() as connection:
        connection.execute(
            text(
                "INSERT INTO patient (pseudonym, hand_measures, notes, archived, created, version) VALUES ('P', '{}', 'old note', 0, '2024-01-01 00:00:00.000000', 1)"
            )
        )
    with old.connect() as connection:
        lines = list(database_dump.dump(connection))
    database_dump.load(new, lines)
    with new.connect() as connection:
        assert connection.execute(text("SELECT text FROM note")).scalar_one() == "old note"
    with pytest.raises(InputError, match="newer version"):
        database_dump.load(create_engine("sqlite://"), [b'{"revision": "9999"}'])


def test_notes_of_a_removed_week_come_back_with_the_rest(store: Store, tmp_path: Path) -> None:
    with store.database() as db:
        note = patients.get(db, 1).notes[0]
        notes.change(db, note.id, note.version, removed=True)
    backup.write(store.folder, None, tmp_path / "b.zip", "1")
    backup.restore(tmp_path / "b.zip", tmp_path / "new")
    with open_store(tmp_path / "new").database() as db:
        assert patients.get(db, 1).notes[0].removed is not None
