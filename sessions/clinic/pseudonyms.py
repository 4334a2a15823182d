"""Whether a patient's code looks like a name or holds a date of birth: a warning that a person confirms, never a refusal."""

import re

from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import join, phrase

DATE = re.compile(
    r"\b\d{1,2}\s*[./-]\s*\d{1,2}\s*[./-]\s*(?:\d{4}|\d{2})\b|\b(?:19|20)\d{2}[./-]?(?:0[1-9]|1[0-2])[./-]?(?:0[1-9]|[12]\d|3[01])\b"
)
FORMS_OF_ADDRESS = {
    "mr",
    "mrs",
    "ms",
    "miss",
    "dr",
    "prof",
    "herr",
    "frau",
    "hr",
    "fr",
    "mme",
    "mlle",
    "m",
    "sr",
    "sra",
    "sig",
}
DOUBTS = {
    "words": phrase("pseudonym.no_number"),
    "name": phrase("pseudonym.capitals"),
    "comma": phrase("pseudonym.comma"),
    "address": phrase("pseudonym.form_of_address"),
    "date": phrase("pseudonym.date"),
}


class UnconfirmedError(InputError):
    """What was given is unusual: it is kept as soon as a person confirms it."""

    def __init__(self, sentence: str, doubts: tuple[str, ...]) -> None:
        super().__init__(sentence)
        self.doubts = doubts


def find_doubts(text: str) -> tuple[str, ...]:
    """Which of DOUBTS a pseudonym raises; none where it is plainly a code."""
    words = [
        w
        for w in re.split(r"[\s,;_-]+", text)
        if len(w.strip(".'")) > 1 and w.strip(".'").replace("'", "").replace("’", "").isalpha()
    ]
    capitalised = [w for w in words if w[0].isupper() and not w.isupper()]
    numbered = any(c.isdigit() for c in text)
    found = {
        "words": not numbered and (len(words) > 1 or len(capitalised) == 1 == len(text.split())),
        "name": len(capitalised) > 1,
        "comma": "," in text,
        "address": text.split() != []
        and text.split()[0].lower().rstrip(".") in FORMS_OF_ADDRESS
        and len(text.split()) > 1,
        "date": DATE.search(text) is not None,
    }
    return tuple(name for name, so in found.items() if so)


def require_code(text: str, confirmed: bool) -> None:
    """UnconfirmedError where the pseudonym raises doubts that nobody has confirmed."""
    found = () if confirmed else find_doubts(text)
    if found:
        reasons = join(DOUBTS[name] for name in found)
        raise UnconfirmedError(
            phrase("pseudonym.doubtful", code=text, reasons=reasons),
            found,
        )
