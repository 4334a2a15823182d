"""Missing samples between known ones, by cubics that take up the slopes on either side.

In      samples of one sensor with rows missing
Out     the rows filled in, and the variance of the angle that a filled stretch of angular rates may
        have missed
Source  Hermite interpolation; a movement of frequency f is missed by (2 pi f L)^4 / 720 of the
        angle turned in a gap of length L (remainder of the corrected trapezium rule; the straight
        line misses (2 pi f L)^2 / 12), which at 3 Hz and 0.1 s is 2 % instead of 30 %
"""

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.numerics.typing import Array, Bools

FREQUENCY = 3.0  # Hz, ours: fast finger movements


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


def missed_variance(t: Array, gyr: Array, known: Bools) -> Array:
    """Variance (n,) in rad^2, at the first row of each gap, of the angle that bridging it may have
    missed; zero elsewhere."""
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
    return found


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
