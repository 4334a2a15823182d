"""Which of two descriptions of the sensors is nearer to what they read: a paired test over windows.

In      what either description leaves unexplained in each window
Out     probability of evidence as strong where the declared description is at least as near as the other
Source  Vuong 1989, Econometrica 57:307: mean log ratio of the residuals against its standard error, which holds where neither description is exact (skin,
        biases, joints that give); neighbouring windows err together: Newey & West 1987, Econometrica 55:703
Limits  fewer than `FEWEST` windows in which the descriptions differ tell nothing: p = 1
"""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from handscope.estimators.numerics.quaternions import Array

FEWEST = 6
LAGS = 2  # windows


def log_rest(rest: Array, noise: Array) -> Array:
    """Logarithm of what is left over (any shape, mean squares), noise (mean squares) counted in."""
    return np.asarray(np.log(rest + noise))


def is_telling(declared: Array, other: Array, noise: Array) -> NDArray[np.bool_]:
    """In which windows at least one description leaves more than noise explains; asked of both in the same manner, so that it favours neither."""
    return np.asarray(np.maximum(declared, other) > noise)


def p_value(gain: Array, margin: float) -> float:
    """Probability of so large a mean gain (K,) of the other description if its expectation were at most `margin`."""
    n = len(gain)
    if n < FEWEST:
        return 1.0
    off = gain - gain.mean()
    variance = float(off @ off) / n
    for lag in range(1, LAGS + 1):
        variance += 2 * (1 - lag / (LAGS + 1)) * float(off[lag:] @ off[:-lag]) / n
    error = np.sqrt(max(variance, float(off @ off) / n / 2, 1e-12) / (n - 1))
    return float(student.sf((gain.mean() - margin) / error, n - 1))
