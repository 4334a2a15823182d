"""Synchronise two recordings of one movement by cross-correlation of the angles that both hold.

In      two signals of the same channels (n, channels) on clocks of their own, at any rates, NaN where not known
Out     the lag that brings B's time to A's, finer than a sample, with the correlation found there
Source  Kortier, thesis 3.2.5 (post-hoc cross-correlation); correlation of data with holes: Padfield 2012, IEEE Trans Image Process 21:2706, (18)
Limits  two clocks are taken to run equally fast here, clock_drift.py looks for the rest; a movement that only repeats itself fits at every period:
        the lag of the longest overlap is taken then and the next one is reported as `rival`
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.ndimage import convolve1d
from scipy.optimize import minimize_scalar

from handscope.estimators.errors import InputError
from handscope.estimators.numerics.typing import Array

GRID = 50.0  # Hz of the search at most: a hand moves below 10 Hz; the lag is then refined on the samples themselves
SMOOTHING = 0.02  # s, standard deviation of the low-pass for the refined lag: half at 9 Hz
LONGEST_GAP = 0.1  # s between known samples that is still interpolated
LEAST_OVERLAP = 0.25  # of the shorter recording that both must show; ours
SHORTEST_OVERLAP = 1.0  # s
LEAST_CORRELATION = 0.6  # of a peak that convinces; more where the overlap is short: _by_chance
CONVINCING = 0.9  # always convinces: four fifths of the variance. Different simulated tasks, each behind the same initial pose, reach 0.87 at most
MOVING = 0.05  # of a signal's variance that its part within the overlap must have to be compared
AS_GOOD = 1.1  # a peak whose unexplained share is at most this times the best one's fits as well
SLACK = 1e-3  # of correlation between peaks that are the same but for rounding and the grid


@dataclass(frozen=True)
class Signal:
    """Channels on one clock."""

    t: Array  # (n,) s, increasing
    values: Array  # (n, channels), NaN where not known


@dataclass(frozen=True)
class Drift:
    """How much faster B's clock runs than A's: seconds of B too many in a second of A."""

    value: float
    sd: float
    windows: int  # that it was read from
    applied: bool  # it is beyond chance and matters


@dataclass(frozen=True)
class Lag:
    """How B's clock stands against A's: t_A = t_B + seconds at A's time `at`; before and after that less or more by the drift."""

    seconds: float
    correlation: float  # pooled over the channels, means removed; NaN where it was not looked for
    overlap: float  # s that both show
    rival: float | None = None  # s, another lag that fits as well: the movement repeats itself
    at: float = 0.0  # s, A's clock
    drift: Drift | None = None  # None: not looked for, or too little to tell it from

    @property
    def rate(self) -> float:
        """B's seconds in a second of A, less one."""
        return self.drift.value if self.drift and self.drift.applied else 0.0

    def on_b(self, t_a: Array) -> Array:
        """A's instants by B's clock."""
        return np.asarray(t_a - self.seconds + self.rate * (t_a - self.at))

    def on_a(self, t_b: Array) -> Array:
        """B's instants by A's clock."""
        return np.asarray((t_b + self.seconds + self.rate * self.at) / (1.0 + self.rate))


def synchronise(a: Signal, b: Signal, longest: float = np.inf) -> Lag:
    """The lag of at most `longest` s either way at which B fits A best; InputError where none convinces."""
    rate = min(GRID, max(rate_of(a), rate_of(b)))
    on_a, on_b = _resample(a, rate), _resample(b, rate)
    for name, signal in (("A", on_a), ("B", on_b)):
        if not variance(signal.values).sum() > 1e-12:
            raise InputError("measure.nothing_moves", name=name)
    lags, r, overlap = _correlations(on_a, on_b, rate)
    usable = (np.abs(lags) <= longest) & np.isfinite(r)
    if not usable.any():
        if np.isfinite(longest):
            raise InputError(
                "measure.overlap_within_lag", percent=100 * LEAST_OVERLAP, longest=longest
            )
        raise InputError("measure.overlap", percent=100 * LEAST_OVERLAP)
    best, rival = _choose_peak(lags, np.where(usable, r, -np.inf), overlap)
    found = _refine(a, b, float(lags[best]), 1.0 / rate)
    needed = np.clip(
        _chance_correlation(on_a, on_b, float(overlap[best]), rate), LEAST_CORRELATION, CONVINCING
    )
    if found.correlation < needed:
        raise InputError(
            "measure.correlation_too_small",
            correlation=found.correlation,
            seconds=found.seconds,
            needed=needed,
            overlap=overlap[best],
        )
    return Lag(found.seconds, found.correlation, float(overlap[best]), rival)


def fit_at(a: Signal, b: Signal, seconds: float) -> Lag:
    """The lag that is given, with the correlation there; InputError where the recordings do not overlap."""
    shifted = interpolate(b, a.t - seconds)
    both = np.isfinite(a.values) & np.isfinite(shifted)
    if both.any(axis=1).sum() < 3:
        raise InputError("measure.no_overlap", seconds=seconds)
    return Lag(
        seconds, pooled_correlation(a.values, shifted), float(both.any(axis=1).sum() / rate_of(a))
    )


def interpolate(signal: Signal, at: Array) -> Array:
    """Values (m, channels) at instants `at`: cubic through the four samples around, linear where an outer one is not known.

    NaN outside, where one of the two neighbours is not known, and in gaps; a sample's own instant gives that sample.
    """
    t, v, n = signal.t, signal.values, len(signal.t)
    if n < 2:
        return np.full((len(at), v.shape[1]), np.nan)
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, n - 2)
    span = t[k + 1] - t[k]
    u = ((at - t[k]) / span)[:, None]
    linear = np.where(u == 0, v[k], np.where(u == 1, v[k + 1], v[k] * (1 - u) + v[k + 1] * u))
    longest = max(LONGEST_GAP, 1.5 / rate_of(signal))
    off = (u < -1e-9) | (u > 1 + 1e-9) | ((span > longest)[:, None] & (u != 0) & (u != 1))
    linear[np.broadcast_to(off, linear.shape)] = np.nan
    around = np.clip(k[:, None] + np.arange(-1, 3), 0, n - 1)
    smooth = (k > 0) & (k < n - 2) & (np.diff(t[around], axis=1) <= longest).all(axis=1)
    nodes, x = t[around[smooth]], at[smooth]
    cubic = np.zeros((len(x), v.shape[1]))
    for j in range(4):
        others = [m for m in range(4) if m != j]
        # Lagrange
        weight = np.prod([(x - nodes[:, m]) / (nodes[:, j] - nodes[:, m]) for m in others], axis=0)
        cubic += weight[:, None] * v[around[smooth, j]]
    linear[smooth] = np.where(
        np.isfinite(cubic) & np.isfinite(linear[smooth]), cubic, linear[smooth]
    )
    return linear


def rate_of(signal: Signal) -> float:
    """Samples a second of a signal, Hz."""
    return float(1.0 / np.median(np.diff(signal.t))) if len(signal.t) > 1 else GRID


def _resample(signal: Signal, rate: float) -> Signal:
    t = (
        signal.t[0]
        + np.arange(int(np.floor((signal.t[-1] - signal.t[0]) * rate + 1e-6)) + 1) / rate
    )
    return Signal(t, interpolate(signal, t))


def variance(values: Array) -> Array:
    """Variance (channels,) of what is known; 0 where nothing is."""
    known = np.isfinite(values)
    n = np.maximum(known.sum(axis=0), 1)
    mean = np.where(known, values, 0.0).sum(axis=0) / n
    return np.asarray((np.where(known, values - mean, 0.0) ** 2).sum(axis=0) / n)


def _correlations(a: Signal, b: Signal, rate: float) -> tuple[Array, Array, Array]:
    """Lags (k,) s, correlation (k,) pooled over the channels, NaN where too little is in common, and that overlap (k,) s."""
    n_a, n_b = len(a.t), len(b.t)
    size = next_fast_len(n_a + n_b - 1, real=True)
    shifts = np.arange(-(n_b - 1), n_a)
    cov, var_a, var_b, most = (np.zeros(len(shifts)) for _ in range(4))
    moved_a, moved_b = np.zeros(len(shifts)), np.zeros(len(shifts))
    for x, y in zip(a.values.T, b.values.T):
        (m_a, x0, x2), (m_b, y0, y2) = _spectra(x, size), _spectra(y, size)

        def sums(left: NDArray[np.complex128], right: NDArray[np.complex128]) -> Array:
            return np.asarray(irfft(left * np.conj(right), size)[shifts])

        n = np.rint(sums(m_a, m_b))
        count = np.maximum(n, 1)
        of_a, of_b = sums(x0, m_b), sums(m_a, y0)
        cov += sums(x0, y0) - of_a * of_b / count
        var_a += sums(x2, m_b) - of_a**2 / count
        var_b += sums(m_a, y2) - of_b**2 / count
        most = np.maximum(most, n)
        moved_a += variance(x[:, None])[0] * n
        moved_b += variance(y[:, None])[0] * n
    overlap = most / rate
    least = max(SHORTEST_OVERLAP, LEAST_OVERLAP * min(n_a, n_b) / rate)
    enough = (
        (overlap >= least - 1e-9)
        & (var_a > MOVING * moved_a)
        & (var_b > MOVING * moved_b)
        & (moved_a > 0)
        & (moved_b > 0)
    )
    r = np.where(enough, cov / np.sqrt(np.where(enough, var_a * var_b, 1.0)), np.nan)
    return a.t[0] - b.t[0] + shifts / rate, r, overlap


def _spectra(
    x: Array, size: int
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128]]:
    """Spectra of where x is known, of x about its mean, and of its square."""
    known = np.isfinite(x)
    centred = np.where(known, x - (x[known].mean() if known.any() else 0.0), 0.0)
    return rfft(known.astype(float), size), rfft(centred, size), rfft(centred**2, size)


def _choose_peak(lags: Array, r: Array, overlap: Array) -> tuple[int, float | None]:
    """Index of the peak to take, and the lag of the best other one that fits as well, if any."""
    inner = np.flatnonzero((r[1:-1] >= r[:-2]) & (r[1:-1] > r[2:]) & np.isfinite(r[1:-1])) + 1
    peaks = np.unique(np.append(inner, np.argmax(r)))
    height = np.array([_vertex(r, int(k)) for k in peaks])
    top = height.max()
    good = peaks[(1 - height) <= AS_GOOD * (1 - top) + SLACK]
    order = sorted(good, key=lambda k: (-round(float(overlap[k]), 6), abs(lags[k])))
    return int(order[0]), float(lags[order[1]]) if len(order) > 1 else None


def _vertex(r: Array, k: int) -> float:
    """Height of the parabola through a peak and its neighbours."""
    if not 0 < k < len(r) - 1 or not np.isfinite(r[k - 1 : k + 2]).all():
        return float(r[k])
    curve = r[k - 1] - 2 * r[k] + r[k + 1]
    return (
        float(min(1.0, r[k] - (r[k + 1] - r[k - 1]) ** 2 / (8 * curve)))
        if curve < 0
        else float(r[k])
    )


def smooth_both(a: Signal, b: Signal) -> tuple[Signal, Signal]:
    """Both through the same low-pass, NaN where they were: between samples noise is averaged, and its lower variance draws a lag to half a sample."""
    sd = max(SMOOTHING, 1.0 / rate_of(a), 1.0 / rate_of(b))
    return _smooth(a, sd), _smooth(b, sd)


def _smooth(signal: Signal, sd: float) -> Signal:
    samples = sd * rate_of(signal)
    reach = int(np.ceil(3 * samples))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / samples) ** 2)
    known = np.isfinite(signal.values)
    share = convolve1d(known.astype(float), kernel, axis=0, mode="constant")
    sums = convolve1d(np.where(known, signal.values, 0.0), kernel, axis=0, mode="constant")
    return Signal(signal.t, np.where(known, sums / np.where(known, share, 1.0), np.nan))


def _refine(a: Signal, b: Signal, lag: float, step: float) -> Lag:
    """The lag within a grid step either way at which B, interpolated, fits A's samples best, and the correlation of the samples there."""
    # the others tell nothing and cost as much
    moving = variance(a.values) > 1e-4 * variance(a.values).max()
    soft_a, soft_b = smooth_both(Signal(a.t, a.values[:, moving]), Signal(b.t, b.values[:, moving]))
    thin = max(1, round(rate_of(a) * step))
    at, x = soft_a.t[::thin], soft_a.values[::thin]
    s, _ = minimise_near(
        lambda seconds: -pooled_correlation(x, interpolate(soft_b, at - seconds)), lag, step
    )
    return Lag(s, pooled_correlation(a.values, interpolate(b, a.t - s)), np.nan)


def minimise_near(cost: Callable[[float], float], lag: float, reach: float) -> tuple[float, float]:
    """The lag within `reach` of a lag at which a cost is least, and that cost."""
    found = minimize_scalar(  # about the lag: scipy's tolerance grows with the argument
        lambda s: cost(lag + s), bounds=(-reach, reach), method="bounded", options={"xatol": 1e-6}
    )
    return lag + float(found.x), float(found.fun)


def pooled_correlation(x: Array, y: Array) -> float:
    """Correlation over all channels together, each about its own mean."""
    both = np.isfinite(x) & np.isfinite(y)
    n = np.maximum(both.sum(axis=0), 1)
    x, y = np.where(both, x, 0.0), np.where(both, y, 0.0)
    x, y = np.where(both, x - x.sum(axis=0) / n, 0.0), np.where(both, y - y.sum(axis=0) / n, 0.0)
    power = float((x * x).sum() * (y * y).sum())
    return float((x * y).sum() / np.sqrt(power)) if power > 0 else np.nan


def _chance_correlation(a: Signal, b: Signal, overlap: float, rate: float) -> float:
    """Correlation that the best of all lags reaches with another movement of the same bandwidth: Fisher's z of as many values as are independent."""
    bandwidth = min(_bandwidth(a, rate), _bandwidth(b, rate))
    independent = max(2 * bandwidth * overlap - 3, 1.0)
    tried = max(2 * bandwidth * (len(a.t) + len(b.t)) / rate, 2.0)
    return float(np.tanh(np.sqrt(2 * np.log(tried) / independent)))


def _bandwidth(signal: Signal, rate: float) -> float:
    """RMS frequency in Hz (Rice): of the rates against the values."""
    total = variance(signal.values).sum()
    rates = np.nan_to_num(np.diff(signal.values, axis=0) * rate)
    return float(np.clip(np.sqrt((rates**2).mean(axis=0).sum() / total) / (2 * np.pi), 0.05, 10.0))
