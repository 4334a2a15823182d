"""What is refused, warned of and found is a message with a code, wherever it stands."""

import json
from importlib.resources import files

from handscope.app.language import languages
from tests.app.language.sentences import sentences

PROGRAMMERS = ("app/workers/process.py",)  # what only the log is told


def test_whatever_a_person_may_be_told_is_a_message() -> None:
    """Refusals, findings, warnings, notices and reasons are written by their code, never as a sentence."""
    met = sentences(("app", "sessions", "estimators"), PROGRAMMERS)
    assert [f"{s.where}: {s.text}" for s in met] == []


def test_no_language_translates_by_whole_sentences() -> None:
    """Entries by an English sentence were 719; a text is translated by its code."""
    own = [files("handscope.app.language").joinpath(f"{code}.json") for code in languages()]
    parts = {part for file in own for part in json.loads(file.read_text("utf-8"))}
    assert parts == {"name", "locale", "pages", "words", "messages"}
