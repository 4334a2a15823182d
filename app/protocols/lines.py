"""In which line of a JSON text a value stands, for a person who looks for a fault."""

import json
import re

# cycle[0].seconds, at the beginning of a sentence
WHERE = re.compile(r"[A-Za-z_]\w*(?:\[\d+\]|\.\w+)*")
BLANK = re.compile(r"\s*")
_DECODER = json.JSONDecoder()


def line_of(text: str, sentence: str) -> int | None:
    """The line (from 1) of the value that a sentence begins with, such as "cycle[0].seconds is 0"; None where it is not there."""
    found = WHERE.match(sentence)
    if not found:
        return None
    at = _blank(text, 0)
    try:
        for part in re.findall(r"\w+", found[0]):
            at = _element(text, at, int(part)) if text[at] == "[" else _member(text, at, part)
    except (ValueError, IndexError):
        return None
    return text.count("\n", 0, at) + 1


def _member(text: str, at: int, name: str) -> int:
    """Where the value of a name begins, in the object that begins at `at`; ValueError where it has none."""
    at = _blank(text, _skip_opening(text, at, "{"))
    while True:
        key, at = _DECODER.raw_decode(text, at)
        at = _blank(text, _skip_opening(text, _blank(text, at), ":"))
        if key == name:
            return at
        _, at = _DECODER.raw_decode(text, at)
        at = _blank(text, _skip_opening(text, _blank(text, at), ","))


def _element(text: str, at: int, number: int) -> int:
    at = _blank(text, _skip_opening(text, at, "["))
    for _ in range(number):
        _, at = _DECODER.raw_decode(text, at)
        at = _blank(text, _skip_opening(text, _blank(text, at), ","))
    return at


def _skip_opening(text: str, at: int, sign: str) -> int:
    if text[at] != sign:
        raise ValueError(f"no {sign} at {at}")
    return at + 1


def _blank(text: str, at: int) -> int:
    """Past blanks and line ends."""
    found = BLANK.match(text, at)
    assert found is not None
    return found.end()
