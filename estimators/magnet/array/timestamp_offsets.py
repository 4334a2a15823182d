"""Magnetometers of an array whose readings are of another instant than the others': told by a magnet that moves, and moved to when they were taken.

In      times and readings of an array; what errs alike in all readings (magnet_alike.py)
Out     what readings change by; Late: by how much each magnetometer is later than the middle one; readings moved by that
Source  a reading that is late by tau is off by -tau dB/dt, so that tau is one more error of the linear mixed model of magnet_alike.py; moved and looked at again
        until none is sure (Gauss & Newton), as what a reading changes by is linear for a short while only
Limits  what all are late by moves the times of places and is not seen; where many differ, the middle one's time is taken, as unsure as they differ. A magnet that
        hardly moves tells nothing, and so does one whose readings one magnet does not explain
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.magnet.array.bench_readings import resample_readings
from handscope.estimators.magnet.array.systematic_errors import KINDS, SystematicErrors, error_kinds
from handscope.estimators.numerics.typing import Array, Bools

HALF_WINDOW = 0.02  # s to each side over which a change is looked at: quieter than between neighbours, and movement is straight for so long
MAX_INTERVAL = (
    0.25  # s between readings: what is further apart says nothing of the change in between
)
SIGNIFICANT_SD, MIN_OFFSET, MIN_CORRECTION = (
    4.0,
    1e-3,
    3e-3,
)  # standard deviations, s: less is not looked at again; less is left to the mixed model
MAD = 1.4826  # standard deviations of a median of sizes
LATE = next(k for k, kind in enumerate(KINDS) if kind.name == "late")


@dataclass(frozen=True)
class TimestampOffsets:
    offsets: Array  # (magnetometers,) s against the middle one
    sd: Array  # (magnetometers,) s

    @property
    def is_significant(self) -> Bools:
        return np.asarray(np.abs(self.offsets) > np.maximum(MIN_OFFSET, SIGNIFICANT_SD * self.sd))

    @property
    def spread(self) -> float:
        """Standard deviation by which the time of all is unsure, s: none where all but a few agree."""
        return float(MAD * np.median(np.abs(self.offsets)))


def change_rates(t: Array, mag: Array) -> Array:
    """What readings (n, magnetometers, 3) T at t (n,) s change by, T/s; 0 where too little is known."""
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
    """Of `many` magnetometers. What they are late by together is not told by readings but by how large lateness is taken to be: each is held against the others."""
    rows = np.flatnonzero(error_kinds(many) == LATE)
    against = np.eye(many) - 1.0 / many
    tau = KINDS[LATE].size * systematic.errors[rows]
    variance = np.diag(against @ systematic.covariance[np.ix_(rows, rows)] @ against)
    return TimestampOffsets(tau - np.median(tau), KINDS[LATE].size * np.sqrt(variance))


def shift_readings(t: Array, mag: Array, offsets: Array) -> Array:
    """Readings (n, magnetometers, 3) at t of magnetometers that are late by `late` (magnetometers,) s; NaN where that would be outside the recording."""
    return np.stack(
        [
            resample_readings(t, t - tau, mag[:, k]) if tau else mag[:, k]
            for k, tau in enumerate(offsets)
        ],
        axis=1,
    )
