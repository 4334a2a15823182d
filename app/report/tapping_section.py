"""The section on finger tapping: a column of figures a trial, and the curve of one of them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from app.report import plots
from app.report.change_words import tapping_changes
from app.report.changes import Changes
from app.report.content import Task
from app.report.units import reading
from app.report.words import span_words
from estimators.measures.figure import Figure
from estimators.measures.tapping import Tapping

TRIALS = 4  # columns of a table
CHART = (340.0, 118.0)  # pt
TRIAL_WIDTH = 56.0  # pt that every further trial takes from the chart
FIGURES = {  # of the tapping table: label, decimals
    "tapping_count": ("Taps", 0),
    "tapping_rate": ("Rate", 2),
    "tapping_interval_mean": ("Interval, mean", 3),
    "tapping_interval_cv": ("Interval, variation", 1),
    "tapping_amplitude_mean": ("Amplitude, mean", 1),
    "tapping_amplitude_cv": ("Amplitude, variation", 1),
    "tapping_opening_speed_mean": ("Opening speed, peak", 0),
    "tapping_closing_speed_mean": ("Closing speed, peak", 0),
    "tapping_decrement_slope": ("Change per tap", 2),
    "tapping_decrement_ratio": ("Last five against first", 1),
}
CHANGES = {"tapping_decrement_slope", "tapping_decrement_ratio"}  # read as "smaller" or "larger", not as a sign


def tapping_section(tasks: Sequence[Task], before: int, total: int, changes: Changes | None = None) -> dict[str, Any]:
    """Trials side by side, of `total` of which `before` stand in tables above; the curve is that of the first with a tap."""
    trials: list[Tapping] = [t.result.details for t in tasks]
    shown = next((k for k, trial in enumerate(trials) if trial.count), None)
    many = total > 1
    named = {f.name: f for f in tasks[0].result.figures}
    return {
        "tasks": [f"Trial {before + k + 1}" if many else "Value" for k in range(len(tasks))],
        "task": span_words(tasks),
        "rows": [[_label(n)[0], _unit(named[n]), *(_cell(t, n) for t in tasks)] for n in named],
        "grades": [t.grade for t in trials],
        "remarks": [_remark(trial, f"Trial {before + k + 1}: " if many else "") for k, trial in enumerate(trials) if trial.reason],
        "chart": plots.tapping_chart(trials[shown], CHART[0] - TRIAL_WIDTH * (len(trials) - 1), CHART[1]) if shown is not None else "",
        "chart_alt": "Above: distance between thumb and index finger over time, closings marked. Below: amplitude of every tap with its regression line.",
        "changes": tapping_changes(changes, tasks, FIGURES) if changes and before + len(tasks) == total else "",
        "absent": "No complete tap was found, so there is no curve to show." if shown is None else "",
        "caption": [
            f"Trial {before + shown + 1} of {total} shown." if many and shown is not None else "",
            "Distance between the bone ends of thumb and index finger; triangles mark closings (soft tissue keeps them above zero). "
            "Dashed: regression of amplitude on tap.",
            "The decrement of one trial says little about one person: average three or more." if total < 3 else "",
        ],
    }


def _remark(trial: Tapping, which: str) -> str:
    said = f"{which}{trial.grade} signal, {trial.reason}."
    return said[0].upper() + said[1:]


def _label(name: str) -> tuple[str, int]:
    return FIGURES.get(name, (name.removeprefix("tapping_").replace("_", " ").capitalize(), 2))


def _unit(figure: Figure) -> str:
    unit = reading(figure).unit
    return "" if figure.name in CHANGES else {"Hz": "per s"}.get(unit, unit)


def _cell(task: Task, name: str) -> str:
    figure = next(f for f in task.result.figures if f.name == name)
    value, decimals = reading(figure).value, _label(name)[1]
    if not np.isfinite(value):
        return "not measured" if not task.result.details.count else "too few taps"
    if name in CHANGES:
        size = f"{abs(value):.{decimals}f}"
        return "no change" if float(size) == 0 else f"{size} {reading(figure).unit} {'smaller' if value < 0 else 'larger'}"
    return f"{value:.{decimals}f}"
