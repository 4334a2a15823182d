"""Files appear whole or not at all."""

import os
import stat
import threading
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


def test_a_link_stays_a_link_and_its_target_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    target, link = tmp_path / "there" / "angles.csv", tmp_path / "angles.csv"
    link.symlink_to(target)
    for data in (b"first, where the target was missing", b"second"):
        save_file(data, link)
        assert link.is_symlink()
        assert _content(tmp_path / "there") == {"angles.csv": data}


def test_a_pipe_is_written_to_and_stays_a_pipe(tmp_path: Path) -> None:
    pipe, got = tmp_path / "pipe", list[bytes]()
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()), daemon=True)
    reader.start()
    save_file(b"angles", pipe)
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    reader.join(10)
    assert got == [b"angles"]


def test_the_end_of_a_pipe_is_written_to_by_its_descriptor() -> None:
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb") as pipe, os.fdopen(writing, "wb"):
        save_file(b"angles", Path(f"/dev/fd/{writing}"))
        assert pipe.read(6) == b"angles"


def test_a_device_is_written_to_and_stays_a_device(tmp_path: Path) -> None:
    device = tmp_path / "device"
    try:
        os.mknod(device, stat.S_IFCHR | 0o600, os.makedev(1, 3))  # as /dev/null
        device.write_bytes(b"")
    except PermissionError:
        pytest.skip("only the system's administrator makes devices")
    save_file(b"angles", device)
    assert stat.S_ISCHR(device.stat().st_mode)
    assert list(tmp_path.iterdir()) == [device]
