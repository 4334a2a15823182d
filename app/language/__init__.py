"""Every word a person reads, in every language that has a file beside this: en.json, de.json, fr.json; one more file, one more language.

pages      the pages' own words by key, served to the browser as a module (app/api/languages.py)
counts     of pages and words have a key a plural form of the CLDR: sessions.one, sessions.few, sessions.other; English has one and other
words      what the server writes into pages and reports, by key. In both, {names} are filled in, and a key that a language lacks is said in English
messages   errors and warnings by their code, with numbers' formats in the text ({seconds:.1f}) and plural forms ({"one": ..., "other": ...}); the English ones are in estimators/messages/en.json
locale     numbers, dates and lists after the Unicode CLDR (Babel)
"""

import json
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, datetime, tzinfo
from functools import cache, lru_cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any
from zoneinfo import ZoneInfo

from babel import Locale, UnknownLocaleError, negotiate_locale
from babel.dates import format_date, format_time
from babel.lists import format_list
from babel.numbers import format_decimal

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FINGERS, SEGMENTS
from handscope.estimators.messages import Message, Text, english_texts, fill
from handscope.estimators.messages.sentence import Sentence

DEFAULT = "en"
NAME = re.compile(r"\{(\w+)\}")
CODE = re.compile(r"[a-z]{2,3}")
PARTS = ("pages", "words")
PLURALS = {"zero", "one", "two", "few", "many", "other"}  # of the Unicode CLDR
SEGMENT = re.compile(rf"\b({'|'.join(sorted(SEGMENTS, key=len, reverse=True))})\b(?!_)")
JOINT = re.compile(rf"\b({'|'.join(FINGERS)})_(cmc|mcp|pip|dip|ip)\b")
NUMBER = re.compile(r"(?<![\w.])\d+\.\d+(?![\w./])")


@dataclass(frozen=True, eq=False)
class Language:
    """Words and forms of one language."""

    code: str  # ISO 639-1
    name: str  # in the language itself
    locale: Locale
    pages: Mapping[str, str]
    words: Mapping[str, str]
    messages: Mapping[str, Text]  # by code
    zone: tzinfo | None = (
        None  # where the reader is; None: not known, then it is where the server stands, and named
    )

    def render(self, message: Message) -> str:
        """A message in this language; KeyError where its code has no text or a value is missing.

        Values that are words are translated too: segments, reasons, hands.
        """
        return fill(
            self.messages[message.code],
            {k: self.translate(v) if isinstance(v, str) else v for k, v in message.values.items()},
            lambda count: str(self.locale.plural_form(count)),
            self.locale.number_symbols["latn"]["decimal"],
        )

    def say(self, key: str, **values: object) -> str:
        """The words of a key."""
        text = self.words[key]
        return _fill(text, values)

    def known(self, key: str, otherwise: str) -> str:
        return self.words.get(key, otherwise)

    def example(self, text: str) -> str:
        """A text of the demonstration's simulated patients (app/example_patients); what a person wrote comes back as it is."""
        return self.known(f"example.{text}", text)

    def counted(self, key: str, count: int, **facts: str) -> str:
        """ "1 session", "3 sessions": the words `key.one`, `key.few`, ... by the locale's plural rules; `key.other` where one is not there."""
        form = f"{key}.{self.locale.plural_form(count)}"
        return self.say(
            form if form in self.words else f"{key}.other", count=self.number(count), **facts
        )

    def number(self, value: float, decimals: int = 0) -> str:
        """A number in the locale's form, with a true minus sign."""
        form = f"#,##0.{'0' * decimals}" if decimals else "#,##0"
        written = str(format_decimal(round(value, decimals) + 0.0, form, self.locale))
        return written.replace("-", "−")

    def day(self, moment: date) -> str:
        """ "24 November 2026": of a moment, the day where the reader is."""
        return format_date(self._local(moment), "long", self.locale)

    def short_day(self, moment: datetime) -> str:
        return format_date(self._local(moment), "medium", self.locale)

    def hour(self, moment: datetime) -> str:
        """ "10:12": the hour where the reader is; "10:12 CET": where the server stands, as in a document that anybody may read."""
        local = self._local(moment)
        zone = "" if self.zone else local.tzname() or ""
        return f"{format_time(local.timetz(), 'HH:mm', locale=self.locale)} {zone}".strip()

    def read_in(self, zone: str) -> "Language":
        """The same for a reader in a time zone ("Europe/Berlin"); an unknown one changes nothing."""
        found = _zone(zone) if zone else None
        return replace(self, zone=found) if found else self

    def _local(self, moment: date) -> Any:
        """A moment on the clocks of the reader, else of the server (the system's zone, or TZ); a day, or a moment without a zone, as it is."""
        if isinstance(moment, datetime) and moment.tzinfo:
            return moment.astimezone(self.zone)
        return moment

    def all_of(self, words: Sequence[str]) -> str:
        """ "a", "a and b", "a, b and c"."""
        return format_list(words, locale=self.locale)

    def several(self, parts: Iterable[str]) -> str:
        """ "a; b; c", with the semicolon as the language sets it."""
        return self.words["between"].join(parts)

    def labelled(self, what: str, words: str) -> str:
        """ "Ring: moves along", with the colon as the language sets it."""
        return self.say("labelled", what=what, words=words)

    def joint(self, joint: str) -> str:
        """A joint's abbreviation: "MCP", in French "IPP" of the pip."""
        return self.known(f"joint.{joint}", joint.upper())

    def segment(self, segment: str) -> str:
        """A segment or tracked point as printed: "ring finger, end segment"."""
        part, _, piece = segment.partition("_")
        words = self.known(f"part.{part}", part)
        return (
            self.say(
                "segment", part=words, piece=self.known(f"piece.{piece}", piece.replace("_", " "))
            )
            if piece
            else words
        )

    def translate(self, text: str) -> str:
        """A text in this language by its codes; words without codes as they are, segments and joints by their names.

        A single word of the program, such as "left", has words by its key.
        """
        if isinstance(text, Sentence):
            return self.several(map(self.render, text.messages))
        known = self.words.get(f"value.{text}")
        return self._localise(text) if known is None else known

    def translate_keys(self, value: Any, keys: Collection[str]) -> Any:
        """Plain data with the texts under these keys, one or a list, at any depth, translated."""
        if self.code == DEFAULT:
            return value
        if isinstance(value, Mapping):
            return {
                k: self._translate_texts(v)
                if k in keys and _is_texts(v)
                else self.translate_keys(v, keys)
                for k, v in value.items()
            }
        return (
            [self.translate_keys(v, keys) for v in value]
            if isinstance(value, list | tuple)
            else value
        )

    def _translate_texts(self, value: str | Sequence[str]) -> str | list[str]:
        return self.translate(value) if isinstance(value, str) else [*map(self.translate, value)]

    def _localise(self, text: str) -> str:
        """Segments and joints by their names, decimal numbers in the locale's form."""
        named = SEGMENT.sub(
            lambda found: self.segment(found[1]) if "_" in found[1] else found[1], text
        )
        named = JOINT.sub(
            lambda found: f"{self.known(f'finger.{found[1]}', found[1])} {self.joint(found[2])}",
            named,
        )
        point = self.locale.number_symbols["latn"]["decimal"]
        return (
            named if point == "." else NUMBER.sub(lambda found: found[0].replace(".", point), named)
        )


def _is_texts(value: Any) -> bool:
    texts = [value] if isinstance(value, str) else value
    return isinstance(texts, list | tuple) and all(isinstance(text, str) for text in texts)


def languages() -> Mapping[str, Language]:
    """Every language by its code, English first."""
    return _here()[0]


def faults() -> list[str]:
    """A sentence for each file here that cannot be read."""
    return _here()[1]


@cache
def _here() -> tuple[dict[str, Language], list[str]]:
    return read(files("handscope.app.language"))


def read(folder: Traversable) -> tuple[dict[str, Language], list[str]]:
    """Every language of a folder by its code, English first, and a sentence for each file that has a fault."""
    codes = {
        entry.name.removesuffix(".json"): entry
        for entry in folder.iterdir()
        if entry.name.endswith(".json")
    }
    found: dict[str, Language] = {}
    faults = []
    for code in sorted(codes, key=lambda code: (code != DEFAULT, code)):
        try:
            found[code] = _read(code, codes[code].read_text("utf-8"), found.get(DEFAULT))
        except ValueError as fault:  # json's, babel's and the codec's are such
            faults.append(f"the language {code}.json cannot be read: {fault}")
    return found, faults


def _read(code: str, text: str, english: Language | None) -> Language:
    """One language; what it lacks is English."""
    if not CODE.fullmatch(code):
        raise ValueError("its name is no code of a language such as fr")
    content = json.loads(text, object_pairs_hook=_each_once)
    if (
        not isinstance(content, dict)
        or not isinstance(content.get("name"), str)
        or not isinstance(content.get("locale"), str)
    ):
        raise ValueError('it begins with "name" and "locale", such as "Français" and "fr_FR"')
    for part in PARTS:
        if not isinstance(content.get(part), dict) or not all(
            isinstance(words, str) for words in content[part].values()
        ):
            raise ValueError(f'"{part}" holds words by their keys')
    messages = content.get("messages", {})
    if not isinstance(messages, dict) or not all(_is_text(text) for text in messages.values()):
        raise ValueError('"messages" holds a text, or its plural forms with "other", by code')
    try:
        locale = Locale.parse(content["locale"])
    except UnknownLocaleError:
        raise ValueError(f"there is no locale {content['locale']!r}") from None
    pages, words = (english.pages, english.words) if english else ({}, {})
    return Language(
        code,
        content["name"],
        locale,
        {**pages, **content["pages"]},
        {**words, **content["words"]},
        {**english_texts(), **messages},
    )


def _is_text(value: object) -> bool:
    if not isinstance(value, dict):
        return isinstance(value, str)
    return "other" in value and value.keys() <= PLURALS and all(map(_is_text, value.values()))


def _each_once(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    keys = [key for key, _ in pairs]
    if (
        twice := [key for key in dict.fromkeys(keys) if keys.count(key) > 1]
        if len({*keys}) < len(keys)
        else []
    ):
        raise ValueError(f"{', '.join(twice)} stands twice")
    return dict(pairs)


def language(code: str) -> Language:
    """The language of a code; InputError where there is none."""
    if code not in languages():
        raise InputError("analysis.unknown_language", code=code, codes=", ".join(languages()))
    return languages()[code]


def preferred(accepted: str) -> Language:
    """The first of an Accept-Language header that there is, else English."""
    wanted = sorted(_weigh(accepted), key=lambda w: -w[0])
    code = negotiate_locale([tag for _, tag in wanted], [*languages()], sep="-")
    return languages()[code or DEFAULT]


def _weigh(accepted: str) -> Iterable[tuple[float, str]]:
    for part in accepted[:1000].split(","):
        tag, _, weight = part.partition(";q=")
        try:
            yield (float(weight) if weight else 1.0), tag.strip()
        except ValueError:
            continue


@lru_cache(maxsize=600)
def _zone(name: str) -> tzinfo | None:
    """A time zone by its name in the IANA data; None where there is none, or none of them are on this machine."""
    try:
        return ZoneInfo(name)
    except (KeyError, ValueError, OSError):
        return None


def _fill(text: str, values: Mapping[str, object]) -> str:
    return NAME.sub(lambda found: str(values.get(found[1], found[0])), text)


ENGLISH = languages()[DEFAULT]
