"""Readings that are means over an interval, as what was read in its middle.

In      means of consecutive intervals
Out     values in their middles
Source  Taylor to T^2: a mean of m samples over T is off by T^2 / 24 (1 - 1 / m^2) second derivatives
Limits  the first and the last stay as they are; the second derivative is that of three means in a row, whatever is missing between them
"""

import numpy as np

from handscope.estimators.numerics.typing import Array


def correct_means(means: Array, each: float) -> Array:
    """Means (n, ...) of so many samples, infinitely many for an integral, as what was read in the middle of each."""
    v = means.copy()
    v[1:-1] -= (1 - 1 / each**2) / 24 * np.diff(means, 2, axis=0)
    return v
