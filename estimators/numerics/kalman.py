"""Kalman measurement update of an error-state filter, for one row of a kernel.

In      covariance P (e, e) of the errors, changed in place; innovations (m,), Jacobian H (m, e), noise (m, m)
Out     estimated errors dx (e,); returned: normalised innovation squared, innovation' S^-1 innovation
Source  Kortier, thesis (2.14), (2.15), written with the Cholesky factor of the innovation's
        covariance: P stays symmetric to the last bit
"""

import math

import numpy as np

from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.small_matrices import clear
from handscope.estimators.numerics.typing import Array


@inlined
def correct(P: Array, innovation: Array, H: Array, noise: Array, dx: Array) -> float:
    """Update P and estimate dx; returns the normalised innovation squared."""
    W = np.empty(H.shape)
    total: float = innovation_gain(P, innovation, H, noise, W, dx)
    downdate_covariance(P, W)
    return total


@inlined
def innovation_gain(
    P: Array, innovation: Array, H: Array, noise: Array, W: Array, dx: Array
) -> float:
    """Estimate dx and fill W (m, e). With S = H P H' + noise = L L', W = L^-1 H P and y = L^-1 innovation: K innovation = W' y and K H P = W' W.

    Unused measurements have zero rows; only nonzero entries are visited.
    """
    m, e = H.shape
    clear(W)
    L, y = np.empty((m, m)), np.empty(m)
    used, columns, filled, n = (
        np.empty(m, np.intp),
        np.empty((m, e), np.intp),
        np.zeros(m, np.intp),
        0,
    )
    for row in range(m):
        for k in range(e):
            if H[row, k] != 0.0:
                columns[n, filled[n]] = k
                filled[n] += 1
                for c in range(e):
                    W[n, c] += H[row, k] * P[k, c]
        if filled[n] > 0:
            used[n] = row
            n += 1
            if n == m:
                break
    for k in range(e):
        dx[k] = 0.0
    for i in range(n):
        for j in range(i + 1):
            s = noise[used[i], used[j]]
            for k in columns[j, : filled[j]]:
                s += W[i, k] * H[used[j], k]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = math.sqrt(s) if i == j else s / L[j, j]
    total = 0.0
    for i in range(n):
        y[i] = innovation[used[i]]
        for j in range(i):
            if L[i, j] != 0.0:
                y[i] -= L[i, j] * y[j]
                for k in range(e):
                    W[i, k] -= L[i, j] * W[j, k]
        y[i] /= L[i, i]
        total += y[i] * y[i]
        for k in range(e):
            W[i, k] /= L[i, i]
            dx[k] += W[i, k] * y[i]
    return total


@inlined
def downdate_covariance(P: Array, W: Array) -> None:
    """P - W' W in place, by its lower half."""
    m, e = W.shape
    for i in range(m):
        for k in range(e):
            if W[i, k] != 0.0:
                for c in range(k + 1):
                    P[k, c] -= W[i, k] * W[i, c]
    for k in range(e):
        for c in range(k):
            P[c, k] = P[k, c]
