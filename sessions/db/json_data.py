"""JSON columns whose sentences keep their message codes: stored as text and codes, given back as text that carries them."""

from typing import Any

from sqlalchemy import JSON, TypeDecorator
from sqlalchemy.engine import Dialect
from sqlalchemy.sql.operators import OperatorType
from sqlalchemy.types import TypeEngine

from handscope.estimators.messages.sentence import from_plain, to_plain
from handscope.sessions.db.plain_text import replaced


class JsonData(TypeDecorator[Any]):
    """Plain data; a text that was stored without codes stays a text."""

    impl = JSON
    cache_ok = True

    def process_bind_param(self, value: Any, dialect: Dialect) -> Any:
        return replaced(to_plain(value))

    def process_result_value(self, value: Any, dialect: Dialect) -> Any:
        return from_plain(value)

    def coerce_compared_value(self, op: OperatorType | None, value: Any) -> TypeEngine[Any]:
        """Keys and numbers of an index are those of JSON."""
        return self.impl_instance.coerce_compared_value(op, value)
