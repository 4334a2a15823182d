"""Movements there and back of an angle - fists, turns of the forearm -, measured in the same terms as finger tapping.

In      an angle (n,) that is smallest where a cycle begins and ends, its standard deviation, the grade of the samples
Out     cycles, stops, figures, curves
Source  cycles.py and cycle_figures.py
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handscope.estimators.measures import cycle_figures, cycles
from handscope.estimators.measures.cycle_figures import (
    CycleWords,
    size_kinds,
    stop_kinds,
    time_kinds,
)
from handscope.estimators.measures.cycles import Cycles, Params, Stops
from handscope.estimators.measures.figure import Figure, Grade, Kind, kinds
from handscope.estimators.measures.plot_data import Curve, PlotData
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array

# of the speed that counts as hardly any movement: itself, and how far the counts hang on it
STILL = 1.0, 0.8, 1.2


@dataclass(frozen=True)
class Words:
    """What a measure's figures are called."""

    prefix: str
    cycle: CycleWords
    opening: str  # the angle that opens, "angle by which the palm faces up"
    angle: str  # the same where it stands alone, "the angle by which the palm faces up"

    def times(self) -> Mapping[str, Kind]:
        return time_kinds(self.prefix, self.cycle)

    def sizes(self) -> Mapping[str, Kind]:
        return size_kinds(self.prefix, self.cycle, "rad", self.opening)

    def stops(self) -> Mapping[str, Kind]:
        return stop_kinds(self.prefix, self.angle)

    def kinds(self) -> Mapping[str, Kind]:
        return kinds(*self.times().values(), *self.sizes().values(), *self.stops().values())


@dataclass(frozen=True)
class CycleResult:
    """One trial."""

    params: Params
    cycles: Cycles | None  # None: not measured
    stops: tuple[Stops, ...]  # at STILL times the threshold speed
    sd: float | None  # rad, of the angle's error at one instant
    grade: Grade
    reason: str


def measure_cycles(
    params: Params,
    t: Array,
    angle: Array,
    within: tuple[float, float],
    graded: tuple[Grade, str],
    sd: float | None = None,
) -> CycleResult:
    """Cycles within [onset, end] of an angle (n,) in rad."""
    if np.isfinite(angle).sum() < 3:
        return CycleResult(params, None, (), None, "poor", phrase("measure.not_measured"))
    c = cycles.find_cycles(params, t, angle, params.smallest_turn, within)
    if not c.count:
        return CycleResult(params, c, (), sd, "poor", phrase("measure.no_movement"))
    moving = (float(c.closings[0]), min(within[1], float(c.t[-1])))
    stops = tuple(cycles.find_stops(params, t, angle, moving, share) for share in STILL)
    return CycleResult(params, c, stops, sd, *cycles.grade_cycles(c, graded))


def measure_array(params: Params, t: Array, angle: Array, sd: float | None) -> CycleResult:
    """Cycles of plain arrays as a whole; InputError where they are no signal."""
    cycles.require_fast(params, t, angle)
    return measure_cycles(params, t, angle, (-np.inf, np.inf), ("good", ""), sd)


def list_figures(words: Words, r: CycleResult) -> list[Figure]:
    """The flat list of figures."""
    graded = (r.grade, r.reason)
    if r.cycles is None or not r.cycles.count:
        count = np.nan if r.cycles is None else 0.0
        return [
            k.of(count if k.what.endswith("_count") else np.nan, 0.0, *graded)
            for k in words.kinds().values()
        ]
    made = cycle_figures.time_figures(r.params, words.times(), words.prefix, r.cycles, graded)
    made += cycle_figures.size_figures(
        r.params, words.sizes(), words.prefix, r.cycles, r.sd, graded
    )
    return made + cycle_figures.stop_figures(
        r.params, words.stops(), words.prefix, r.cycles, r.stops, graded
    )


def plot_cycles(words: Words, r: CycleResult) -> PlotData:
    """The angle over time with closings and freezes, and the amplitude of every cycle."""
    if r.cycles is None:
        return PlotData()
    c = r.cycles
    curves = (
        Curve(f"{words.prefix}_angle", "rad", c.t, c.opening),
        Curve(f"{words.prefix}_amplitude", "rad", np.arange(1.0, c.count + 1), c.amplitudes, "1"),
    )
    marks = {"closing": c.closings}
    if r.stops and not r.stops[0].hide(c):
        marks["freeze"] = r.stops[0].lasting(r.params.freeze)
    return PlotData(curves, marks)
