"""Missing samples between known ones, by cubics that take up the slopes on either side.

In      samples of one sensor with rows missing
Out     the rows filled in, and the variance of the angle that a filled stretch of angular rates may
        have missed
Source  Hermite interpolation; a movement of frequency f is missed by (2 pi f L)^4 / 720 of the
        angle turned in a gap of length L (remainder of the corrected trapezium rule; the straight
        line misses (2 pi f L)^2 / 12), which at 3 Hz and 0.1 s is 2 % instead of 30 %. What a gap of
        as many samples would have missed shortly before is the measure of brisker movement: a finger
        that strikes within 0.1 s is missed by 7 deg in four samples of 80 Hz although it is still at
        both edges (leave-out cross-validation: Stone 1974, J R Stat Soc B 36:111)
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.numerics.typing import Array, Bools

FREQUENCY = 3.0  # Hz, ours: fast finger movements
RECENT = 400  # samples before a gap by which it is judged, ours: a few seconds
FEWEST = 20  # stretches among these that are whole, for a judgement


def bridge_gaps(t: Array, values: Array, known: Bools) -> Array:
    """Values (n, axes) with the rows that are not `known` (n,) filled in wherever there are known
    ones on both sides; t (n,) in s."""
    row = np.arange(len(t))
    before = np.maximum.accumulate(np.where(known, row, -1))
    behind = np.minimum.accumulate(np.where(known, row, len(t))[::-1])[::-1]
    gap = np.flatnonzero(~known & (before >= 0) & (behind < len(t)))
    a, b = before[gap], behind[gap]
    length = (t[b] - t[a])[:, None]
    secant = (values[b] - values[a]) / length
    rise, fall = (
        _slopes(t, values, known, a, a - 1, secant),
        _slopes(t, values, known, b, b + 1, secant),
    )
    s = (t[gap] - t[a])[:, None] / length
    filled = values.copy()
    filled[gap] = (
        (1 + 2 * s) * (1 - s) * (1 - s) * values[a]
        + s * (1 - s) * (1 - s) * length * rise
        + s * s * (3 - 2 * s) * values[b]
        + s * s * (s - 1) * length * fall
    )
    return filled


def missed_variance(t: Array, gyr: Array, known: Bools, earlier: Array) -> Array:
    """Variance (n,) in rad^2, at the first row of each gap, of the angle that bridging it may have
    missed; zero elsewhere. Rates (h, 3) in rad/s of `earlier` rows, and those before a gap, tell
    what bridging misses; NaN where missing."""
    found = np.zeros(len(t))
    edges = np.flatnonzero(np.diff(np.concatenate([[True], known, [True]]).astype(int)))
    first, behind = edges[::2], edges[1::2]
    inside = (first > 0) & (behind < len(t))
    first, behind = first[inside], behind[inside]
    length = t[behind] - t[first - 1]
    rates = np.sqrt((gyr * gyr).sum(axis=-1))
    found[first] = (
        np.maximum(rates[first - 1], rates[behind])
        * length
        * np.minimum(1.0, (2 * np.pi * FREQUENCY * length) ** 4 / 720)
    ) ** 2
    every = np.concatenate([earlier, np.where(known[:, None], gyr, np.nan)])
    for k, count, span in zip(first, behind - first, length):
        shortly = every[max(0, len(earlier) + k - RECENT) : len(earlier) + k]
        found[k] = max(found[k], _missed_before(shortly, int(count)) * (span / (count + 1)) ** 2)
    return found


def _missed_before(rates: Array, count: int) -> float:
    """Mean square, in units of rates (n, 3), of what bridging would have missed of the sum of `count` successive ones; 0 where too few stretches are whole."""
    stretches = len(rates) - count - 3
    if stretches < FEWEST:
        return 0.0
    sums = np.cumsum(np.concatenate([np.zeros((1, 3)), np.nan_to_num(rates)]), axis=0)
    missing = np.concatenate([[0], np.cumsum(np.isnan(rates).any(axis=1))])
    whole = missing[count + 4 :] == missing[: -count - 4]
    if whole.sum() < FEWEST:
        return 0.0
    of_edges = sum(
        w * rates[at : at + stretches]
        for w, at in zip(_weights(count), (0, 1, count + 2, count + 3))
    )
    missed = of_edges - (sums[2 + count : 2 + count + stretches] - sums[2 : 2 + stretches])
    return float((missed[whole] ** 2).sum(axis=1).mean())


@cache
def _weights(count: int) -> tuple[float, ...]:
    """By which the two samples on either side of `count` evenly spaced missing ones make the sum of what is filled in."""
    t, known = np.arange(count + 4.0), np.ones(count + 4, bool)
    known[2:-2] = False
    edges = np.zeros((count + 4, 4))
    edges[[0, 1, -2, -1], range(4)] = 1.0
    return tuple(bridge_gaps(t, edges, known)[2:-2].sum(axis=0))


def _slopes(
    t: Array,
    values: Array,
    known: Bools,
    at: NDArray[np.int_],
    beside: NDArray[np.int_],
    secant: Array,
) -> Array:
    """Slopes at rows `at` towards their neighbours `beside`, which lie away from the gap; the gap's
    own secant where a neighbour is not known."""
    inside = (beside >= 0) & (beside < len(t))
    neighbour = np.where(inside, beside, at)
    usable = inside & known[neighbour]
    span = np.where(usable, t[at] - t[neighbour], 1.0)[:, None]
    return np.where(usable[:, None], (values[at] - values[neighbour]) / span, secant)
