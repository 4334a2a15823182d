"""Files appear whole or not at all."""

import os
from pathlib import Path

import pytest

from handscope.estimators.errors import InputError
from handscope.sessions.tables_io.writing import save_file, save_folder


def _content(place: Path) -> dict[str, bytes]:
    return {
        p.relative_to(place).as_posix(): p.read_bytes() for p in place.rglob("*") if p.is_file()
    }


def test_a_folder_is_written_with_its_folders(tmp_path: Path) -> None:
    files = {"a.txt": b"1", "b/c/d.txt": b"2"}
    save_folder(files, tmp_path)
    assert _content(tmp_path) == files
    save_folder({"a.txt": b"new"}, tmp_path)
    assert _content(tmp_path) == {**files, "a.txt": b"new"}


def test_a_folder_that_cannot_be_written_whole_stays_as_it_was(tmp_path: Path) -> None:
    save_folder({"a.txt": b"old"}, tmp_path)
    (tmp_path / "z.txt").mkdir()  # where a file should go
    with pytest.raises(InputError, match="nothing was kept"):
        save_folder({"a.txt": b"new", "b.txt": b"new", "z.txt": b"new"}, tmp_path)
    assert _content(tmp_path) == {"a.txt": b"old"}


def test_a_folder_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(InputError, match="cannot be written to"):
        save_folder({"a.txt": b"1"}, tmp_path / "file")


def test_a_file_is_replaced_at_once_and_a_failure_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "report.pdf"
    save_file(b"old", path)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("handscope.sessions.tables_io.writing.os.replace", full)
    with pytest.raises(InputError, match=r"report\.pdf cannot be written: No space"):
        save_file(b"new", path)
    assert _content(tmp_path) == {"report.pdf": b"old"}


def test_an_interruption_while_files_move_to_their_places_leaves_the_folder_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_folder({"a.txt": b"old"}, tmp_path)
    replace, calls = os.replace, iter((False, True, *[False] * 9))

    def interrupted(*which: Path) -> None:
        if next(calls):
            raise KeyboardInterrupt
        replace(*which)

    monkeypatch.setattr("handscope.sessions.tables_io.writing.os.replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save_folder({"a.txt": b"new", "b.txt": b"new"}, tmp_path)
    assert _content(tmp_path) == {"a.txt": b"old"}
