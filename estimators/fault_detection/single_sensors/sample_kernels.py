"""What the checks of single sensors do with every sample, compiled: integrals between edges, and how far each row steps.

In      samples of one stream in order
Out     integrals at the edges of cells; steps of every row against the steps around it
Limits  NaN is what is missing, and passes through
"""

import math

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.numerics.jit import inlined, looped
from handscope.estimators.numerics.small_matrices import (
    cholesky,
    clear,
    solve_lower,
    solve_upper,
)
from handscope.estimators.numerics.typing import Array

AROUND = (-12, -8, -5, 5, 8, 12)  # rows from a step with which it is compared
ROWS = 6  # that a step is seen in
QUIET = (0.003, 0.02)  # rad/s, m/s^2 of a step that noise alone makes
NEXT, BESIDE = (
    6,
    30,
)  # rows beside a step that are left out of its variance, and up to which they count
WIDEST = 0.5  # rad, standard deviation of a turn before anything is measured


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


@looped
def explained_steps(t: Array, values: Array) -> tuple[Array, Array, Array]:
    """How far a sensor's rates and forces (n, 6), read at t (n,), step between rows 2 and 3 behind each (n - 5,), in variances: what one rotation explains, the rest, and the rotation (n - 5, 3) rad.

    The variances are those of the steps beside; the rotation takes vectors behind the step to those before it.
    """
    n = len(values) - ROWS + 1
    step, square = np.zeros((n, 6)), np.zeros((n, 2))
    explained, rest, turn = np.zeros(n), np.zeros(n), np.zeros((n, 3))
    N, L, right = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 1))
    total_square, variance = np.zeros((n + 1, 2)), np.zeros(2)
    for k in range(n):
        for c in range(6):
            y = values[k : k + ROWS, c]
            slope = (y[2] - y[0]) / (t[k + 2] - t[k]) + (y[5] - y[3]) / (t[k + 5] - t[k + 3])
            course = 0.5 * slope * (t[k + 4] - t[k + 1])
            step[k, c] = middle(y[3], y[4], y[5]) - middle(y[0], y[1], y[2]) - course
            square[k, c // 3] += step[k, c] ** 2
    for q in range(2):
        for k in range(n):
            total_square[k + 1, q] = total_square[k, q] + square[k, q]
    for k in range(n):
        for q in range(2):
            variance[q] = QUIET[q] ** 2
            before, behind = max(k - NEXT, 0), min(k + NEXT + 1, n)
            first, last = max(k - BESIDE, 0), min(k + BESIDE + 1, n)
            total = total_square[before, q] - total_square[first, q]
            total += total_square[last, q] - total_square[behind, q]
            variance[q] += total / (3 * max(before - first + last - behind, 1))
        clear(N)
        total = 0.0
        for i in range(3):
            N[i, i] = WIDEST**-2
            right[i, 0] = 0.0
        for q in range(2):
            x = 0.5 * (values[k + 2, 3 * q] + values[k + 3, 3 * q])
            y1 = 0.5 * (values[k + 2, 3 * q + 1] + values[k + 3, 3 * q + 1])
            z = 0.5 * (values[k + 2, 3 * q + 2] + values[k + 3, 3 * q + 2])
            s0, s1, s2 = step[k, 3 * q], step[k, 3 * q + 1], step[k, 3 * q + 2]
            w = 1.0 / variance[q]
            N[0, 0] += w * (y1 * y1 + z * z)
            N[1, 1] += w * (x * x + z * z)
            N[2, 2] += w * (x * x + y1 * y1)
            N[1, 0] -= w * x * y1
            N[2, 0] -= w * x * z
            N[2, 1] -= w * y1 * z
            right[0, 0] += w * (s1 * z - s2 * y1)  # vectors before are those behind and turn x v
            right[1, 0] += w * (s2 * x - s0 * z)
            right[2, 0] += w * (s0 * y1 - s1 * x)
            total += w * (s0 * s0 + s1 * s1 + s2 * s2)
        N[0, 1], N[0, 2], N[1, 2] = N[1, 0], N[2, 0], N[2, 1]
        r0, r1, r2 = right[0, 0], right[1, 0], right[2, 0]
        if cholesky(N, L):
            solve_lower(L, right)
            solve_upper(L, right)
            turn[k, 0], turn[k, 1], turn[k, 2] = right[0, 0], right[1, 0], right[2, 0]
            explained[k] = r0 * turn[k, 0] + r1 * turn[k, 1] + r2 * turn[k, 2]
            rest[k] = max(total - explained[k], 0.0)
    return explained, rest, turn
