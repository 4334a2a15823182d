"""A data folder that cannot be used is refused in words, and nothing is made in it."""

import errno
import os
from pathlib import Path

import pytest

from handscope.estimators.errors import InputError
from handscope.sessions.store.database import connect
from handscope.sessions.store.store import open_store


@pytest.mark.parametrize("why", [errno.EROFS, errno.ENOSPC, errno.EACCES])
def test_a_disk_that_takes_nothing_is_named_before_the_database_is_touched(
    why: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: Path, data: bytes) -> int:
        raise OSError(why, os.strerror(why))

    monkeypatch.setattr(Path, "write_bytes", refuse)
    with pytest.raises(
        InputError,
        match=f"the data folder {tmp_path} cannot be written to: {os.strerror(why)}; mend that",
    ):
        open_store(tmp_path)
    assert {p.name for p in tmp_path.rglob("*")} == {"incoming", "recordings"}


def test_a_database_of_a_newer_version_is_refused_and_left_as_it_is(tmp_path: Path) -> None:
    open_store(tmp_path).close()
    with connect(tmp_path).begin() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = '9999'")
    with pytest.raises(InputError, match="has the schema 9999 of a newer version of Handscope"):
        open_store(tmp_path)
    with connect(tmp_path).connect() as connection:
        assert (
            connection.exec_driver_sql("SELECT version_num FROM alembic_version").scalar() == "9999"
        )
