"""Files of the data folder, sealed: what a disk that fails leaves."""

import os
from pathlib import Path
from typing import BinaryIO

import pytest

from handscope.sessions.sealing import stored
from handscope.sessions.sealing.keys import VARIABLE, make_key
from handscope.sessions.sealing.stored import continue_stored, read_stored, write_stored


def test_where_a_sealed_file_cannot_go_on_it_stays_and_nothing_is_left_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_key(tmp_path / "key")
    monkeypatch.setenv(VARIABLE, str(tmp_path / "key"))
    path = tmp_path / "a"
    write_stored(b"whole", path)
    made: list[BinaryIO] = []
    create = stored.create_stored

    def remembered(at: Path, buffer: int) -> BinaryIO:
        made.append(create(at, buffer))
        return made[-1]

    def refuse(file: int) -> None:
        raise OSError("the disk is full")

    with monkeypatch.context() as failing:
        failing.setattr(stored, "create_stored", remembered)
        failing.setattr(os, "fsync", refuse)
        with pytest.raises(OSError, match="the disk is full"):
            continue_stored(path, 3, 8)
    assert made[0].closed
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "key"]
    assert read_stored(path) == b"whole"
    with continue_stored(path, 3, 8) as file:
        file.write(b"n")
    assert read_stored(path) == b"whon"
