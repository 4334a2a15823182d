"""Drift between the clocks of two recordings: the lag estimated in windows, and a robust line through the lags.

In      two signals of the same channels, the lag at which they fit best as a whole (synchronisation.py)
Out     the lag at the start of the common stretch, the drift and its standard deviation; the drift is applied where it is significant and large enough
Source  ours: the sampling errors of crystals are below 1e-4, of computers' and cameras' time stamps below 1e-3; line by weighted least squares,
        outliers are removed by Tukey's biweight (Beaton & Tukey 1974, Technometrics 16:147); weights: the inverse variance of a
        delay estimate (Quazi 1981, IEEE Trans ASSP 29:527), proportional to the squared bandwidth and the ratio of signal to noise
Limits  a drift that changes (temperature) is reported as its mean; windows without movement carry no information; needs 12 s
"""

from dataclasses import replace

import numpy as np
from scipy.special import stdtrit

from handscope.estimators.errors import InputError
from handscope.estimators.measures.synchronisation import (
    Drift,
    Lag,
    Signal,
    interpolate,
    minimise_near,
    pooled_correlation,
    rate_of,
    smooth_both,
    synchronise,
    variance,
)
from handscope.estimators.numerics.typing import Array

MOST = 1e-3  # largest drift of a clock that is looked for
SHORTEST, WINDOWS = 2.0, 24  # s of a window, how many at most
# informative windows: for a line with a standard deviation, and for one with outliers removed
LEAST, MANY = 6, 10
FITTING = 0.6  # least correlation of an informative window
MOVING = 0.05  # least variance of an informative window, share of the mean of all
STEP = 0.02  # s of the search within a window
PART, TRIED = (
    120.0,
    3,
)  # s of a stretch, how many are tried where the recordings do not fit as a whole
CHANCE = 1e-3  # significance level: how often a drift is found where there is none
MATTERS = 1e-3  # s over the common stretch, least drift that is applied: a tenth of a sample
# standard deviations; 95 % as efficient as least squares where there are no outliers
BIWEIGHT = 4.685


def synchronised_clocks(a: Signal, b: Signal, longest: float = np.inf) -> Lag:
    """The lag of at most `longest` s at which B fits A best, and the drift; InputError where none convinces.

    Hours with a drift fit at no lag as a whole: then the lag is estimated in the minutes with most movement, and tracked from there.
    """
    try:
        return with_drift(a, b, synchronise(a, b, longest))
    except InputError:
        for part in _busiest_parts(a):
            try:
                found = with_drift(a, b, synchronise(part, b, longest), float(part.t.mean()))
            except InputError:
                continue
            if found.rate:
                return found
        raise


def with_drift(a: Signal, b: Signal, lag: Lag, around: float | None = None) -> Lag:
    """The lag with the drift that was found, if any; `around`: A's time where the lag is known to hold, else the middle of the movement."""
    a = _cut(a, *_common_stretch(a, b, lag))
    if len(a.t) < 2 or (span := float(a.t[-1] - a.t[0])) < LEAST * SHORTEST:
        return lag
    moving = variance(a.values) > 1e-4 * variance(a.values).max()
    a, b = Signal(a.t, a.values[:, moving]), Signal(b.t, b.values[:, moving])
    samples_a, samples_b = a, b
    a, b = smooth_both(a, b)
    edges = np.linspace(a.t[0], a.t[-1], int(min(WINDOWS, span // SHORTEST)) + 1)
    parts = [_cut(a, first, last) for first, last in zip(edges[:-1], edges[1:])]
    middles, lags, weights = _track_windows(parts, b, lag, around)
    if len(lags) < LEAST:
        return lag
    start, slope, sd = _fit_line(middles - a.t[0], lags, weights)
    limit = float(stdtrit(len(lags) - 2, 1 - CHANCE / 2)) * sd
    applied = abs(slope) > limit and abs(slope) * span > MATTERS
    drift = Drift(-slope, sd, len(lags), applied)
    if not applied:
        return replace(lag, drift=drift)
    found = replace(lag, seconds=start, at=float(a.t[0]), drift=drift)
    better = pooled_correlation(a.values, interpolate(b, found.on_b(a.t)))
    if better < pooled_correlation(
        a.values, interpolate(b, a.t - lag.seconds)
    ):  # the windows have followed something else
        return replace(lag, drift=replace(drift, applied=False))
    return replace(
        found,
        correlation=pooled_correlation(samples_a.values, interpolate(samples_b, found.on_b(a.t))),
        overlap=span,
    )


def _busiest_parts(a: Signal) -> list[Signal]:
    """The stretches of PART s with most movement, of a signal that is longer than two of them."""
    count = int((a.t[-1] - a.t[0]) // PART)
    edges = np.linspace(a.t[0], a.t[-1], count + 1) if count > 1 else np.zeros(0)
    parts = [_cut(a, first, last) for first, last in zip(edges[:-1], edges[1:])]
    return sorted(
        (p for p in parts if len(p.t) > 2), key=lambda p: -float(variance(p.values).sum())
    )[:TRIED]


def _track_windows(
    parts: list[Signal], b: Signal, lag: Lag, around: float | None
) -> tuple[Array, Array, Array]:
    """Middle, lag and weight of every informative window: from the middle of the movement outwards, each searched near its neighbour's lag."""
    power = np.array([variance(p.values).sum() * len(p.t) if len(p.t) else 0.0 for p in parts])
    ends = np.array([p.t[-1] if len(p.t) else np.inf for p in parts])
    seed = int(
        np.searchsorted(np.cumsum(power), 0.5 * power.sum())
        if around is None
        else np.searchsorted(ends[:-1], around)
    )
    # the lag of the whole is that of the middle of the movement, about
    reach = MOST * 0.5 * lag.overlap
    found: dict[int, tuple[float, float, float]] = {}
    for order in (range(seed, len(parts)), range(seed - 1, -1, -1)):
        near, t_near = (
            (lag.seconds, None) if seed not in found else (found[seed][1], found[seed][0])
        )
        for k in order:
            part = parts[k]
            if len(part.t) < 3 or power[k] <= MOVING * power.mean():
                continue
            middle = float(part.t.mean())
            seconds, r = _local_lag(
                part, b, near, reach if t_near is None else MOST * abs(middle - t_near)
            )
            if r < FITTING:
                continue
            near, t_near = seconds, middle
            found[k] = (
                middle,
                seconds,
                _bandwidth(part) ** 2 * len(part.t) * min(r * r / max(1 - r * r, 1e-9), 1e4),
            )
    rows = np.array([found[k] for k in sorted(found)]).reshape(-1, 3)
    return rows[:, 0], rows[:, 1], rows[:, 2]


def _local_lag(part: Signal, b: Signal, near: float, reach: float) -> tuple[float, float]:
    """Lag and correlation of one window within `reach` of a lag."""
    reach += STEP
    b = _cut(b, part.t[0] - near - reach - 1.0, part.t[-1] - near + reach + 1.0)

    def misfit(seconds: float) -> float:
        r = pooled_correlation(part.values, interpolate(b, part.t - seconds))
        return -r if np.isfinite(r) else 1.0

    if len(b.t) < 4:
        return near, -1.0
    steps = near + np.arange(-np.ceil(reach / STEP), np.ceil(reach / STEP) + 1) * STEP
    best = float(steps[int(np.argmin([misfit(float(s)) for s in steps]))])
    seconds, least = minimise_near(misfit, best, STEP)
    return seconds, -least


def _fit_line(t: Array, lags: Array, weights: Array) -> tuple[float, float, float]:
    """Value at 0, slope and its standard deviation."""
    robust = np.ones(len(t))
    for _ in range(30):
        w = weights * robust
        middle, mean = np.average(t, weights=w), np.average(lags, weights=w)
        spread = float((w * (t - middle) ** 2).sum())
        slope = float((w * (t - middle) * (lags - mean)).sum() / spread)
        off = (lags - mean - slope * (t - middle)) * np.sqrt(weights)
        if len(t) < MANY:
            break
        scale = max(1.4826 * float(np.median(np.abs(off))), 1e-15)
        robust = np.clip(1 - (off / (BIWEIGHT * scale)) ** 2, 0.0, None) ** 2
    kept = max(float((robust > 0.1).sum()) - 2, 1.0)
    sd = float(np.sqrt((w * off**2 / weights).sum() / kept / spread))
    return float(mean - slope * middle), slope, sd


def _common_stretch(a: Signal, b: Signal, lag: Lag) -> tuple[float, float]:
    """Beginning and end of the common stretch, on A's clock."""
    return max(float(a.t[0]), float(b.t[0]) + lag.seconds), min(
        float(a.t[-1]), float(b.t[-1]) + lag.seconds
    )


def _cut(signal: Signal, start: float, stop: float) -> Signal:
    first, last = np.searchsorted(signal.t, [start, np.nextafter(stop, np.inf)])
    return Signal(signal.t[first:last], signal.values[first:last])


def _bandwidth(part: Signal) -> float:
    """RMS of the rates against that of the values, 1/s."""
    total = variance(part.values).sum()
    rates = np.nan_to_num(np.diff(part.values, axis=0)) * rate_of(part)
    return float(np.sqrt((rates**2).mean(axis=0).sum() / total)) if total > 0 else 0.0
