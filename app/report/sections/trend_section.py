"""Figures over the patient's sessions: a small chart each, those that changed most against what repeated measurement gives."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from handscope.app.language import Language
from handscope.app.report.change_words import value_words
from handscope.app.report.content import Content
from handscope.app.report.progress.labels import label
from handscope.app.report.sections import plots
from handscope.app.report.units import reading
from handscope.estimators.measures.figure import Figure
from handscope.sessions.clinic.repeatability import Key, Values

# sessions before there is a course to look at; a change between two stands with the figures
LEAST = 3
SHOWN = 8
CHART = (168.0, 62.0)  # pt
ALWAYS = ("tapping_rate", "tapping_amplitude_mean")


def trend_section(content: Content, language: Language) -> dict[str, Any] | None:
    """Charts of the figures that the most sessions have; None before there are LEAST sessions."""
    visits = content.course.visits if content.course else ()
    if len(visits) < LEAST:
        return None
    mdc = (
        {(c.measure, c.task, c.name): c.mdc95 for c in content.changes.each}
        if content.changes
        else {}
    )
    keys = _chosen([v.values for v in visits], mdc, _asked_figures(content))
    charts = []
    for key in keys:
        points = [(v.started, _read(key, v.values)) for v in visits if key in v.values]
        moments, values = [m for m, _ in points], [value for _, value in points]
        unit = reading(Figure(key[2], 0.0, visits[-1].values[key][1], "")).unit
        unit = {"Hz": "per s"}.get(unit, unit)
        charts.append(
            {
                "title": label(key[2], language),
                "value": value_words(key[2], values[-1], unit, language),
                "chart": plots.trend_chart(
                    moments, values, mdc.get(key), *CHART, language, _falls(key)
                ),
                "alt": language.counted(
                    "trends.alt",
                    len(values),
                    first=value_words(key[2], values[0], unit, language),
                    last=value_words(key[2], values[-1], unit, language),
                ),
            }
        )
    if not charts:
        return None
    facts = {
        "first": language.day(visits[0].started),
        "last": language.day(visits[-1].started),
    }
    return {
        "title": language.say("trends.title"),
        "task": language.counted("trends.span", len(visits), **facts),
        "charts": charts,
        "caption": language.say("trends.caption"),
    }


def _asked_figures(content: Content) -> set[Key]:
    """Figures of this session, of ranges those that their task asked for."""
    return {
        (t.result.measure, t.result.task, f.name)
        for t in content.tasks
        for f in t.result.figures
        if t.asked is None
        or t.result.measure != "range_of_motion"
        or f.name.rpartition("_")[0] in t.asked
    }


def _chosen(
    visits: Sequence[Values], mdc: Mapping[Key, float | None], asked: Collection[Key]
) -> list[Key]:
    """Keys that the newest visit and LEAST visits have: the tapping figures, then by how much they moved in multiples of their MDC."""
    known = [
        key
        for key in visits[-1]
        if key in asked and sum(key in v for v in visits) >= LEAST and not key[2].endswith("_range")
    ]

    def largest_change(key: Key) -> float:
        values = [_read(key, v) for v in visits if key in v]
        return (max(values) - min(values)) / (mdc.get(key) or float("inf"))

    always = [key for key in known if key[2] in ALWAYS]
    others = sorted(
        (key for key in known if key not in always and mdc.get(key)),
        key=largest_change,
        reverse=True,
    )
    return (always + others)[:SHOWN]


def _falls(key: Key) -> bool:
    """Whether less of the value is more of what the figure is called: extension, radial deviation."""
    return key[0] == "range_of_motion" and key[2].endswith("_min")


def _read(key: Key, values: Values) -> float:
    """In the unit a person reads."""
    value, unit = values[key]
    return reading(Figure(key[2], value, unit, "")).value
