"""What a measure shows beside its figures, as panels of curves in words and in units a person reads, for reports and pages alike.

Curves that have no panel here are not drawn; whoever wants them finds them in the kept result.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from handscope.app.language import Language
from handscope.app.report.units import READABLE, unit_words
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.measures.plot_data import Curve, PlotData, thin_curves
from handscope.estimators.numerics.typing import Array

POINTS = 600  # of a panel's curve at most: finer than a page
PANELS: Mapping[str, tuple[str, ...]] = {  # by name, the curves in it
    "hand_distance": ("hand_distance",),
    "trunk_forward": ("trunk_forward",),
    "hand_speed": ("hand_speed",),
    "fingertip_speed": ("fingertip_speed",),
    "grip_and_load": ("grip_force", "load_force"),
    "mass": ("mass", "mass_low", "mass_high"),
    "squeeze_force": ("squeeze_force",),
    "squeeze_distance": ("squeeze_distance",),
    "force_over_distance": ("force_over_distance", "fitted_spring"),
    "stiffness": ("stiffness", "stiffness_low", "stiffness_high"),
    "squeeze_response": ("squeeze_response", "squeeze_response_low", "squeeze_response_high"),
    "squeeze_phase": ("squeeze_phase", "squeeze_phase_low", "squeeze_phase_high"),
    "squeeze_coherence": ("squeeze_coherence",),
} | {
    f"torque_{finger}": (f"torque_{finger}", f"torque_{finger}_low", f"torque_{finger}_high")
    for finger in FINGERS
}
DOTS = "force_over_distance"  # measured points, with a line through them


@dataclass(frozen=True)
class Line:
    """One curve of a panel."""

    name: str  # words; "" of a line that stands alone, and of the bounds beside another
    y: tuple[float | None, ...]  # None is a gap


@dataclass(frozen=True)
class Panel:
    """Curves with their axes, in the units named."""

    name: str  # of PANELS
    title: str  # words with the unit
    unit: str
    x_unit: str
    x: tuple[float, ...]  # s since the trial's onset, or another quantity in order of size
    lines: tuple[Line, ...]
    marks: tuple[float, ...]  # s


def panels(shown: PlotData, onset: float, language: Language) -> list[Panel]:
    """The panels of one trial that began at `onset`, s."""
    curves = {c.name: c for c in shown.curves}
    drawn = {name: [curves[w] for w in wanted if w in curves] for name, wanted in PANELS.items()}
    marks = tuple(
        sorted(round(float(t) - onset, 3) for times in shown.marks.values() for t in times)
    )
    return [
        _panel(name, found, onset, marks, language)
        for name, found in drawn.items()
        if found and len(found[0].x)
    ]


def shown_of(stored: Mapping[str, Any] | None) -> PlotData:
    """What a kept result says of a task's curves, None standing for a gap."""
    if not stored:
        return PlotData()
    curves = (
        Curve(c["name"], c["unit"], _array(c["x"]), _array(c["y"]), c.get("x_unit", "s"))
        for c in stored["curves"]
    )
    return PlotData(tuple(curves), {name: _array(times) for name, times in stored["marks"].items()})


def _array(values: list[float | None]) -> Array:
    return np.array([np.nan if v is None else v for v in values], float)


def _panel(
    name: str, found: list[Curve], onset: float, marks: tuple[float, ...], language: Language
) -> Panel:
    first = thin_curves([c for c in found if np.array_equal(c.x, found[0].x)], POINTS)
    unit, factor = READABLE.get(first[0].unit, (first[0].unit, 1.0))
    over_time = first[0].x_unit == "s"
    x_unit, x_factor = READABLE.get(first[0].x_unit, (first[0].x_unit, 1.0))
    x = first[0].x - onset if over_time else x_factor * first[0].x
    words = {c.name: language.known(f"line.{c.name}", "") for c in first}
    lines = tuple(
        Line(words[c.name] if sum(map(bool, words.values())) > 1 else "", _plain(factor * c.y))
        for c in first
    )
    title = language.say(f"panel.{name}", unit=unit_words(unit, language))
    return Panel(
        name,
        title,
        unit,
        x_unit,
        tuple(round(float(v), 4) for v in x),
        lines,
        marks if over_time else (),
    )


def _plain(values: Array) -> tuple[float | None, ...]:
    return tuple(round(float(v), 4) if np.isfinite(v) else None for v in values)
