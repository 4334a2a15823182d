"""What a force sensor reads of nothing: learnt whenever the fingertip touches nothing, carried through the contact with what it may have drifted by.

In      readings (n, S, 3) N of S sensors at times t (n,), NaN where missing
Out     their zero (n, S, 3) with its standard deviation, and where each sensor is free (n, S)
Source  Kortier, thesis 6.4: readings follow the supply. The zero is a random walk: Kalman filter and Rauch-Tung-Striebel smoother, here for one number an axis.
        How fast it walks is read from the sensor while it is free, `drift` being what is likely beforehand: ours
Limits  a force that is there from the first to the last sample, or that never changes by more than `least`, is taken for the zero; a sensor whose zero begins
        to walk within a contact shows in the jump only
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.data.samples import every
from handscope.estimators.numerics.intervals import find_runs
from handscope.estimators.numerics.typing import Array, Bools

MEMORY = 1.0  # s over which a zero is averaged to tell whether a reading is still it; ours: a force builds up faster
SURE = 3.5  # standard deviations of the size of a vector of noise
WALKS = np.geomspace(1 / 30, 30.0, 25)  # of what is likely beforehand: how fast a zero may walk
FACTOR = 0.5  # standard deviation of the logarithm of what a zero walks by, sensor by sensor, before anything is read; ours
PERIOD = 0.08  # s: free readings of faster sensors are averaged over so much to tell how fast the zero walks
ROUNDS = 5  # who drifts fast is taken for free more often once that is known
LIKELY = 2.5  # of what it may have drifted by meanwhile: more would take a light grip for nothing


@dataclass(frozen=True, kw_only=True)
class ZeroParams:
    """Options of the zero, N and s."""

    least: float = option(
        0.25,
        "N",
        "a change of the reading of a free sensor below this is no contact",
        "ours: five times its noise",
        least=0.01,
    )
    drift: float = option(
        0.03,
        "N/sqrt(s)",
        "random walk of the zero that is likely; more or less where the free sensor shows it",
        "ours: 0.2 N in a minute; Kortier thesis 6.4 names it without a size",
    )
    guard: float = option(
        0.15,
        "s",
        "samples so near to a contact tell no zero",
        "ours: a force builds up for longer than one sample at 12 Hz",
    )


@dataclass(frozen=True)
class Zero:
    """The zero of every sensor with its standard deviation, N."""

    level: Array  # (n, S, 3) N
    sd: Array  # (n, S) N, of each axis: more where the zeros before and behind a contact differ by more than it seemed to walk
    free: Bools  # (n, S) nothing is touched
    jump: Array  # (n, S) how far these differ, in standard deviations of a zero that walks as is likely or faster; 0 where free or not known
    drift: Array  # (S,) N/sqrt(s) by which each zero was taken to walk


def estimate_zero(params: ZeroParams, t: Array, readings: Array, noise: Array) -> Zero:
    """The zero of every sensor; `noise` (S,) N is that of one reading."""
    n, sensors = readings.shape[:2]
    each = [_free_and_walk(params, t, readings[:, s], float(noise[s])) for s in range(sensors)]
    free, drift = np.stack([f for f, _ in each], axis=1), np.array([walk for _, walk in each])
    level, variance, jump = np.empty_like(readings), np.empty((n, sensors)), np.zeros((n, sensors))
    for s in range(sensors):
        of_one, walk = max(float(noise[s]), 1e-3) ** 2, float(drift[s]) ** 2
        level[:, s], variance[:, s] = _smooth_zero(t, readings[:, s], free[:, s], of_one, walk)
        of = (t, readings[:, s], free[:, s], of_one)
        for first, stop in find_runs(~free[:, s]):
            if first > 0 and stop < n:
                seemed = _zero_jump(*of, walk, first, stop)
                jump[first:stop, s] = (
                    seemed
                    if walk >= params.drift**2
                    else _zero_jump(*of, params.drift**2, first, stop)
                )
                variance[first:stop, s] *= max(1.0, seemed**2)
    return Zero(level, np.sqrt(variance), free, jump, drift)


def _zero_jump(
    t: Array, y: Array, free: Bools, noise: float, drift: float, first: int, stop: int
) -> float:
    """How far the zeros before and behind the readings [first, stop) differ, in standard deviations of a walk with this variance a second."""
    before, behind = (
        _smooth_zero(t[k], y[k], free[k], noise, drift)
        for k in (slice(0, first), slice(stop, len(t)))
    )
    off = float(((before[0][-1] - behind[0][0]) ** 2).mean())
    return float(np.sqrt(off / (before[1][-1] + behind[1][0] + drift * (t[stop - 1] - t[first]))))


def zero_from_others(
    t: Array, readings: Array, free: Bools, noise: float, drift: float
) -> tuple[Array, Array]:
    """Zero (n, 3) and its standard deviation (n,) of other readings (n, 3) of the same sensor, where it is known when it was free (n,).

    `noise` is that of one reading, `drift` that of the zero in the same unit a root of a second; more or less where the free sensor shows it.
    """
    used = free & every(np.isfinite(readings))
    level, variance = _smooth_zero(
        t, readings, used, noise**2, _estimate_walk(t, readings, used, noise, drift) ** 2
    )
    return level, np.sqrt(variance)


def _free_and_walk(params: ZeroParams, t: Array, y: Array, noise: float) -> tuple[Bools, float]:
    """Where the sensor touches nothing (n,), and how fast its zero walks meanwhile."""
    drift = params.drift
    for _ in range(ROUNDS):
        free = _free(params, t, y, noise, drift)
        seen = _estimate_walk(t, y, free, noise, params.drift)
        if seen <= 1.1 * drift:
            break
        drift = seen
    return free, seen


def _free(params: ZeroParams, t: Array, y: Array, noise: float, drift: float) -> Bools:
    """Where the sensor touches nothing (n,): it reads what it read when it was last free, the stillest of its readings to begin with.

    Of a sensor whose noise hides a light touch means are compared, of as many readings as bring it below `least`, over `MEMORY` at most.
    """
    from scipy.ndimage import binary_erosion  # a tenth of what starting takes, for forces alone

    known = every(np.isfinite(y))
    free = np.zeros(len(t), bool)
    if known.sum() < 3:
        return free
    many = min(
        int(np.ceil((SURE * noise / params.least) ** 2)),
        int(MEMORY / np.median(np.diff(t))),
        len(t),
    )
    if many > 1:
        y, noise = _moving_mean(y, known, many), noise / np.sqrt(many)
    gate = max(params.least, SURE * noise)
    level = _resting_level(y[known], gate)
    start = int(np.flatnonzero(known)[np.argmin(np.linalg.norm(y[known] - level, axis=1))])
    for order in (range(start, len(t)), range(start - 1, -1, -1)):
        here, since = level.copy(), t[start]
        for k in order:
            off = np.linalg.norm(y[k] - here)
            if known[k] and off < max(
                gate, LIKELY * np.sqrt(noise**2 + drift**2 * abs(t[k] - since))
            ):
                here = here + (1 - np.exp(-abs(t[k] - since) / MEMORY)) * (y[k] - here)
                since, free[k] = t[k], True
    period = float(np.median(np.diff(t)))
    wide = 2 * max(1, round(params.guard / period)) + 1
    return np.asarray(binary_erosion(free | ~known, np.ones(wide, bool), border_value=1) & known)


def _moving_mean(y: Array, known: Bools, many: int) -> Array:
    """Means (n, 3) of so many readings around each, of those that are known; NaN where it is not."""
    around = np.ones(many)
    sums = np.stack(
        [np.convolve(np.where(known, axis, 0.0), around, "same") for axis in y.T], axis=1
    )
    return np.where(
        known[:, None], sums / np.maximum(np.convolve(known, around, "same"), 1.0)[:, None], np.nan
    )


def _estimate_walk(t: Array, y: Array, free: Bools, noise: float, likely: float) -> float:
    """How fast the zero walks, in the readings' unit a root of a second: root of the mean square of what the free readings leave likely.

    The likelihood of each stretch is that of a Kalman filter's innovations, one filter for each walk of a grid; `likely` where there is none.
    """
    walks = likely * WALKS
    # its mean square is that of what is likely
    chances = -0.5 * (np.log(WALKS) / FACTOR + FACTOR) ** 2
    for first, stop in find_runs(free):
        chances += _log_likelihood(
            *_means(t[first:stop], y[first:stop]), max(noise, 1e-3 * likely) ** 2, walks**2
        )
    weights = np.exp(chances - chances.max())
    return float(np.sqrt(weights @ walks**2 / weights.sum()))


def _log_likelihood(t: Array, y: Array, counts: Array, noise: float, walks: Array) -> Array:
    """Logarithm (m,) of how likely means (n, 3) of so many readings (n,) with this variance are of a zero that walks by variances (m,) a second."""
    log_likelihood = np.zeros(len(walks))
    if not len(t):
        return log_likelihood
    level, variance = np.tile(y[0], (len(walks), 1)), np.full(len(walks), noise / counts[0])
    for seen, dt, of_one in zip(y[1:], np.diff(t).tolist(), (noise / counts[1:]).tolist()):
        variance = variance + walks * dt
        innovation, whole = seen - level, variance + of_one
        log_likelihood -= 0.5 * (3 * np.log(whole) + (innovation**2).sum(axis=1) / whole)
        level, variance = (
            level + (variance / whole)[:, None] * innovation,
            variance * of_one / whole,
        )
    return log_likelihood


def _means(t: Array, y: Array) -> tuple[Array, Array, Array]:
    """Of readings (n, 3) in a row the means over PERIOD, when they are and of how many readings."""
    known = every(np.isfinite(y))
    t, y = t[known], y[known]
    if not len(t):
        return t, y, t
    starts = np.flatnonzero(np.diff(np.floor((t - t[0]) / PERIOD + 1e-6), prepend=-1.0))
    counts = np.diff(starts, append=len(t)).astype(float)
    return np.add.reduceat(t, starts) / counts, np.add.reduceat(y, starts) / counts[:, None], counts


def _resting_level(y: Array, gate: float) -> Array:
    """The level (3,) at which a sensor is most often: what has most readings within the gate."""
    thin = y[:: max(1, len(y) // 400)]
    near = (np.linalg.norm(thin[:, None] - thin[None], axis=-1) < gate).sum(axis=1)
    return np.asarray(thin[np.argmax(near)])


def _smooth_zero(
    t: Array, y: Array, used: Bools, noise: float, drift: float
) -> tuple[Array, Array]:
    """Zero (n, 3) and variance (n,) of a random walk seen where it is used."""
    n = len(t)
    x, p, ahead = np.zeros((n, 3)), [0.0] * n, [0.0] * n  # ahead: variance foretold
    level, variance, before = np.zeros(3), 1e4, float(t[0]) if n else 0.0
    for k, (now, seen) in enumerate(zip(t.tolist(), used.tolist())):
        variance += drift * (now - before)
        ahead[k], before = variance, now
        if seen:
            gain = variance / (variance + noise)
            level, variance = level + gain * (y[k] - level), (1 - gain) * variance
        x[k], p[k] = level, variance
    for k in range(n - 2, -1, -1):
        gain = p[k] / ahead[k + 1]
        x[k] += gain * (x[k + 1] - x[k])
        p[k] += gain**2 * (p[k + 1] - ahead[k + 1])
    return x, np.array(p)
