"""Which characters a text may have that comes in: the one rule for requests, the command line, files and devices.

Refused   control characters but tab and the ends of lines, and halves of surrogate pairs, which PostgreSQL and XML cannot hold
Refused   besides, in codes and names: format characters, among them those that turn the direction of writing, which make two codes look alike
"""

import unicodedata
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import Sentence

ALLOWED = "\t\n\r"
REPLACEMENT = "\N{REPLACEMENT CHARACTER}"


def find_refused(text: str, one_line: bool = False) -> list[str]:
    """The characters that a text may not have, each once."""
    return list(dict.fromkeys(c for c in text if _is_refused(c, one_line)))


def require_plain(value: Any, what: str, one_line: bool = False) -> None:
    """InputError where a text, or one in a list or mapping, keys included, has characters that it may not have."""
    if isinstance(value, str):
        if found := find_refused(value, one_line):
            codes = ", ".join(f"U+{ord(c):04X}" for c in found[:5])
            raise InputError("database.unprintable_characters", what=what, codes=codes)
    elif isinstance(value, Mapping):
        for name, inner in value.items():
            require_plain(name, what, one_line)
            require_plain(inner, what, one_line)
    elif isinstance(value, (list, tuple)):
        for inner in value:
            require_plain(inner, what, one_line)


def replaced(value: Any) -> Any:
    """The value with U+FFFD for what its texts may not have: of devices and files, where nobody can be asked. Sentences keep their codes."""
    if isinstance(value, Sentence):
        return Sentence(*(replace(m, values=replaced(m.values)) for m in value.messages))
    if isinstance(value, str):
        if value.isprintable():
            return value
        return "".join(REPLACEMENT if _is_refused(c, False) else c for c in value)
    if isinstance(value, Mapping):
        return {replaced(name): replaced(inner) for name, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [replaced(inner) for inner in value]
    return value


def _is_refused(character: str, one_line: bool) -> bool:
    category = unicodedata.category(character)
    if one_line:
        return category in ("Cc", "Cf", "Cs", "Zl", "Zp")
    return category == "Cs" or (category == "Cc" and character not in ALLOWED)
