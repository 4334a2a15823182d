"""A figure over the sessions, for print: the goal's and the measurement error's bands, treatment as numbered lines, the other hand dashed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from handscope.app.language import Language
from handscope.app.report.sections.plots import (
    ACCENT,
    BAND,
    GREY,
    INK,
    UNKNOWN,
    axes_at,
    drawing,
    label_days,
    svg_of,
)

GOAL = "#dcebdd"
WIDTH, HEIGHT = 168.0, 74.0  # pt
BEFORE = 60  # days before the first session in which treatment stands in the chart
NEAR = 0.08  # part of the span within which numbers of treatment stand together


@dataclass(frozen=True)
class Shown:
    """What a chart shows, in the unit a person reads."""

    own: Sequence[tuple[datetime, float]]  # the hand's sessions, the oldest first
    other: Sequence[tuple[datetime, float]]
    mdc95: float | None
    goal: tuple[float, float] | None
    treatment: Mapping[int, date]  # days by the number in the list
    falls: bool = False  # less of the value is more of what the figure is called, and further up


def course_chart(shown: Shown, language: Language) -> str:
    """The chart as SVG."""
    first = shown.own[0][0]

    def days(moment: datetime) -> float:
        return (moment - first).total_seconds() / 86400

    last = max(days(shown.own[-1][0]), 1.0)
    lines = {n: float((day - first.date()).days) for n, day in shown.treatment.items()}
    lines = {n: x for n, x in lines.items() if x >= -max(BEFORE, last)}
    base = shown.own[0][1]
    half = UNKNOWN * abs(base) if shown.mdc95 is None else shown.mdc95
    with drawing():
        figure = Figure(figsize=(WIDTH / 72, HEIGHT / 72))
        ax = axes_at(figure, 24, 13, WIDTH - 30, HEIGHT - 26, WIDTH, HEIGHT)
        if shown.mdc95 is not None:
            ax.axhspan(base - half, base + half, color=BAND, lw=0, zorder=0)
        if shown.goal:
            ax.axhspan(*shown.goal, color=GOAL, lw=0, zorder=0.2, alpha=0.8)
        left = min([0.0, *lines.values()])
        _draw_treatment(ax, lines, last - left)
        for points, style in ((shown.other, "--"), (shown.own, "-")):
            colour = INK if points is shown.own else GREY
            at, values = [days(m) for m, _ in points], [value for _, value in points]
            ax.plot(at, values, style, lw=0.8, color=colour, marker="o", ms=2.4, zorder=2)
        every = [value for _, value in (*shown.own, *shown.other)]
        seen = [*every, base - half, base + half, *(shown.goal or ())]
        air = 0.08 * max(max(seen) - min(seen), 1e-9)
        air_x = 0.04 * (last - left)
        ax.set(
            xlim=(left - air_x, last + air_x),
            ylim=(min(seen) - air, max(seen) + air),
        )
        ax.yaxis.set_inverted(shown.falls)
        label_days(ax, last, (first, shown.own[-1][0]), language)
        return svg_of(figure)


def _draw_treatment(ax: Axes, lines: Mapping[int, float], span: float) -> None:
    labels: list[tuple[float, str]] = []
    for number, x in sorted(lines.items(), key=lambda line: line[1]):
        ax.axvline(x, color=ACCENT, lw=0.8, zorder=1)
        if labels and x - labels[-1][0] <= NEAR * span:
            labels[-1] = labels[-1][0], f"{labels[-1][1]}, {number}"
        else:
            labels.append((x, f"{number}"))
    for x, words in labels:
        ax.annotate(
            words, (x, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 1.5),
            textcoords="offset points", ha="center", va="bottom", fontsize=6.5, color=ACCENT,
        )  # fmt: skip
