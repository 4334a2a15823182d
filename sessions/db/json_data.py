"""Columns whose sentences keep their message codes: stored as text and codes, given back as text that carries them."""

import json
from contextlib import suppress
from typing import Any

from sqlalchemy import JSON, String, TypeDecorator
from sqlalchemy.engine import Dialect
from sqlalchemy.sql.operators import OperatorType
from sqlalchemy.types import TypeEngine

from handscope.estimators.messages.sentence import STORED, Sentence, from_plain, to_plain
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


class SentenceOrTyped(TypeDecorator[str]):
    """One text, of ours or typed by a person: a `Sentence` is stored as JSON, so that its codes stay; any other text as it is."""

    impl = String
    cache_ok = True

    def process_bind_param(self, value: str | None, dialect: Dialect) -> str | None:
        return json.dumps(to_plain(value)) if isinstance(value, Sentence) else value

    def process_result_value(self, value: str | None, dialect: Dialect) -> str | None:
        return None if value is None else stored_text(value)


def stored_text(value: str) -> str:
    """A text as a column of texts holds it: a sentence where it is one's JSON."""
    with suppress(ValueError, AttributeError):
        if value.startswith("{") and (data := json.loads(value)).keys() == STORED:
            return str(from_plain(data))
    return value
