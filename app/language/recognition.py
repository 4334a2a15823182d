"""The codes of an English text that was stored without them.

Results of earlier versions hold finished sentences. Texts of messages, turned into patterns, find their codes; whatever
is made now carries its codes (estimators/messages/sentence.py) and is not matched.
"""

import re
from collections.abc import Iterator
from functools import cache, lru_cache

from handscope.app.language import to_pattern
from handscope.estimators.messages import GAP, english_texts
from handscope.estimators.messages.sentence import BETWEEN, Sentence, codes_of

LONGEST = 4000  # characters of a text; a longer one has no codes
WORDS = re.compile("[a-z]{2}")


def codes_in(text: str) -> frozenset[str]:
    """The codes of a text: those that it carries, else those of the messages whose words it has."""
    if isinstance(text, Sentence):
        return codes_of(text)
    return _recognise(str(text)) if len(text) <= LONGEST else frozenset()


@lru_cache(2000)
def _recognise(text: str) -> frozenset[str]:
    for code, pattern in _patterns():
        if found := pattern.fullmatch(text):
            values = found.groupdict().values()
            if not any(BETWEEN in value for value in values):  # several texts together
                return frozenset({code}).union(*map(codes_in, values))
    parts = text.split(BETWEEN)
    return frozenset().union(*map(codes_in, parts)) if len(parts) > 1 else frozenset()


@cache
def _patterns() -> list[tuple[str, re.Pattern[str]]]:
    """Those with most words of their own first; gaps alone are no words."""
    texts = [(code, text) for code, text in _texts() if WORDS.search(GAP.sub("", text))]
    texts.sort(key=lambda pair: -len(GAP.sub("", pair[1])))
    return [
        (code, re.compile(to_pattern(GAP.sub(r"{\1}", text)), re.DOTALL)) for code, text in texts
    ]


def _texts() -> Iterator[tuple[str, str]]:
    for code, text in english_texts().items():
        for form in [text] if isinstance(text, str) else text.values():
            yield code, form
