"""Texts of stored results that were written without codes, read back: the one place that matches words.

Results of the first edition hold finished English sentences. Here, where their rows are read, such a text becomes the
`Sentence` of its codes and values again. Whatever is made now is stored with its codes and is not matched.
"""

import json
import re
from collections.abc import Iterator, Mapping, Set
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

from sqlalchemy import Dialect, String, TypeDecorator

from handscope.estimators.messages import GAP, Message, Value, english_texts
from handscope.estimators.messages.sentence import (
    BETWEEN,
    PLAIN,
    Sentence,
    messages_of,
    to_plain,
)
from handscope.sessions.db.json_data import JsonData, stored_text

LONGEST = 4000  # characters of a text; a longer one stays a text
WORDS = re.compile("[a-z]{2}")
# Keys of stored data that hold texts of ours, at any depth
KEYS = frozenset(
    {"category", "meaning", "measure_title", "message", "messages", "reason", "reasons"}
    | {"sd_basis", "sentence", "source", "title", "told", "warnings"}
)


@dataclass(frozen=True)
class Pattern:
    """One English text as it may stand in what was stored."""

    code: str
    words: re.Pattern[str]
    forms: Mapping[str, str]  # of the values that have one: ".1f"
    is_frame: bool  # "{segments}: {what}": only sentences of ours within it tell it


class TextsWithCodes(JsonData):
    """Plain data whose texts have their codes when they are read, in whichever edition they were stored."""

    cache_ok = True

    def process_result_value(self, value: Any, dialect: Dialect) -> Any:
        read = super().process_result_value(value, dialect)
        return _read_back_each(read) if _is_texts(read) else _read_back_keys(read)


class TextWithCodes(TypeDecorator[str]):
    """One text; a `Sentence` is stored as JSON, so that its codes and values stay."""

    impl = String
    cache_ok = True

    def process_bind_param(self, value: str | None, dialect: Dialect) -> str | None:
        return json.dumps(to_plain(value)) if isinstance(value, Sentence) else value

    def process_result_value(self, value: str | None, dialect: Dialect) -> str | None:
        return None if value is None else read_back(stored_text(value))


def read_back(text: str) -> str:
    """A text with its codes where all of its words are those of messages, else the text itself."""
    if isinstance(text, Sentence) or not text or len(text) > LONGEST:
        return text
    return _recognise(text) or text


def _read_back_keys(data: Any) -> Any:
    if isinstance(data, Mapping):
        return {
            key: _read_back_each(value)
            if key in KEYS and (isinstance(value, str) or _is_texts(value))
            else _read_back_keys(value)
            for key, value in data.items()
        }
    if isinstance(data, list) and any(isinstance(value, Mapping | list) for value in data):
        return [_read_back_keys(value) for value in data]
    return data  # the numbers of a curve are many: none is looked at


def _read_back_each(texts: Any) -> Any:
    return read_back(texts) if isinstance(texts, str) else [read_back(text) for text in texts]


def _is_texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(text, str) for text in value)


@lru_cache(2000)
def _recognise(text: str) -> Sentence | None:
    """What is said again is the same text to the letter; nothing else is taken for it."""
    parts = text.split(BETWEEN)
    for pattern in _patterns():
        if (len(parts) == 1 or not pattern.is_frame) and (sentence := _read_by(pattern, text)):
            return sentence
    if len(parts) == 1:
        return None
    each = [_recognise(part) for part in parts]
    if not any(each):
        return None
    return Sentence(
        *(m for one, part in zip(each, parts) for m in (one.messages if one else messages_of(part)))
    )


def _read_by(pattern: Pattern, text: str) -> Sentence | None:
    found = pattern.words.fullmatch(text)
    if found is None or any(BETWEEN in v for v in found.groupdict().values()):  # of several texts
        return None
    values = {name: _value(v, pattern.forms[name]) for name, v in found.groupdict().items()}
    if pattern.is_frame and not any(isinstance(v, Sentence) for v in values.values()):
        return None
    with suppress(KeyError, ValueError):
        if (sentence := Sentence(Message(pattern.code, values))) == text:
            return sentence
    return None


def _value(text: str, form: str) -> Value:
    """A value as it stands in the text: a number where it has a number's form, a sentence of its own, or words."""
    if form:
        with suppress(ValueError):
            if format(number := float(text), form) == text:
                return number
    return _recognise(text) or text


@cache
def _patterns() -> list[Pattern]:
    """Those with most words of their own first."""
    texts = sorted(_texts(), key=lambda pair: -len(GAP.sub("", pair[1])))
    return [
        Pattern(
            code,
            re.compile(_to_pattern(text), re.DOTALL),
            {gap[1]: gap[3] or "" for gap in GAP.finditer(text)},
            not WORDS.search(GAP.sub("", text)),
        )
        for code, text in texts
        if code != PLAIN
    ]


def _texts() -> Iterator[tuple[str, str]]:
    for code, text in english_texts().items():
        for form in [text] if isinstance(text, str) else text.values():
            yield code, form


def _to_pattern(text: str) -> str:
    """A regular expression from a text with gaps; a value that stands twice is the same both times."""
    seen: set[str] = set()
    pieces, end = [], 0
    for gap in GAP.finditer(text):
        pieces.append(re.escape(text[end : gap.start()]))
        pieces.append(_gap(gap, seen))
        seen.add(gap[1])
        end = gap.end()
    return "".join([*pieces, re.escape(text[end:])])


def _gap(gap: re.Match[str], seen: Set[str]) -> str:
    quote = "'" if gap[2] else ""  # {name!r}
    inside = f"(?P={gap[1]})" if gap[1] in seen else f"(?P<{gap[1]}>.+?)"
    return f"{quote}{inside}{quote}"
