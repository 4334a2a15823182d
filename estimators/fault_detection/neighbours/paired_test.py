"""Which of two descriptions of the sensors is nearer to what they read: a paired test over windows.

In      what either description leaves unexplained in each window
Out     probability of evidence as strong where the declared description is at least as near as the other
Source  Vuong 1989, Econometrica 57:307: mean log ratio of the residuals against its standard error, which holds where neither description is exact (skin,
        biases, joints that give); neighbouring windows err together: Newey & West 1987, Econometrica 55:703
Limits  fewer than `FEWEST` windows in which the descriptions differ tell nothing: p = 1
"""

import numpy as np

from handscope.estimators.numerics.tail_probabilities import student_sf
from handscope.estimators.numerics.typing import Array

FEWEST = 6
LAGS = 2  # windows
MOST = 15.0  # largest weight of a window
TRIMMED = 0.2  # of the values at either end


def log_rest(rest: Array, noise: Array) -> Array:
    """Logarithm of what is left over (any shape, mean squares), noise (mean squares) counted in."""
    return np.asarray(np.log(rest + noise))


def weight(declared: Array, other: Array, noise: Array) -> Array:
    """How much each window tells: what the worse description leaves, in noise, up to `MOST`; asked of both in the same manner, so that it favours neither."""
    return np.asarray(np.clip(np.maximum(declared, other) / noise - 1.0, 0.0, MOST))


def p_value(gain: Array, margin: float, weight: Array | None = None) -> float:
    """Probability of so large a mean gain (K,) of the other description if its expectation were at most `margin`; windows by weight."""
    w = np.ones(len(gain)) if weight is None else weight
    n = float(w.sum() ** 2 / (w @ w)) if w.any() else 0.0  # as many windows of one weight
    if n < FEWEST:
        return 1.0
    w = w / w.sum()
    mean = float(w @ gain)
    off = w * (gain - mean)
    alone = variance = float(off @ off)
    for lag in range(1, LAGS + 1):
        variance += 2 * (1 - lag / (LAGS + 1)) * float(off[lag:] @ off[:-lag])
    error = np.sqrt(max(variance, alone / 2, 1e-12) * n / (n - 1))
    return float(student_sf((mean - margin) / error, n - 1))


def trimmed_p_value(values: Array, margin: float, shared: float = 1.0) -> float:
    """Probability of so large a trimmed mean of values (n,) if their expectation were at most `margin`, where each is shared by so many of them.

    Source: Tukey & McLaughlin 1963, Sankhya A 25:331: what fifths at either end are does not count, so that a few values may be anything.
    """
    n = len(values)
    cut = int(TRIMMED * n)
    ordered = np.sort(values)
    winsorized = np.clip(ordered, ordered[cut], ordered[n - 1 - cut])
    kept = ordered[cut : n - cut]
    error = max(float(winsorized.std(ddof=1)) * np.sqrt(shared * n) / len(kept), 1e-12)
    return float(student_sf((float(kept.mean()) - margin) / error, len(kept) - 1))
