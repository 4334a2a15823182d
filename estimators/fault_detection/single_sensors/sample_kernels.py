"""What the checks of single sensors do with every sample, compiled: integrals between edges, and how far each row steps.

In      samples of one stream in order
Out     integrals at the edges of cells; steps of every row against the steps around it
Limits  NaN is what is missing, and passes through
"""

import math

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.numerics.jit import inlined, looped
from handscope.estimators.numerics.typing import Array

AROUND = (-12, -8, -5, 5, 8, 12)  # rows from a step with which it is compared
ROWS = 6  # that a step is seen in


@looped
def integrals_at(t: Array, values: Array, edges: Array, before: NDArray[np.intp]) -> Array:
    """Integrals (E, C) up to increasing edges of values (n, C) joined by straight lines; `before` has the sample before each edge."""
    n, C = values.shape
    out, area, e = np.zeros((len(edges), C)), np.zeros(C), 0
    for k in range(n - 1):
        step = t[k + 1] - t[k]
        while e < len(edges) and before[e] == k:
            share = (edges[e] - t[k]) / step
            for c in range(C):
                out[e, c] = area[c] + share * (0.5 * (values[k + 1, c] + values[k, c]) * step)
            e += 1
        for c in range(C):
            area[c] += 0.5 * (values[k + 1, c] + values[k, c]) * step
    return out


@inlined
def middle(a: float, b: float, c: float) -> float:
    """The middle one of three; NaN where one is missing."""
    return max(min(a, b), min(max(a, b), c)) + 0.0 * (a + b + c)


@looped
def squared_steps(y: Array) -> Array:
    """Squares (n - 5, S) of how far sensors (n, S, 3) step between rows 2 and 3 behind each, what they slope by taken off."""
    n, S = y.shape[:2]
    out = np.zeros((n - ROWS + 1, S))
    for k in range(n - ROWS + 1):
        for s in range(S):
            for c in range(3):
                before = middle(y[k, s, c], y[k + 1, s, c], y[k + 2, s, c])
                behind = middle(y[k + 3, s, c], y[k + 4, s, c], y[k + 5, s, c])
                slope = (y[k + 2, s, c] - y[k, s, c] + y[k + 5, s, c] - y[k + 3, s, c]) / 4
                out[k, s] += (behind - before - 3 * slope) ** 2
    return out


@looped
def add_log_ratio(step: Array, total: Array) -> None:
    """Add to totals (n, S) the logarithm of each step over the mean of the middle two of those AROUND it, mirrored at the ends; what is missing there counts as large."""
    n, S = step.shape
    around = np.zeros(len(AROUND))
    for k in range(n):
        for s in range(S):
            for i in range(len(AROUND)):
                row = abs(k + AROUND[i])
                value = step[row if row < n else 2 * (n - 1) - row, s]
                value = value if np.isfinite(value) else np.inf
                j = i
                while j > 0 and around[j - 1] > value:
                    around[j] = around[j - 1]
                    j -= 1
                around[j] = value
            usual = 0.5 * (around[2] + around[3]) + 1e-12
            total[k, s] += math.log(step[k, s] / usual)  # -inf of a step of zero, NaN of none
