"""An angle or distance that was held, not a spike: its running median, and the instants of its extremes.

In      values (n,) of one quantity and which samples may be used
Out     the running median over `hold`, NaN where the window is not full
"""

import numpy as np
from scipy.ndimage import median_filter

from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.measures.figure import Grade, grade_of
from handscope.estimators.numerics.typing import Array

UNUSABLE = np.uint8(Flag.HEADING_LOST | Flag.MISSING | Flag.SATURATED | Flag.FAULTY)


def window_length(t: Array, hold: float) -> int:
    """Samples of the running median: odd."""
    return max(1, round(hold / float(np.median(np.diff(t))))) | 1


def running_median(values: Array, usable: np.ndarray, window: int) -> Array | None:
    """The running median over usable samples, NaN where the window is not full; None where there are too few."""
    good = np.flatnonzero(usable & np.isfinite(values))
    if len(good) < window:
        return None
    median, half = np.full(len(values), np.nan), window // 2
    full = slice(half, len(good) - half)
    median[good[full]] = median_filter(values[good], size=window)[full]
    return median


def least_from(begin: int, values: Array) -> int:
    """Index of the smallest of values (n,) from `begin` on, of all where none is known there."""
    first = begin if np.isfinite(values[begin:]).any() else 0
    return first + int(np.nanargmin(values[first:]))


def usable_samples(part: Trajectory, segments: list[int]) -> np.ndarray:
    """Which samples (n,) of these segments may be used."""
    return np.asarray(((part.flags[:, segments] & UNUSABLE) == 0).all(axis=1))


def task_samples(trajectory: Trajectory, onset: float, end: float) -> Trajectory:
    """The samples of a task, its last one too."""
    return trajectory.between(onset, float(np.nextafter(end, np.inf)))


def grade_window(part: Trajectory, segments: list[int]) -> tuple[Grade, str]:
    """Grade and reason of what rests on these segments."""
    return grade_of(part.flags[:, segments])
