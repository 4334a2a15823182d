"""English words that keep the messages they were made of: a text for whoever reads a text, codes for translation and advice.

A reason, a warning or a finding travels as text through tables and files. As a `Sentence` it is that text, and what
chooses or translates by it reads `messages` instead of the words.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from math import isfinite
from numbers import Integral
from typing import Any, Self

from handscope.estimators.messages import Message, Value, english_texts, render_english

BETWEEN = "; "  # of several messages in one text
PLAIN = "plain.text"  # words that have no code: another program's, or a person's
STORED = frozenset({"text", "messages"})  # keys of a stored sentence


class Sentence(str):
    """The English text of one or more messages."""

    __slots__ = ("messages",)
    messages: tuple[Message, ...]

    def __new__(cls, *messages: Message) -> Self:
        sentence = super().__new__(cls, BETWEEN.join(map(render_english, messages)))
        sentence.messages = messages
        return sentence

    def __str__(self) -> str:
        """Itself: `str(error)` keeps the messages, too."""
        return self

    def __reduce__(self) -> tuple[type[Self], tuple[Message, ...]]:
        return type(self), self.messages


def phrase(code: str, /, **values: Value) -> str:
    """The `Sentence` of one code; a value may be a sentence itself."""
    return Sentence(Message(code, values))


def with_code(code: str, text: str) -> str:
    """A text as the `Sentence` of its code where that code has these English words, else the text as it is."""
    return phrase(code) if english_texts().get(code) == text else text


def join(parts: Iterable[str]) -> str:
    """Several in one text, each once, empty ones left out; each keeps its messages."""
    each = [part for part in dict.fromkeys(parts) if part]
    if not each:
        return ""
    return Sentence(*(message for part in each for message in messages_of(part)))


def messages_of(text: str) -> Sequence[Message]:
    """The messages of a text; words without a code are one of their own."""
    if isinstance(text, Sentence):
        return text.messages
    return [Message(PLAIN, {"text": text})] if text else []


def codes_of(text: str) -> frozenset[str]:
    """The codes of a text and of the sentences among its values."""
    return frozenset(code for message in messages_of(text) for code in _codes(message))


def add_codes(value: Any) -> Any:
    """Plain data with `warnings_codes` beside `warnings` wherever a text, or one of a list of texts, has codes."""
    if is_dataclass(value) and not isinstance(value, type):
        return add_codes({f.name: getattr(value, f.name) for f in fields(value)})
    if isinstance(value, Mapping):
        plain = {key: add_codes(v) for key, v in value.items()}
        codes = {f"{key}_codes": _codes_beside(v) for key, v in value.items()}
        return plain | {key: v for key, v in codes.items() if v and key not in plain}
    return [add_codes(v) for v in value] if isinstance(value, list | tuple) else value


def _codes_beside(value: Any) -> list[Any]:
    if isinstance(value, Sentence):
        return sorted(codes_of(value))
    if isinstance(value, list | tuple) and any(isinstance(v, Sentence) for v in value):
        return [sorted(codes_of(v)) if isinstance(v, str) else [] for v in value]
    return []


def _codes(message: Message) -> Iterable[str]:
    if message.code != PLAIN:
        yield message.code
    for value in message.values.values():
        if isinstance(value, Sentence):
            yield from codes_of(value)


def to_plain(value: Any) -> Any:
    """Plain data in which each sentence is {"text", "messages"}, for storage as JSON."""
    if isinstance(value, Sentence):
        return {"text": str.__str__(value), "messages": [_plain_message(m) for m in value.messages]}
    if isinstance(value, Mapping):
        return {key: to_plain(v) for key, v in value.items()}
    return [to_plain(v) for v in value] if isinstance(value, list | tuple) else value


def plain_number(value: float) -> float | str:
    """A message's number as JSON takes it: none of numpy's, and what is not finite as its word."""
    if isinstance(value, Integral):
        return int(value)
    return float(value) if isfinite(value) else str(value)


def from_plain(data: Any) -> Any:
    """What `to_plain` made; a sentence of codes that this version does not know is its text."""
    if isinstance(data, Mapping):
        if data.keys() == STORED:
            return _stored_sentence(data)
        return {key: from_plain(v) for key, v in data.items()}
    return [from_plain(v) for v in data] if isinstance(data, list) else data


def _plain_message(message: Message) -> dict[str, Any]:
    values = {
        name: to_plain(value) if isinstance(value, str) else plain_number(value)
        for name, value in message.values.items()
    }
    return {"code": message.code, "values": values, "severity": message.severity}


def _stored_sentence(data: Mapping[str, Any]) -> str:
    text = str(data["text"])
    if any(m["code"] not in english_texts() for m in data["messages"]):
        return text
    try:
        return Sentence(
            *(Message(m["code"], from_plain(m["values"]), m["severity"]) for m in data["messages"])
        )
    except (KeyError, ValueError):  # a value that the words need now was not stored then
        return text
