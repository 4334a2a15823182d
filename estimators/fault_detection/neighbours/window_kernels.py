"""Readings of sensors interpolated and cut into windows, compiled: what the checks do with every sample.

In      samples of sensors at any instants; the sensors' series on one time base
Out     splines through the samples; forces and arms in the frame that a sensor had where its window began
Source  cubic spline with the not-a-knot condition (de Boor 1978, ch. IV), its slopes by elimination of a tridiagonal system
Limits  five samples at least
"""

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import looped
from handscope.estimators.numerics.small_matrices import put, rigid_acceleration
from handscope.estimators.numerics.typing import Array


@looped
def spline_slopes(at: Array, values: Array) -> Array:
    """Derivatives (n, C) of the cubic splines through values (n, C) at increasing instants (n,)."""
    n, C = values.shape
    step = np.diff(at)
    above, right = np.zeros(n), np.zeros((n, C))  # upper diagonal and right side, eliminated
    first, last = at[2] - at[0], at[n - 1] - at[n - 3]
    above[0] = first / step[1]
    for c in range(C):
        a, b = (values[1, c] - values[0, c]) / step[0], (values[2, c] - values[1, c]) / step[1]
        right[0, c] = ((step[0] + 2 * first) * step[1] * a + step[0] ** 2 * b) / (first * step[1])
    for k in range(1, n - 1):
        pivot = 2 * (step[k - 1] + step[k]) - step[k] * above[k - 1]
        above[k] = step[k - 1] / pivot
        for c in range(C):
            a = step[k] * (values[k, c] - values[k - 1, c]) / step[k - 1]
            b = step[k - 1] * (values[k + 1, c] - values[k, c]) / step[k]
            right[k, c] = (3 * (a + b) - step[k] * right[k - 1, c]) / pivot
    g, h = step[n - 3], step[n - 2]
    pivot = g - last * above[n - 2]
    for c in range(C):
        a, b = (
            (values[n - 2, c] - values[n - 3, c]) / g,
            (values[n - 1, c] - values[n - 2, c]) / h,
        )
        end = (h**2 * a + (2 * last + h) * g * b) / last
        right[n - 1, c] = (end - last * right[n - 2, c]) / pivot
    for k in range(n - 2, -1, -1):
        for c in range(C):
            right[k, c] -= above[k] * right[k + 1, c]
    return right


@looped
def evaluate_spline(
    at: Array, values: Array, slopes: Array, t: Array, after: NDArray[np.intp]
) -> tuple[Array, Array]:
    """Values and derivatives (m, C) at instants (m,), each between the samples `after` - 1 and `after`."""
    m, C = len(t), values.shape[1]
    out, change = np.empty((m, C)), np.empty((m, C))
    for k in range(m):
        j = after[k]
        step = at[j] - at[j - 1]
        x = (t[k] - at[j - 1]) / step
        for c in range(C):
            rise = values[j, c] - values[j - 1, c]
            p, q = step * slopes[j - 1, c], step * slopes[j, c]
            square, cube = 3 * rise - 2 * p - q, p + q - 2 * rise
            out[k, c] = values[j - 1, c] + x * (p + x * (square + x * cube))
            change[k, c] = (p + x * (2 * square + 3 * x * cube)) / step
    return out, change


@looped
def fill_windows(
    gyr: Array,
    change: Array,
    acc: Array,
    whole: NDArray[np.bool_],
    first: NDArray[np.intp],
    columns: NDArray[np.intp],
    dt: float,
    averaged: int,
    force: Array,
    arm: Array,
    turned: Array,
    rate: Array,
    share: Array,
) -> None:
    """Fill what joint_windows.Windows has of sensors (S, K, m, ...) whose windows begin at rows (K,); readings beyond the ends are those of the ends."""
    S, K, m = share.shape
    R, A, turn = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    q, step, both = np.empty(4), np.empty(4), np.empty(4)
    by = 1.0 / averaged
    for s in range(S):
        c = columns[s]
        for k in range(K):
            q[0], q[1], q[2], q[3] = 1.0, 0.0, 0.0, 0.0
            before = 0
            for n in range(m * averaged):
                row, at = first[k] + n, n // averaged
                here = min(max(row, 0), len(gyr) - 1)
                if n > 0:
                    for i in range(3):
                        turn[i] = 0.5 * dt * (gyr[here, c, i] + gyr[before, c, i])
                    quat.exp_row(turn, step, step)
                    quat.multiply_row(q, step, both)
                    for i in range(4):
                        q[i] = both[i]
                before = here
                quat.matrix_row(q, turn, R)
                rigid_acceleration(gyr[here, c], change[here, c], A)
                if n % averaged == averaged // 2:
                    put(R, turned[s, k, at])
                if whole[here, c] and here == row:
                    share[s, k, at] += by
                for i in range(3):
                    rate[s, k, at, i] += by * gyr[here, c, i]
                    for j in range(3):
                        force[s, k, at, i] += by * R[i, j] * acc[here, c, j]
                        arm[s, k, at, i, j] += by * (
                            R[i, 0] * A[0, j] + R[i, 1] * A[1, j] + R[i, 2] * A[2, j]
                        )
