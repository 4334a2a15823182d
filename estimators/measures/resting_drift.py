"""Drift: how far apart thumb and fingertip seem to move from rest to rest, though every segment is inclined as before.

Rest      a second or more in which no measured segment turns faster than 5 deg/s; a longer one counts once every 30 s
Posture   the same where gravity, seen from thumb, finger and hand, points within 10 deg of where it does in one of them: inclinations come
          from the accelerometers and do not drift, headings may
Drift     slope of the tips' distance over time through the rests (Theil 1950; Sen 1968, J Am Stat Assoc 63:1379), where their order in time is
          no chance (Kendall 1938, Biometrika 30:81; p < 0.01 over the four fingers), times the time from the first to the last
Source    ours
Limits    a hand that opens at rest a little more each time, all segments inclined as before, drifts to this measure, too
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.stats import kendalltau, theilslopes

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import FINGERS, SEGMENTS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.intervals import find_runs
from handscope.estimators.numerics.typing import Array, Bools, Indices

STEP = 0.5  # s between the samples that are compared
SPEED = np.radians(5.0)  # rad/s, the fastest turn of a segment at rest
SHORTEST = 1.0  # s
LONGEST = 30.0  # s of a rest that count as one
TOLERANCE = np.radians(10.0)  # rad between the inclinations of two rests
FEWEST = 6  # rests; of fewer, Kendall's p is never below 0.01
CHANCE = 0.01
SMALLEST = 5e-3  # m, the accuracy of a tip


@dataclass(frozen=True)
class Drift:
    """What the distance between the tips of thumb and finger seems to change by while the hand rests; SI units."""

    finger: str
    start: float  # s, first rest
    end: float  # s, last rest
    before: float  # m, distance at `start` by the line through the rests
    after: float  # m, at `end`
    rests: int


def resting_drift(moved: Trajectory) -> Drift | None:
    """The largest drift of a fingertip against the thumb's tip; None where none of 5 mm shows.

    Parameters
    ----------
    moved : Trajectory
        From one calibration to the next.
    """
    thin = moved.at(_steps(moved.t))
    rests = list(_rests(thin))
    if len(rests) < FEWEST:
        return None
    t = np.array([thin.t[r].mean() for r in rests])
    gravity = quat.rotate(quat.conjugate(thin.q_GS), np.array([0.0, 0.0, 1.0]))
    inclined = np.array([gravity[r].mean(axis=0) for r in rests])
    tip_distances = np.linalg.norm(thin.tips[:, 1:] - thin.tips[:, :1], axis=-1)
    distances = np.array([tip_distances[r].mean(axis=0) for r in rests])
    found = (_drift(finger, t, inclined, distances[:, k]) for k, finger in enumerate(FINGERS[1:]))
    return max((d for d in found if d), key=lambda d: abs(d.after - d.before), default=None)


def _drift(finger: str, t: Array, inclined: Array, distances: Array) -> Drift | None:
    """The drift of one finger over rests at `t` with gravity `inclined` (n, segments, 3) and tips `distances` m apart."""
    segments = [k for k, s in enumerate(SEGMENTS) if s.startswith((finger, "thumb")) or s == "hand"]
    chosen = _same_posture(inclined[:, segments]) & np.isfinite(distances)
    if chosen.sum() < FEWEST:
        return None
    t, distances = t[chosen], distances[chosen]
    if kendalltau(t, distances).pvalue >= CHANCE / len(FINGERS[1:]):
        return None
    line = theilslopes(distances, t)
    before, after = (float(line.intercept + line.slope * end) for end in (t[0], t[-1]))
    if abs(after - before) < SMALLEST:
        return None
    return Drift(finger, float(t[0]), float(t[-1]), before, after, len(t))


def _same_posture(inclined: Array) -> Bools:
    """The rests (n,) in the posture of the one whose posture most share; segments that are not measured (NaN) count for nothing."""
    unit = inclined / np.linalg.norm(inclined, axis=-1, keepdims=True)
    cosines = np.einsum("isk,jsk->ijs", unit, unit)
    pairs: Bools = ~(cosines < np.cos(TOLERANCE)).any(axis=-1)
    chosen: Bools = pairs[pairs.sum(axis=1).argmax()]
    return chosen


def _steps(t: Array) -> Indices:
    """The first sample of each step of time."""
    return np.unique((t // STEP).astype(int), return_index=True)[1]


def _rests(thin: Trajectory) -> Iterator[slice]:
    """Rows of each rest of a trajectory at a sample a step, a longer one in pieces."""
    turned = quat.angle(quat.relative(thin.q_GS[:-1], thin.q_GS[1:])) / np.diff(thin.t)[:, None]
    still = np.isfinite(turned).any(axis=1) & ~(turned > SPEED).any(axis=1)
    piece, shortest = round(LONGEST / STEP), round(SHORTEST / STEP)
    for first, stop in find_runs(still):
        for start in range(first, stop, piece):
            if (end := min(start + piece, stop)) - start >= shortest:
                yield slice(start, end + 1)
