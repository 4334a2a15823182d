"""A signal made ready to be measured: one uniform time base, gaps known, noise above a frequency taken off, its slope.

In      times t (n,) s and values (n,) of one quantity, sampled anyhow: unevenly, with NaN, with holes
Out     the same on an even grid of the median period; NaN where a hole is too long to bridge
Source  Butterworth low-pass, twice second order, forwards and backwards (no delay); bridging by straight lines: ours
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label
from scipy.signal import butter, sosfiltfilt

from handscope.estimators.errors import InputError
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

LEAST = 16  # samples of a signal that can be filtered


@dataclass(frozen=True)
class Even:
    """A signal on an even grid."""

    t: Array  # (n,) s
    values: Array  # (n,) bridged everywhere
    known: np.ndarray  # (n,) bool, False in holes too long to bridge
    period: float  # s

    @property
    def gapped(self) -> Array:
        """The values with NaN in the holes."""
        return np.where(self.known, self.values, np.nan)

    @property
    def lost(self) -> float:
        """s in holes."""
        return float((~self.known).sum() * self.period)

    def slope(self) -> Array:
        """Change per second (n,), by central differences."""
        return np.gradient(self.values, self.period)


def resample_even(t: Array, values: Array, max_gap: float = 0.1, lowpass: float = 0.0) -> Even:
    """The signal on an even grid. InputError where times or values cannot be a signal."""
    t, values = check_signal(t, values)
    used = np.isfinite(values)
    at, found = t[used], values[used]
    # samples in bursts are no reason for a huge grid
    period = max(float(np.median(np.diff(at))), (at[-1] - at[0]) / (8 * len(at)))
    grid = at[0] + period * np.arange(round((at[-1] - at[0]) / period) + 1)
    level = np.interp(grid, at, found)
    gap = np.flatnonzero(np.diff(at) > max(max_gap, 1.5 * period))
    holes = np.zeros(len(grid), bool)
    for k in gap:
        holes |= (grid > at[k] + 1e-9) & (grid < at[k + 1] - 1e-9)
    if lowpass and 0.5 / period > 1.2 * lowpass and len(level) >= LEAST:
        level = sosfiltfilt(butter(2, lowpass * 2 * period, output="sos"), level)
    return Even(grid, np.asarray(level), ~holes, period)


def check_signal(t: Array, values: Array) -> tuple[Array, Array]:
    """Times and values as float arrays of one dimension; InputError in words where they are no signal."""
    try:
        t, values = np.asarray(t, float), np.asarray(values, float)
    except (TypeError, ValueError):
        raise InputError("measure.signal_not_numbers") from None
    if t.ndim != 1 or t.shape != values.shape:
        raise InputError("measure.signal_shape", shape=str(t.shape), shape2=str(values.shape))
    if not np.isfinite(t).all() or (np.diff(t) <= 0).any():
        raise InputError("measure.signal_time_not_increasing")
    if np.isinf(values).any():
        raise InputError("measure.signal_infinite")
    if np.isfinite(values).sum() < 3:
        raise InputError("measure.signal_too_short", values=int(np.isfinite(values).sum()))
    return t, values


def stretches(inside: np.ndarray) -> list[tuple[int, int]]:
    """First and last index of every run of True."""
    named, count = label(inside)
    return [(int(k[0]), int(k[-1])) for k in (np.flatnonzero(named == i + 1) for i in range(count))]


def angular_rates(t: Array, q_GS: Array) -> Array:
    """Angular rates (n, 3), rad/s, in the turning frame, of orientations (n, 4) at times t (n,): NaN where a neighbour is unknown."""
    between = quat.log(quat.relative(q_GS[:-1], q_GS[1:])) / np.diff(t)[:, None]
    return np.concatenate([between[:1], 0.5 * (between[:-1] + between[1:]), between[-1:]])
