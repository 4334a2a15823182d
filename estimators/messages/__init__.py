"""What people read, as data: a code and its values. The words of a code stand in en.json beside this file, and in every other language's file in app/language.

English lies in the lowest room because every room raises errors, and `str(error)` has to be readable without app.
"""

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import Literal

GAP = re.compile(r"\{(\w+)(!r)?(?::([^{}]+))?\}")  # {name}, {name!r} in quotes, {seconds:.1f}
Value = float | str
Text = str | Mapping[str, str]  # a sentence, or one for each plural form of the value `count`


@dataclass(frozen=True)
class Message:
    """What people read, without the words."""

    code: str  # "motion_bids.no_unit"
    values: Mapping[str, Value] = field(default_factory=dict)
    severity: Literal["info", "warning", "fault"] = "warning"


@cache
def english_texts() -> Mapping[str, Text]:
    """The English text of every code."""
    texts: dict[str, Text] = json.loads(files(__name__).joinpath("en.json").read_text("utf-8"))
    return texts


def render_english(message: Message) -> str:
    """A message in English; KeyError where the code has no text or a value is missing."""
    return fill(english_texts()[message.code], message.values, _english_plural)


def fill(
    text: Text, values: Mapping[str, Value], plural: Callable[[float], str], point: str = "."
) -> str:
    """A text with its values.

    `plural` gives the plural form of a count after the Unicode CLDR ("one", "few", "other"); a form that is not there is `other`.
    `point` is the decimal point.
    """
    chosen = text if isinstance(text, str) else _form_of(text, plural(float(values["count"])))
    return GAP.sub(lambda gap: _in_words(values[gap[1]], gap[2], gap[3], point), chosen)


def _form_of(text: Mapping[str, str], form: str) -> str:
    return text.get(form, text["other"])


def _in_words(value: Value, quoted: str | None, form: str | None, point: str) -> str:
    if form and not isinstance(value, str):
        return format(value, form).replace(".", point)
    return repr(value) if quoted else str(value)


def _english_plural(count: float) -> str:
    return "one" if count == 1 else "other"
