"""Measures without a section of their own: figures by name, the trials of a task side by side, for reports and pages alike."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from handscope.app.language import Language
from handscope.app.report.advice import advice
from handscope.app.report.content import Task
from handscope.app.report.norms import norm_of
from handscope.app.report.references import Edition
from handscope.app.report.sections.range_rows import GRADES
from handscope.app.report.sections.shown_panels import Panel, panels
from handscope.app.report.units import (
    DEG,
    decimals,
    decimals_of_sd,
    directed,
    reading,
    significant_places,
    unit_words,
    with_unit,
)
from handscope.app.report.words import grade_words, named, span_words
from handscope.estimators.measures.figure import Figure
from handscope.estimators.measures.total_active_motion import NORM
from handscope.estimators.messages.sentence import messages_of

Section = dict[str, Any]
OWN = ("tapping", "range_of_motion")  # measures that have one

WITHOUT_THUMB = ("strickland", "burn")  # schemes that do not cover it
REPEATED = 3  # so many rows with one reason: it is given once, below the table


def other_measures(
    tasks: Sequence[Task], language: Language, edition: Edition | None = None
) -> list[Section]:
    """A section a measure and task, in order of time; `norms` gives for each row the reference value and its source, None where there is none;
    `curves` the panels of each trial that has any, with the trial's name.
    """
    groups: dict[tuple[str, str], list[Task]] = {}
    for task in tasks:
        if task.result.measure not in OWN:
            groups.setdefault((task.result.measure, task.result.task), []).append(task)
    return [_section(trials, language, edition) for trials in groups.values()]


def _section(trials: Sequence[Task], language: Language, edition: Edition | None) -> Section:
    figures: dict[str, list[Figure]] = {}
    for f in (f for t in trials for f in t.result.figures if not f.detail):
        figures.setdefault(f.name, []).append(f)
    rows, about = (
        [_row(each, language, trials[0]) for each in figures.values()],
        [(each[0].what, each[0].part) for each in figures.values()],
    )
    shared = _common_reason([row[-1] for row in rows])
    below = "" if all(row[-1] == shared for row in rows) else language.say("reason.below")
    shown = [[*row[:-1], below if shared and row[-1] == shared else row[-1]] for row in rows]
    norms = [
        norm_words(what, part, trials[0].result.task, language, edition) for what, part in about
    ]
    return {
        "name": trials[0].result.task,
        "measure": trials[0].result.measure,
        "title": language.translate(trials[0].measure_title),
        "task": language.several(
            [
                span_words(trials, language),
                *([language.say(f"grading.{g}")] if (g := trials[0].grading) else []),
            ]
        ),
        "grading": trials[0].grading,
        "trials": [language.say("tapping.trial", number=k + 1) for k in range(len(trials))]
        if len(trials) > 1
        else [language.say("value")],
        "rows": shown,
        "reason": shared,  # of all rows, or of those that point to it
        "advice": advice(
            (f.reason for t in trials for f in t.result.figures if f.grade != "good"), language
        ),
        "reasons": any(row[-1] for row in shown),
        "about": about,
        "norms": norms,
        "normed": list(
            dict.fromkeys(
                ". ".join(w for w in (n["reference"], n["note"]) if w) for n in norms if n
            )
        ),
        "limit": language.known(
            f"limit.{trials[0].result.measure}", ""
        ),  # what the measure cannot tell
        "curves": _curves(trials, language),
        "marks": language.known(
            f"marks.{trials[0].result.measure}", ""
        ),  # what the lines upright mean
        "source": _sources([f.source for t in trials for f in t.result.figures], language),
    }


def _sources(sources: Sequence[str], language: Language) -> str:
    """Each once, also where several figures name it beside others."""
    return language.several(
        dict.fromkeys(language.render(m) for source in sources for m in messages_of(source))
    )


def _common_reason(reasons: Sequence[str]) -> str:
    """The reason that stands in every row, else that of most rows where it would be read REPEATED times and more; "" where none does."""
    counts = Counter(reason for reason in reasons if reason)
    if len(reasons) < 2 or not counts:
        return ""
    reason, count = counts.most_common(1)[0]
    return reason if count == len(reasons) or count >= REPEATED else ""


def _curves(trials: Sequence[Task], language: Language) -> list[tuple[str, list[Panel]]]:
    named_panels = [
        (
            language.say("tapping.trial", number=k + 1) if len(trials) > 1 else "",
            panels(t.result.shown, t.result.onset, language),
        )
        for k, t in enumerate(trials)
    ]
    return [(name, found) for name, found in named_panels if found]


def _row(figures: Sequence[Figure], language: Language, task: Task) -> list[Any]:
    """Name, a value a trial, unit, the worst grade and its reason."""
    worst = max(figures, key=lambda f: GRADES.index(f.grade))
    unit = unit_words(reading(figures[0]).unit, language)
    values = [
        _value(f, language) + (f" ({language.translate(f.category)})" if f.category else "")
        for f in figures
    ]
    reasons = dict.fromkeys(language.translate(f.reason) for f in figures if f.reason)
    return [
        _name(figures[0], task, language),
        values,
        unit,
        [worst.grade, grade_words(worst.grade, language)],
        language.several(reasons),
    ]


def _name(figure: Figure, task: Task, language: Language) -> str:
    """A share says of what it is one: "Index: TAM against the right hand of 24 November 2026, 10:12 UTC"."""
    if figure.what != "tam_share":
        return named(figure, language)
    finger = language.known(f"finger.{figure.part}", figure.part)
    return language.labelled(finger, f"TAM {share_words(figure, task, language)}")


def share_words(figure: Figure, task: Task, language: Language) -> str:
    """Of what a share of total active motion is one: "against the right hand of 24 November 2026, 10:12 UTC"; of a thumb without a word, why."""
    against = _against(figure, task, language)
    if figure.part != "thumb" or figure.category or task.grading in WITHOUT_THUMB:
        return against
    return language.several([against, language.say("share.ungraded")])


def _against(figure: Figure, task: Task, language: Language) -> str:
    other = task.against
    if other is None or figure.part not in other.motion:
        return language.say("share.norm", size=language.number(NORM[figure.part] * DEG))
    moment = {"day": language.day(other.started), "hour": language.hour(other.started)}
    return language.say("share.hand", hand=language.say(f"other.{other.hand}"), **moment)


def norm_words(
    what: str, part: str, task: str, language: Language, edition: Edition | None = None
) -> dict[str, Any] | None:
    """What others measured of a figure, in words, with who says so; None where nobody has."""
    norm = norm_of(what, part, task, edition)
    if norm is None:
        return None
    number = partial(
        language.number,
        decimals=decimals(norm.mean) if norm.sd is None else decimals_of_sd(norm.sd),
    )
    spread = "" if norm.sd is None else f" ± {number(norm.sd)}"
    most = (
        ""
        if norm.low is None or norm.high is None
        else f" ({number(norm.low)} – {number(norm.high)})"
    )
    words = with_unit(f"{number(norm.mean)}{spread}{most}", norm.unit, language)
    return {
        "told": words,
        "reference": language.translate(norm.source.reference),
        "note": language.translate(norm.note),
    }


def _value(figure: Figure, language: Language) -> str:
    """ "81 ± 2" in the unit a person reads, with decimals that a person can use; a deviation below the last of them is left out, and a sign is said in words."""
    read = reading(figure)
    if not np.isfinite(read.value):
        return language.say("not_measured")
    places = 0 if figure.name.endswith("_count") else significant_places(read.value, read.unit)
    size = language.number(abs(read.value), places)
    sd = 0.0 if figure.sd is None else abs(reading(replace(figure, value=figure.sd)).value)
    if 0.5 * 10.0**-places <= sd < np.inf:
        size = f"{size} ± {language.number(sd, places)}"
    return directed(figure.name, read.value, size, language) if read.value else size
