"""The section on finger tapping: a column of figures a trial, and the curve of one of them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from handscope.app.language import Language
from handscope.app.report.change_words import tapping_changes
from handscope.app.report.changes import Changes
from handscope.app.report.content import Task
from handscope.app.report.sections import plots
from handscope.app.report.units import (
    TAPPING_ROWS,
    directed,
    directions_of,
    places_of,
    reading,
    unit_words,
)
from handscope.app.report.words import figure_words, grade_words, span_words
from handscope.estimators.measures.figure import Figure
from handscope.estimators.measures.tapping import Tapping

TRIALS = 4  # columns of a table
CHART = (290.0, 150.0)  # pt
BELOW = (516.0, 150.0)  # pt where the trials leave it no room beside the table


def tapping_section(
    tasks: Sequence[Task],
    before: int,
    total: int,
    language: Language,
    changes: Changes | None = None,
) -> dict[str, Any]:
    """Trials side by side, of `total` of which `before` stand in tables above; the curve is that of the first with a tap."""
    say = language.say
    trials: list[Tapping] = [t.result.details for t in tasks]
    shown = next((k for k, trial in enumerate(trials) if trial.count), None)
    many = total > 1
    every = {f.name: f for f in tasks[0].result.figures}
    named = {name: every[name] for name in TAPPING_ROWS if name in every}
    size = CHART if len(trials) == 1 else BELOW
    return {
        "title": say("tapping.title"),
        "tasks": [
            say("tapping.trial", number=before + k + 1) if many else say("value")
            for k in range(len(tasks))
        ],
        "task": span_words(tasks, language),
        "rows": [
            [
                figure_words(n, language),
                _unit(named[n], language),
                *(_cell(t, n, language) for t in tasks),
            ]
            for n in named
        ],
        "grades": [[t.grade, grade_words(t.grade, language)] for t in trials],
        "remarks": [
            _remark(trial, say("tapping.trial.of", number=before + k + 1) if many else "", language)
            for k, trial in enumerate(trials)
            if trial.reason
        ],
        "chart": plots.tapping_chart(trials[shown], *size, language) if shown is not None else "",
        "chart_alt": say("tapping.chart"),
        "changes": tapping_changes(changes, tasks, language)
        if changes and before + len(tasks) == total
        else "",
        "absent": say("tapping.absent") if shown is None else "",
        "caption": [
            say("tapping.shown", number=before + shown + 1, total=total)
            if many and shown is not None
            else "",
            say("tapping.caption"),
            say("tapping.average") if total < 3 else "",
        ],
    }


def _remark(trial: Tapping, which: str, language: Language) -> str:
    sentence = language.say(
        "signal.because",
        grade=grade_words(trial.grade, language),
        reason=language.translate(trial.reason),
    )
    return f"{which} {sentence}".strip() if which else sentence[0].upper() + sentence[1:]


def _unit(figure: Figure, language: Language) -> str:
    return "" if directions_of(figure.name)[1] else unit_words(reading(figure).unit, language)


def _cell(task: Task, name: str, language: Language) -> str:
    figure = next(f for f in task.result.figures if f.name == name)
    read, sd = reading(figure), abs(reading(replace(figure, value=figure.sd or 0.0)).value)
    if not np.isfinite(read.value):
        return language.say("tapping.too_few" if task.result.details.count else "not_measured")
    decimals = places_of(name, read.value, read.unit)
    number = language.number(abs(read.value), decimals)
    if not directions_of(name)[1]:
        shown = sd >= 0.5 * 10.0**-decimals  # a deviation below the last digit is left out
        return language.number(read.value, decimals) + (
            f" ± {language.number(sd, decimals)}" if shown else ""
        )
    if number == language.number(0.0, decimals):
        return language.say("tapping.same")
    return directed(name, read.value, f"{number} {read.unit}", language)
