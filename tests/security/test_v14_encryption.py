"""ASVS 5, 14.1: a sealed backup is opened by its key alone, and restored; another key takes its place."""

from pathlib import Path

import pytest

from handscope.app.cli import main
from handscope.sessions.clinic import patients
from handscope.sessions.store import backup, sealed_files
from handscope.sessions.store.store import open_store, store_at

pytest.importorskip("pyrage")
WORD = "Zinnober-4711"


@pytest.fixture
def data(tmp_path: Path) -> Path:
    store = open_store(tmp_path / "data")
    with store.database() as db:
        patients.create(db, "P-1", note=WORD)
    (store.folder / "recordings" / "a.mcap").write_bytes(WORD.encode() * 1000)
    store.close()
    return store.folder


def _key(file: Path, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["backup-key", "make", str(file)]) == 0
    assert file.stat().st_mode & 0o077 == 0
    return capsys.readouterr().out.split()[-1]


def _sealed(data: Path, recipient: str) -> Path:
    target = data.parent / "b.zip.age"
    words = ["backup", str(target), "--data", str(data), "--recipient", recipient]
    assert main(words) == 0
    return target


def test_a_sealed_backup_is_restored_with_its_key_and_with_no_other(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sealed = _sealed(data, _key(tmp_path / "key", capsys))
    _key(tmp_path / "other", capsys)
    assert WORD.encode() not in sealed.read_bytes() and sealed_files.is_sealed(sealed)
    assert sealed.stat().st_mode & 0o077 == 0 and not list((data / "incoming").iterdir())
    words = ["restore", str(sealed), "--data", str(tmp_path / "new" / "data")]
    assert main(words) == 2 and "--key" in capsys.readouterr().err
    assert main([*words, "--key", str(tmp_path / "other")]) == 2
    assert "not opened by this key" in capsys.readouterr().err
    assert not (tmp_path / "new" / "data").exists()
    assert main([*words, "--key", str(tmp_path / "key")]) == 0
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["data"], "nothing opened is left"
    with store_at(tmp_path / "new" / "data").database() as db:
        assert patients.get(db, 1).notes[0].text == WORD
    audited = ["audit", "verify", "--data", str(data), "--backup", str(sealed)]
    assert main([*audited, "--key", str(tmp_path / "key")]) == 0


def test_another_key_takes_the_place_of_one(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sealed = _sealed(data, _key(tmp_path / "old", capsys))
    new = _key(tmp_path / "new", capsys)
    words = ["backup-key", "change", str(sealed), "--key", str(tmp_path / "old")]
    assert main([*words, "--recipient", "age1wrong"]) == 2, "and it stays as it was"
    assert main([*words, "--recipient", new]) == 0
    check = ["restore", str(sealed), "--check", "--key"]
    assert (main([*check, str(tmp_path / "old")]), main([*check, str(tmp_path / "new")])) == (2, 0)
    assert not list(tmp_path.glob(".*"))


def test_a_sealed_backup_that_was_changed_is_refused(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sealed = _sealed(data, _key(tmp_path / "key", capsys))
    content = bytearray(sealed.read_bytes())
    content[-100] ^= 1
    sealed.write_bytes(content)
    words = ["restore", str(sealed), "--check", "--key", str(tmp_path / "key")]
    assert main(words) == 2
    assert "cannot be opened" in capsys.readouterr().err


def test_without_a_key_a_backup_is_as_it_always_was(data: Path, tmp_path: Path) -> None:
    made = backup.write(data, None, tmp_path / "b.zip", "test")
    assert not made.problems and not sealed_files.is_sealed(tmp_path / "b.zip")
