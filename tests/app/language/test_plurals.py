"""A number before a noun: "1 session", "2 sessions". What counts has plural forms, so no language says "1 sessions"."""

import json
import re
from collections.abc import Iterator
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import pytest

from handscope.app.language import PLURALS
from handscope.estimators.messages import english_texts

LANGUAGES = ("en", "de", "fr")
COUNTED = re.compile(
    r"\{(?P<gap>\w+)(?:!r)?(?::(?P<form>[^{}]+))?\}[ \u00a0\u202f]+(?P<word>[^\W\d_]{2,})"
)
LIMITS = {"most", "longest", "longest_pseudonym"}  # constants, all above one
CONSTANT = {("change.published", "sessions")}  # one more than are enough
NOT_INFLECTED = {"changes", "fois"}  # the verb after the name of an angle; "times" in French
NOUN = {
    "en": re.compile(r"\w{3,}s"),
    "de": re.compile(r"[A-ZÄÖÜ]\w+"),
    "fr": re.compile(r"\w{3,}s"),
}


class Text(NamedTuple):
    key: str  # without the plural form
    form: str  # "one", "other", or "" where it has no forms
    text: str


@cache
def texts(language: str) -> tuple[Text, ...]:
    return tuple(_texts(language))


def _texts(language: str) -> Iterator[Text]:
    own = json.loads(files("handscope.app.language").joinpath(f"{language}.json").read_text())
    for part in ("pages", "words"):
        keys = own[part]
        for key, text in keys.items():
            stem, _, form = key.rpartition(".")
            counts = form in PLURALS and f"{stem}.other" in keys and f"{stem}.one" in keys
            yield Text(stem, form, text) if counts else Text(key, "", text)
    messages = english_texts() if language == "en" else own["messages"]
    for code, text in messages.items():
        if isinstance(text, str):
            yield Text(code, "", text)
        else:
            yield from (Text(code, form, one) for form, one in text.items())


def words_after_numbers(language: str, form: str) -> dict[str, set[str]]:
    """By key, what stands after a number in this plural form."""
    found: dict[str, set[str]] = {}
    for text in texts(language):
        if text.form == form:
            words = {each["word"] for each in COUNTED.finditer(text.text)}
            found[text.key] = found.get(text.key, set()) | words
    return found


def plurals(language: str) -> set[str]:
    """Nouns that the language itself inflects after a number somewhere."""
    one, other = words_after_numbers(language, "one"), words_after_numbers(language, "other")
    after = {word for key, words in other.items() for word in words - one.get(key, set())}
    return {word for word in after if NOUN[language].fullmatch(word)} - NOT_INFLECTED


def is_number(key: str, gap: str, form: str | None) -> bool:
    """Whole numbers have no format; a measured one ("12.5 samples a second") is never one."""
    return gap == "count" or not (form or gap in LIMITS or (key, gap) in CONSTANT)


@pytest.mark.parametrize("language", LANGUAGES)
def test_what_counts_has_plural_forms(language: str) -> None:
    nouns = plurals(language)
    assert len(nouns) > 20
    assert [
        (text.key, each[0])
        for text in texts(language)
        if not text.form
        for each in COUNTED.finditer(text.text)
        if (each["gap"] == "count" or each["word"] in nouns)
        and is_number(text.key, each["gap"], each["form"])
    ] == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_singular_form_has_no_plural_after_its_number(language: str) -> None:
    nouns = plurals(language)
    assert [
        (text.key, each[0])
        for text in texts(language)
        if text.form == "one"
        for each in COUNTED.finditer(text.text)
        if each["gap"] == "count" and each["word"] in nouns
    ] == []
