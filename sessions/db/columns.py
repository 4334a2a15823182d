"""What all tables have in common: kinds of columns, times in UTC, text that can be shown and stored."""

from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, DateTime, String, TypeDecorator, event, inspect
from sqlalchemy.engine import Dialect
from sqlalchemy.orm import DeclarativeBase, Mapper

from handscope.sessions.db.json_data import JsonData
from handscope.sessions.db.plain_text import replaced

TEXTS = (str, dict, list)


class UtcDateTime(TypeDecorator[datetime]):
    """Times with a zone on every database: SQLite forgets the zone, so UTC is stored and given back."""

    impl = DateTime
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        return None if value is None else value.astimezone(UTC).replace(tzinfo=None)

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        return None if value is None else value.replace(tzinfo=UTC)


class Base(DeclarativeBase):
    """Base of all tables."""

    type_annotation_map = {  # noqa: RUF012
        datetime: UtcDateTime,
        dict[str, Any]: JsonData,
        list[Any]: JsonData,
        str: String,
    }


def now() -> datetime:
    """The present instant in UTC."""
    return datetime.now(UTC)


@event.listens_for(Base, "before_insert", propagate=True)
@event.listens_for(Base, "before_update", propagate=True)
def _replace_unstorable(mapper: Mapper[Any], connection: Connection, row: Base) -> None:
    """What devices and files say is stored without control characters; requests with such are refused before (app/auth/incoming_text.py)."""
    state = inspect(row)
    for column in mapper.column_attrs:
        if column.key in state.dict and isinstance(value := state.dict[column.key], TEXTS):
            plain = replaced(value)
            if plain != value:
                setattr(row, column.key, plain)
