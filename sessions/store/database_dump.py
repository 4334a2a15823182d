"""All rows of a database as lines of JSON, the same from SQLite and PostgreSQL, and back into an empty one of either kind.

First line   the schema's revision; then for every table a line with its columns and the last number that it gave, followed by a line a row
"""

import base64
import json
from collections.abc import Iterable, Iterator, Sequence
from datetime import date, datetime
from typing import Any

from sqlalchemy import (
    JSON,
    Column,
    Connection,
    Engine,
    MetaData,
    Table,
    func,
    insert,
    inspect,
    select,
    text,
)

from handscope.estimators.errors import InputError
from handscope.sessions.db.plain_text import replaced
from handscope.sessions.store.database import is_known, upgrade

REVISION = "alembic_version"
# tables whose rows are not kept: a browser logs in again, what is restored is one server's
PASSING = frozenset({"attempt", "login", "server"})
TOGETHER = 200  # rows that are read or written at a time: a result may have a megabyte


def dump(connection: Connection) -> Iterator[bytes]:
    """The lines, as of one moment where the connection's transaction sees one."""
    metadata = _reflect_tables(connection)
    yield _line({"revision": connection.scalar(text(f"SELECT version_num FROM {REVISION}"))})
    for table in metadata.sorted_tables:
        columns = [c.name for c in table.columns]
        yield _line(
            {"table": table.name, "columns": columns, "last": _last_number(connection, table)}
        )
        if table.name in PASSING:
            continue
        found = connection.execution_options(yield_per=TOGETHER).execute(
            select(table).order_by(*table.primary_key)
        )
        for row in found:
            yield _line([_plain(value) for value in row])


def load(engine: Engine, lines: Iterable[bytes]) -> None:
    """Make the schema that the dump had, fill it, bring it up to date; InputError where the database is not empty or the dump is of a newer program."""
    if inspect(engine).get_table_names():
        raise InputError("store.database_not_empty")
    each = iter(lines)
    revision = json.loads(next(each))["revision"]
    if not is_known(revision):
        raise InputError("store.backup_newer", revision=revision)
    try:
        upgrade(engine, revision)
        with engine.begin() as connection:
            _fill(connection, each)
        upgrade(engine)
    except BaseException:
        made = MetaData()
        made.reflect(engine)
        made.drop_all(engine)
        raise


def _fill(connection: Connection, lines: Iterator[bytes]) -> None:
    metadata = _reflect_tables(connection)
    table, columns, waiting = None, list[str](), list[dict[str, Any]]()

    def put() -> None:
        if table is not None and waiting:
            connection.execute(insert(table), waiting)
            waiting.clear()

    for line in lines:
        value = json.loads(line)
        if isinstance(value, dict):
            put()
            table, columns = metadata.tables[value["table"]], value["columns"]
            connection.execute(table.delete())  # rows that a migration put in
            if value["last"] is not None:
                _set_last_number(connection, table, value["last"])
        elif table is not None:
            waiting.append(
                {
                    name: _of_column(table.columns[name], v)
                    for name, v in zip(columns, value, strict=True)
                }
            )
            if len(waiting) == TOGETHER:
                put()
    put()


def _reflect_tables(connection: Connection) -> MetaData:
    """The tables as they are, whatever version of the program made them."""
    metadata = MetaData()
    metadata.reflect(connection)
    metadata.remove(metadata.tables[REVISION])
    for table in metadata.tables.values():
        for column in table.columns:
            if isinstance(column.type, JSON):
                column.type = JSON(none_as_null=bool(column.nullable))
    return metadata


def _last_number(connection: Connection, table: Table) -> int | None:
    """The highest number that a row of the table ever had, where the database remembers it: none is given again."""
    if connection.dialect.name == "sqlite":
        if not inspect(connection).has_table("sqlite_sequence"):
            return None
        found: int | None = connection.scalar(
            text("SELECT seq FROM sqlite_sequence WHERE name = :name"), {"name": table.name}
        )
        return found
    sequence = _sequence(connection, table)
    if sequence is None:
        return None
    last, called = connection.execute(text(f"SELECT last_value, is_called FROM {sequence}")).one()
    return int(last) if called else None


def _set_last_number(connection: Connection, table: Table, last: int) -> None:
    if connection.dialect.name == "sqlite":
        connection.execute(
            text("DELETE FROM sqlite_sequence WHERE name = :name"), {"name": table.name}
        )
        connection.execute(
            text("INSERT INTO sqlite_sequence (name, seq) VALUES (:name, :seq)"),
            {"name": table.name, "seq": last},
        )
    elif (sequence := _sequence(connection, table)) is not None:
        connection.execute(select(func.setval(sequence, last)))


def _sequence(connection: Connection, table: Table) -> str | None:
    """PostgreSQL: what numbers the table's rows."""
    keys: Sequence[Column[Any]] = list(table.primary_key)
    if len(keys) != 1 or keys[0].type.python_type is not int:
        return None
    name: str | None = connection.scalar(
        select(func.pg_get_serial_sequence(f'"{table.name}"', keys[0].name))
    )
    return name


def _plain(value: Any) -> Any:
    if isinstance(value, date):
        return value.isoformat()
    return base64.b64encode(value).decode() if isinstance(value, bytes) else value


def _of_column(column: Column[Any], value: Any) -> Any:
    """A value of a line as the column takes it."""
    if value is None or isinstance(column.type, JSON):
        return replaced(value)
    kind = column.type.python_type
    if issubclass(kind, datetime):
        return datetime.fromisoformat(value)
    if issubclass(kind, date):
        return date.fromisoformat(value)
    return base64.b64decode(value) if issubclass(kind, bytes) else replaced(value)


def _line(value: Any) -> bytes:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":")).encode() + b"\n"
