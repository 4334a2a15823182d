"""Interpolation of a slowly sampled signal: a cubic between its samples, with a standard deviation that grows between them.

In      samples y (n, S, 3) at t (n,), NaN where missing, variance of one reading (S,)
Out     values and standard deviations at the instants wanted (m,)
Source  Kortier, thesis 6.4: a cubic interpolator feeds the filter. Ours is the same cubic as the estimate under a rate of change that is a random walk
        (Wahba 1978: smoothing splines; Kalman filter and Rauch-Tung-Striebel smoother), so that noise is smoothed and gaps get a standard deviation
Limits  changes faster than half the sampling rate are lost; the size of the random walk is estimated from the samples near by
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.numerics.typing import Array

NEAR = 7  # samples that tell how fast the signal changes its rate
CALM = 0.05  # N/s^1.5: the rate of a force that is held wanders by so much; ours


@dataclass(frozen=True)
class Interpolated:
    """The signal at the instants wanted, in its own unit."""

    values: Array  # (m, S, 3)
    sd: Array  # (m, S) of each axis
    distance: Array  # (m, S) s to the nearest sample used


def reading_noise(t: Array, y: Array) -> Array:
    """Standard deviation (S,) of the noise of single readings (n, S, 3), from the calm half of their third differences."""
    third = np.diff(y, n=3, axis=0)
    return np.array([_spread(third[:, s]) for s in range(y.shape[1])])


def _spread(third: Array) -> float:
    size = np.abs(third[np.isfinite(third).all(axis=-1)])
    if len(size) < 8:
        return 0.05
    # the smaller half of |normal|: its largest is 0.6745 standard deviations
    quiet = np.sort(size, axis=0)[: max(4, len(size) // 2)]
    return float(np.median(quiet[-1]) / 0.6745 / np.sqrt(20.0))


def interpolate(t: Array, y: Array, noise: Array, at: Array) -> Interpolated:
    """The signal at the instants `at`, from all samples before and behind; held outside them, ever less sure."""
    sensors = [
        _interpolate_sensor(t, y[:, s], max(float(noise[s]) ** 2, 1e-8), at)
        for s in range(y.shape[1])
    ]
    return Interpolated(*(np.stack([part[k] for part in sensors], axis=1) for k in range(3)))


def _interpolate_sensor(t: Array, y: Array, noise: float, at: Array) -> tuple[Array, Array, Array]:
    known = np.isfinite(y).all(axis=1)
    t, y = t[known], y[known]
    if len(t) < 4:
        return np.full((len(at), 3), np.nan), np.full(len(at), np.nan), np.full(len(at), np.inf)
    x, P, joint = _smooth(t, y, noise, rate_walk := _rate_walk(t, y, noise))
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    h, s = np.diff(t)[k], np.clip(at - t[k], 0.0, np.diff(t)[k])
    beyond = np.abs(at - np.clip(at, t[0], t[-1]))
    u = s / h
    H = np.stack(
        [1 - u * u * (3 - 2 * u), s * (1 - u) ** 2, u * u * (3 - 2 * u), h * u * u * (u - 1)],
        axis=-1,
    )  # Hermite's cubic
    ends = np.concatenate([x[k], x[k + 1]], axis=-1)  # (m, 3, 4): value and rate at both ends
    covariance = np.block([[P[k], joint[k]], [joint[k].transpose(0, 2, 1), P[k + 1]]])
    variance = (
        np.einsum("mi,mij,mj->m", H, covariance, H) + rate_walk[k] * (s * (h - s) / h) ** 3 / 3
    )  # of the bridge between two samples
    distance = np.minimum(np.abs(at - t[k]), np.abs(t[k + 1] - at))
    variance += (
        rate_walk.mean() * beyond**3 / 3 + (ends[..., 1::2] ** 2).mean(axis=(1, 2)) * beyond**2
    )  # held while the rate goes on
    return np.einsum("mai,mi->ma", ends, H), np.sqrt(np.maximum(variance, 0.0)), distance


def _rate_walk(t: Array, y: Array, noise: float) -> Array:
    """Variance a second by which the rate of change wanders, in each interval (n - 1,): of second differences near by, less their noise."""
    from scipy.ndimage import uniform_filter1d  # a tenth of what starting takes, for forces alone

    h = np.diff(t)
    bend = np.diff(np.diff(y, axis=0) / h[:, None], axis=0)
    own = noise * (1 / h[:-1] ** 2 + (1 / h[:-1] + 1 / h[1:]) ** 2 + 1 / h[1:] ** 2)
    # so much may hide in the noise: counted as if it were there
    unseen = np.sqrt(2 / (3 * NEAR)) * own
    seen = uniform_filter1d((bend**2).mean(axis=1) - own, min(NEAR, len(bend)), mode="nearest")
    near = np.maximum(3 * (np.maximum(seen, 0.0) + unseen) / (h[:-1] + h[1:]), CALM**2)
    return np.concatenate([near[:1], 0.5 * (near[:-1] + near[1:]), near[-1:]])


def _smooth(t: Array, y: Array, noise: float, rate_walk: Array) -> tuple[Array, Array, Array]:
    """Value and rate (n, 3, 2), their covariance (n, 2, 2), and that of neighbours (n - 1, 2, 2)."""
    n = len(t)
    x, foretold, gains = np.empty((n, 3, 2)), np.empty((n, 3, 2)), np.empty((n, 2, 2))
    # of symmetric matrices: value, both, rate. numbers take half the time of matrices
    P, ahead = np.empty((n, 3)), np.empty((n, 3))
    value, rate, (p, b, r) = y[0], np.zeros(3), (noise, 0.0, 1e4)
    x[0], P[0] = np.stack([value, rate], axis=1), (p, b, r)
    for k, h, q, row in zip(range(1, n), np.diff(t).tolist(), rate_walk.tolist(), y[1:]):
        value = value + h * rate
        foretold[k, :, 0], foretold[k, :, 1] = value, rate
        c, d = p + h * b, b + h * r  # of F P, F = [[1, h], [0, 1]]
        A, B, R = c + h * d + q * h**3 / 3, d + q * h**2 / 2, r + q * h
        det = A * R - B * B
        gains[k - 1] = (
            ((c * R - b * B) / det, (b * A - c * B) / det),
            ((d * R - r * B) / det, (r * A - d * B) / det),
        )
        ahead[k] = A, B, R
        own, other, missed = A / (A + noise), B / (A + noise), row - value
        value, rate = value + own * missed, rate + other * missed
        p, b, r = A - own * A, B - own * B, R - other * B
        x[k, :, 0], x[k, :, 1], P[k] = value, rate, (p, b, r)
    covariance, before = (m[:, [0, 1, 1, 2]].reshape(n, 2, 2) for m in (P, ahead))
    joint = np.empty((n - 1, 2, 2))
    for k in range(n - 2, -1, -1):
        G = gains[k]
        joint[k] = G @ covariance[k + 1]
        x[k] += (x[k + 1] - foretold[k + 1]) @ G.T
        covariance[k] += joint[k] @ G.T - G @ before[k + 1] @ G.T
    return x, covariance, joint
