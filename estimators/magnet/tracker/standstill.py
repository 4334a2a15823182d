"""Standstill of trunk and hand. For the hand the magnetometers help: a slide that its inertial
sensor cannot tell from rest changes the field.

In      inertial samples and the newest readings of the magnetometers, a window that ends at each
        sample
Out     whether the window passes the standstill test; whether the field changed within it by more
        than noise
Source  ours. The likelihood ratio (zero_velocity_detector.py) takes a slow smooth reach for a tilt:
        1 m/s^2 along the ground changes the size of the specific force by 0.5 %. The magnet's field
        then changes by three times the relative change of its distance
Limits  a magnet with little signal may move undetected
"""

import numpy as np

from handscope.estimators.numerics.typing import Array, Bools
from handscope.estimators.sensors.zero_velocity_detector import likelihood_ratios

SLIDE = 48  # samples over which a slow slide shows in the magnet's field
SURE = 5.0  # standard deviations of the mean square difference


def detect_standstill(
    recent: Array,
    samples: Array,
    mag: Array,
    length: int,
    gyr_sd: float,
    acc_sd: float,
    noise: float,
) -> tuple[Array, Bools]:
    """The newest rows that the next test needs, and whether base and target stood still up to each
    sample (n, 2). `recent` (m, 12 + 3 magnetometers) precedes samples (n, 12) and mag (n,
    magnetometers, 3); limits as in zero_velocity_detector.py, `noise` of a magnetometer T."""
    window_rows = np.concatenate(
        [recent, np.column_stack([samples, mag.reshape(len(mag), 3 * mag.shape[1])])]
    )
    still = np.zeros((len(samples), 2), bool)
    if len(window_rows) >= length and len(samples):
        first = max(len(window_rows) - len(samples) - length + 1, 0)
        for k, inertial in enumerate(np.split(window_rows[first:, :12], 2, axis=1)):
            windows = np.lib.stride_tricks.sliding_window_view(inertial, length, axis=0)
            gyr, acc = np.split(windows.transpose(0, 2, 1), 2, axis=2)
            ratio = likelihood_ratios(gyr, acc, gyr_sd, acc_sd)
            still[len(samples) - len(ratio) :, k] = ratio < 1.0
    if len(window_rows) >= SLIDE and len(samples):
        fields = window_rows[:, 12:].reshape(len(window_rows), mag.shape[1], 3)
        slides = detect_field_change(fields, SLIDE, noise)[-len(samples) :]
        known = still[len(samples) - len(slides) :]
        known[:, 1] &= ~(slides & known[:, 0])
    return window_rows[-(max(length, SLIDE) - 1) :], still


def detect_field_change(mag: Array, length: int, noise: float) -> Bools:
    """Whether the halves of each window of `length` samples of mag (n, magnetometers, 3) T differ,
    NaN where missing: (n - length + 1,). What several magnetometers have in common is the ambient
    field of a breathing trunk."""
    flat = (mag - _common(mag) if mag.shape[1] > 1 else mag).reshape(len(mag), -1)
    half = length // 2
    first, many = _means(flat[: len(flat) - length + half], half)
    second, more = _means(flat[length - half :], half)
    with np.errstate(divide="ignore", invalid="ignore"):
        square = (second - first) ** 2 / (noise**2 * (1.0 / many + 1.0 / more))
    known = np.isfinite(square)
    count = known.sum(axis=1)
    mean = np.where(known, square, 0.0).sum(axis=1) / np.maximum(count, 1)
    return np.asarray((count > 0) & (mean > 1.0 + SURE * np.sqrt(2.0 / np.maximum(count, 1))))


def _common(mag: Array) -> Array:
    """Mean (n, 1, 3) of the magnetometers that answered; NaN where none did."""
    known = np.isfinite(mag)
    with np.errstate(invalid="ignore"):
        return np.asarray(
            np.where(known, mag, 0.0).sum(axis=1, keepdims=True) / known.sum(axis=1, keepdims=True)
        )


def _means(flat: Array, length: int) -> tuple[Array, Array]:
    """Means over windows and how many readings they rest on; NaN without any."""
    known = np.isfinite(flat)
    windows = np.lib.stride_tricks.sliding_window_view(np.where(known, flat, 0.0), length, axis=0)
    count = np.lib.stride_tricks.sliding_window_view(known, length, axis=0).sum(axis=-1)
    with np.errstate(invalid="ignore"):
        return np.asarray(windows.sum(axis=-1) / count), np.asarray(count)
