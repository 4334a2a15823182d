"""Whether the magnet stood still before magnetometers that stood still: what the inertial sensor of a hand that slides without turning cannot tell.

In      the newest readings of the magnetometers, a window that ends at each sample
Out     whether the field changed within the window by more than noise
Source  ours. Zero velocity by a generalised likelihood ratio (zero_velocity.py) takes a slow smooth reach for a tilt: 1 m/s^2 along the ground
        changes the size of the specific force by 0.5 %. The magnet's field then changes by three times the share of the distance that the hand went
Limits  a magnet that is hardly heard may move unseen
"""

import numpy as np
from numpy.typing import NDArray

from estimators.quaternions import Array

SURE = 5.0  # standard deviations of the mean square of differences beyond which they are no noise


def moving(mag: Array, length: int, noise: float) -> NDArray[np.bool_]:
    """Of every window of `length` samples in mag (n, magnetometers, 3) T, of which some may be NaN, whether its halves differ: (n - length + 1,)."""
    flat = mag.reshape(len(mag), -1)
    half = length // 2
    first, many = _means(flat[: len(flat) - length + half], half)
    second, more = _means(flat[length - half :], half)
    with np.errstate(divide="ignore", invalid="ignore"):
        square = (second - first) ** 2 / (noise**2 * (1.0 / many + 1.0 / more))
    known = np.isfinite(square)
    count = known.sum(axis=1)
    mean = np.where(known, square, 0.0).sum(axis=1) / np.maximum(count, 1)
    return np.asarray((count > 0) & (mean > 1.0 + SURE * np.sqrt(2.0 / np.maximum(count, 1))))


def _means(flat: Array, length: int) -> tuple[Array, Array]:
    """Means over windows and how many readings they rest on; NaN without any."""
    known = np.isfinite(flat)
    windows = np.lib.stride_tricks.sliding_window_view(np.where(known, flat, 0.0), length, axis=0)
    count = np.lib.stride_tricks.sliding_window_view(known, length, axis=0).sum(axis=-1)
    with np.errstate(invalid="ignore"):
        return np.asarray(windows.sum(axis=-1) / count), np.asarray(count)
