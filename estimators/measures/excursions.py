"""Repetitions within a task: excursions of the hand from the posture in which the task began, and back.

In      a trajectory and the stretch of time of a task; or what a measure cut into cycles, which is taken as it is
Out     spans (start, stop) s, in order, that touch where the hand was nearest to where it began
Source  ours: distance of all joint angles, and of gravity's direction in the hand, from their medians over the first BEGIN s, each as a share of its own
        range from the 5th to the 95th percentile; it is away above 70 % of its range and back below 30 %, as repetitions.py counts live
Limits  of movements that differ more than about twofold in size only the larger ones are found
"""

from collections.abc import Iterable
from typing import Any

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import SEGMENT
from handscope.estimators.measures.cycles import Cycles
from handscope.estimators.measures.repetitions import HIGH, LOW
from handscope.estimators.measures.time_window import task_samples
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

BEGIN = 0.3  # s whose median is the posture at the beginning
LEAST = np.radians(10.0)  # of an angle's range: less is no movement
SMALL = 0.25  # of the largest range: angles that move less follow others
KNOWN = 0.5  # share of the samples that an angle needs
UP = np.array([0.0, 0.0, 1.0])
Span = tuple[float, float]


def repetitions(
    trajectory: Trajectory, onset: float, end: float, details: Iterable[Any] = ()
) -> list[Span]:
    """Of the first of the measures' details that has cycles those, else excursions."""
    for found in (getattr(d, "cycles", None) for d in details):
        if isinstance(found, Cycles):
            return [(float(a), float(b)) for a, b in zip(found.onsets, found.ends)]
    part = task_samples(trajectory, onset, end)
    return find_excursions(part.t, _distance_from_start(part)) if len(part) > 3 else []


def find_excursions(t: Array, away: Array) -> list[Span]:
    """Spans of a distance (n,) that is small at rest."""
    known = np.isfinite(away)
    if known.sum() < 3:
        return []
    t, away = t[known], away[known]
    bottom, top = np.percentile(away, [5, 95])
    if top <= bottom:
        return []
    share = (away - bottom) / (top - bottom)
    sides = (share > HIGH).astype(int) - (share < LOW)
    beyond = np.flatnonzero(sides)
    # stays on one side, samples between the thresholds left out
    runs = np.split(beyond, np.flatnonzero(np.diff(sides[beyond])) + 1)
    rests = [(float(t[r[0]]), float(t[r[-1]])) for r in runs if sides[r[0]] < 0]
    return [
        _excursion_span(rests, float(t[r[0]]), float(t[r[-1]]), (float(t[0]), float(t[-1])))
        for r in runs
        if sides[r[0]] > 0
    ]


def _excursion_span(rests: list[Span], start: float, stop: float, ends: Span) -> Span:
    """From the middle of the rest before to the middle of the rest after, or the task's ends."""
    before, after = [r for r in rests if r[1] < start], [r for r in rests if r[0] > stop]
    return sum(before[-1]) / 2 if before else ends[0], sum(after[0]) / 2 if after else ends[1]


def _distance_from_start(part: Trajectory) -> Array:
    """Distance (n,) from the posture at the beginning, each angle as a share of its own range; without a unit, NaN where nothing moves."""
    up = quat.rotate(quat.conjugate(part.q_GS[:, SEGMENT["hand"]]), UP)
    # a component of a direction changes as its angle does
    columns = np.column_stack([part.angles.reshape(len(part), -1), up])
    columns = columns[:, np.isfinite(columns).mean(axis=0) > KNOWN]
    if not columns.size:
        return np.full(len(part), np.nan)
    ranges = np.ptp(np.nanpercentile(columns, [5, 95], axis=0), axis=0)
    moving = ranges > max(LEAST, SMALL * float(ranges.max()))
    if not moving.any():
        return np.full(len(part), np.nan)
    difference = columns[:, moving] - np.nanmedian(
        columns[part.t <= part.t[0] + BEGIN][:, moving], axis=0
    )
    return np.asarray(np.sqrt(np.nansum((difference / ranges[moving]) ** 2, axis=1)))
