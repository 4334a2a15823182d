"""New databases of the tests: copies of one that the migrations have made, since they take longer than most tests.

A database of an earlier version runs through the migrations that it lacks; so does everything on PostgreSQL and in programs that tests start.
Databases of this process do not wait for the disk, which none of its tests takes away: that is of programs (tests/faults).
"""

import sqlite3
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import Engine

from handscope.sessions.store import database

_migrate, _prepare = database.upgrade, database._prepare_sqlite


def use(patch: pytest.MonkeyPatch, folder: Path) -> None:
    """From now on, in this process; the migrated database lies in `folder`."""

    def upgrade(engine: Engine, to: str = "head") -> None:
        """As database.upgrade."""
        if engine.dialect.name == "sqlite" and to == "head" and _is_empty(engine):
            _fill(engine, folder)
        _migrate(engine, to)

    patch.setattr(database, "upgrade", upgrade)
    patch.setattr(database, "_prepare_sqlite", _prepare_without_waiting)


def _prepare_without_waiting(connection: Any, record: object) -> None:
    _prepare(connection, record)
    connection.execute("PRAGMA synchronous=OFF")


def _is_empty(engine: Engine) -> bool:
    with engine.connect() as connection:
        return connection.exec_driver_sql("SELECT count(*) FROM sqlite_schema").scalar() == 0


def _fill(engine: Engine, folder: Path) -> None:
    """What a migrated database holds."""
    if not (folder / database.FILE).exists():
        made = database.connect(folder, None)
        _migrate(made)
        made.dispose()
    migrated, new = sqlite3.connect(folder / database.FILE), engine.raw_connection()
    try:
        assert isinstance(new.driver_connection, sqlite3.Connection)
        migrated.backup(new.driver_connection)
    finally:
        migrated.close()
        new.close()
