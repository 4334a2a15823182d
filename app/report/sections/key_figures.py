"""The few figures that are read first, large at the head of the report: of each measure in turn those that changed most against measurement error."""

from itertools import zip_longest
from typing import Any

from handscope.app.language import Language
from handscope.app.report.change_words import size_words, value_words
from handscope.app.report.changes import read_as
from handscope.app.report.content import Content
from handscope.app.report.progress.importance import rank
from handscope.app.report.progress.labels import label
from handscope.app.report.units import deviation_words
from handscope.estimators.measures.figure import Figure
from handscope.sessions.clinic.repeatability import Key, Values, measured_values

MOST = 3
ELSEWHERE = "thumb_tam"  # its motion has rows in the table


def key_figures(content: Content, language: Language) -> list[dict[str, Any]]:
    """Name, task, value and its standard deviation, the other hand's, the change since the session before, in words, and whether it is beyond measurement error; "" where not known."""
    found = _important(content)
    measures = dict[str, list[Key]]()
    for key in sorted(found, key=lambda k: (-_change_in_mdcs(k, content), rank(k) or (), k)):
        measures.setdefault(key[0], []).append(key)
    chosen = [key for turn in zip_longest(*measures.values()) for key in turn if key]
    return [_tile(key, found, content, language) for key in chosen[:MOST]]


def _important(content: Content) -> Values:
    """Over the trials of each task, as comparisons take them."""
    found = measured_values(
        (t.result.task, t.result.measure, f) for t in content.tasks for f in t.result.figures
    )
    return {k: v for k, v in found.items() if rank(k) is not None and k[2] != ELSEWHERE}


def _change_in_mdcs(key: Key, content: Content) -> float:
    """The change in multiples of the minimal detectable one; 0 where either is not known."""
    change = content.changes.of(key[1], key[2]) if content.changes else None
    return abs(change.value) / change.mdc95 if change and change.mdc95 else 0.0


def _tile(key: Key, found: Values, content: Content, language: Language) -> dict[str, Any]:
    changes = content.changes
    change = changes.of(key[1], key[2]) if changes else None
    since = language.day(changes.since) if changes else ""
    changed = size_words(change, language) if change else ""
    other = content.course.other if content.course else None
    theirs = other.values.get(key) if other else None
    side = language.say(f"other.{'right' if content.hand == 'left' else 'left'}")
    titles = {t.result.task: t.title for t in content.tasks}
    return {
        "label": label(key[2], language),
        "task": language.translate(titles[key[1]]),
        "value": _words(key, *found[key], language),
        "sd": deviation_words(_trials(key, content), language),
        "other": language.labelled(side, _words(key, *theirs, language)) if theirs else "",
        "change": language.say("change.since", change=changed, day=since) if changed else "",
        "beyond": bool(change and change.beyond),
    }


def _trials(key: Key, content: Content) -> list[Figure]:
    """What the value of a key was made of."""
    return [
        f
        for t in content.tasks
        for f in t.result.figures
        if (t.result.measure, t.result.task, f.name) == key
    ]


def _words(key: Key, value: float, unit: str, language: Language) -> str:
    return value_words(key[2], *read_as(key, value, unit), language)
