"""Timestamp offsets between the magnetometers of an array, observed by a moving magnet, and their
correction.

In      times and readings of an array; systematic errors of all readings (systematic_errors.py)
Out     rates of change of readings; TimestampOffsets against the middle magnetometer; readings
        shifted by them
Source  a reading late by tau is off by -tau dB/dt: one more error of the linear mixed model of
        systematic_errors.py. Corrected and estimated again (Gauss-Newton) until none is
        significant, as a reading changes linearly only for a short while
Limits  a common offset shifts all times and is not observable; where many differ, the middle one's
        time holds, as uncertain as they differ. A magnet that hardly moves, or readings that one
        magnet does not explain, determine no offset
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.magnet.array.bench_readings import resample_readings
from handscope.estimators.magnet.array.systematic_errors import KINDS, SystematicErrors, error_kinds
from handscope.estimators.numerics.typing import Array, Bools

HALF_WINDOW = 0.02  # s to each side of a difference quotient
MAX_INTERVAL = 0.25  # s between readings: no difference quotient over more
# standard deviations, s: smaller ones are not iterated; s: smaller ones stay in the mixed model
SIGNIFICANT_SD, MIN_OFFSET, MIN_CORRECTION = 4.0, 1e-3, 3e-3
MAD = 1.4826  # standard deviation over the median of magnitudes
LATE = next(k for k, kind in enumerate(KINDS) if kind.name == "late")


@dataclass(frozen=True)
class TimestampOffsets:
    """Offset of each magnetometer's times with its standard deviation, s."""

    offsets: Array  # (magnetometers,) s against the middle one
    sd: Array  # (magnetometers,) s

    @property
    def is_significant(self) -> Bools:
        return np.asarray(np.abs(self.offsets) > np.maximum(MIN_OFFSET, SIGNIFICANT_SD * self.sd))

    @property
    def spread(self) -> float:
        """Standard deviation of the common time, s: 0 where all but a few agree."""
        return float(MAD * np.median(np.abs(self.offsets)))


def change_rates(t: Array, mag: Array) -> Array:
    """Rates of change, T/s, of readings (n, magnetometers, 3) T at t (n,) s; 0 where too little is
    known."""
    if len(t) < 2:
        return np.zeros_like(mag)
    half = max(1, round(HALF_WINDOW * (len(t) - 1) / float(t[-1] - t[0])))
    before, after = (
        np.clip(np.arange(len(t)) - half, 0, None),
        np.clip(np.arange(len(t)) + half, None, len(t) - 1),
    )
    interval = t[after] - t[before]
    change = (mag[after] - mag[before]) / interval[:, None, None]
    return np.where(np.isfinite(change) & (interval < MAX_INTERVAL)[:, None, None], change, 0.0)


def estimate_timestamp_offsets(systematic: SystematicErrors, many: int) -> TimestampOffsets:
    """Offsets of `many` magnetometers, each against the others: a common offset is not observable
    but by its prior."""
    rows = np.flatnonzero(error_kinds(many) == LATE)
    against = np.eye(many) - 1.0 / many
    tau = KINDS[LATE].size * systematic.errors[rows]
    variance = np.diag(against @ systematic.covariance[np.ix_(rows, rows)] @ against)
    return TimestampOffsets(tau - np.median(tau), KINDS[LATE].size * np.sqrt(variance))


def shift_readings(t: Array, mag: Array, offsets: Array) -> Array:
    """Readings (n, magnetometers, 3) at t, shifted by offsets (magnetometers,) s; NaN outside the
    recording."""
    return np.stack(
        [
            resample_readings(t, t - tau, mag[:, k]) if tau else mag[:, k]
            for k, tau in enumerate(offsets)
        ],
        axis=1,
    )
