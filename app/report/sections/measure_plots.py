"""The curves of measures without a section of their own, as small SVG figures of a report, three in a row."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from handscope.app.language import Language
from handscope.app.report.sections.plots import (
    ACCENT,
    GREY,
    HAIR,
    INK,
    axes_at,
    drawing,
    named,
    number_axis,
    svg_of,
)
from handscope.app.report.sections.shown_panels import DOTS, Line, Panel
from handscope.estimators.numerics.typing import Array

WIDTH, HEIGHT = 165.0, 84.0  # pt of a panel
LEFT, BOTTOM, TOP = 24.0, 21.0, 12.0  # pt for the numbers beside and below, and the words above
LINES = (("-", 0.8, INK), ((0, (4, 1.5)), 0.8, ACCENT), ((0, (1, 1)), 0.7, GREY))
BOUND = ((0, (1, 1)), 0.6, GREY)


def draw_panels(section: dict[str, Any], language: Language) -> dict[str, Any]:
    """The section with figures in place of its curves."""
    charts = [
        {
            "title": panel.title,
            "trial": trial,
            "chart": panel_chart(panel, language),
            "alt": f"{trial} {panel.title}".strip(),
        }
        for trial, found in section["curves"]
        for panel in found
    ]
    return {**section, "curves": charts}


def panel_chart(panel: Panel, language: Language) -> str:
    """One panel; the second line dashed, what stands to either side of an estimate dotted."""
    with drawing():
        figure = Figure(figsize=(WIDTH / 72, HEIGHT / 72))
        ax = axes_at(figure, LEFT, BOTTOM, WIDTH - LEFT - 8, HEIGHT - BOTTOM - TOP, WIDTH, HEIGHT)
        x = np.array(panel.x)
        for mark in panel.marks:
            ax.axvline(mark, color=HAIR, lw=0.6, zorder=0)
        for k, line in enumerate(panel.lines):
            _line(ax, panel, k, x, _array(line))
        ax.axhline(0, color=HAIR, lw=0.5, zorder=0)
        ax.set_xlim(float(x[0]), max(float(x[-1]), float(x[0]) + 1e-3))
        ax.locator_params(axis="x", nbins=5)
        ax.locator_params(axis="y", nbins=4)
        for axis in (ax.xaxis, ax.yaxis):
            number_axis(axis, language)
        ax.set_xlabel(panel.x_unit, labelpad=1)
        named(ax, _legend(panel, language))
        return svg_of(figure)


def _line(ax: Axes, panel: Panel, k: int, x: Array, y: Array) -> None:
    if panel.name == DOTS and k == 0:
        ax.plot(x, y, ls="", marker="o", ms=1.0, mec="none", mfc=ACCENT, alpha=0.5)
        return
    alone = sum(bool(line.name) for line in panel.lines) < 2
    style, width, colour = LINES[min(k, 2)] if not alone or not k else BOUND
    ax.plot(x, y, ls=style, lw=width, color=colour)


def _legend(panel: Panel, language: Language) -> str:
    """What the lines are, above the axes; the figure's title stands in the document."""
    labelled = [(line.name, k) for k, line in enumerate(panel.lines) if line.name]
    return (
        ", ".join(language.say(f"panel.stroke.{k}", line=name) for name, k in labelled)
        if labelled
        else ""
    )


def _array(line: Line) -> Array:
    return np.array([np.nan if v is None else v for v in line.y], float)
