"""The fit of one sensor's corrections to its chains of windows, compiled: a check of a recording makes hundreds of them.

In      normal equations of every chain and sensor, the residual last; covariances of the corrections before anything is measured
Out     most likely corrections with their covariance, and what they leave of every chain
Source  reweighted least squares of the multivariate t (Lange, Little & Taylor 1989, JASA 84:881), as gravity_fit.py explains it
Limits  covariances have to be positive definite
"""

import math

import numpy as np

from handscope.estimators.numerics.jit import inlined, looped
from handscope.estimators.numerics.small_matrices import (
    cholesky,
    clear,
    solve_lower,
    solve_upper,
)
from handscope.estimators.numerics.typing import Array

TURNED = 9  # corrections of the matrix, which come first


@inlined
def factor(A: Array, L: Array) -> float:
    """L of A = L L', NaN where A is not positive definite; logarithm of A's determinant."""
    if not cholesky(A, L):
        for i in range(len(L)):
            for j in range(len(L)):
                L[i, j] = np.nan
    total = 0.0
    for i in range(len(L)):
        total += 2.0 * math.log(L[i, i])
    return total


@inlined
def solve_factored(L: Array, B: Array) -> None:
    """L L' X = B of any columns, in B's place."""
    solve_lower(L, B)
    solve_upper(L, B)


@inlined
def invert_factored(L: Array, out: Array) -> None:
    """Inverse (P, P) of L L'."""
    clear(out)
    for i in range(len(L)):
        out[i, i] = 1.0
    solve_factored(L, out)


@inlined
def left_over(N: Array, x: Array) -> float:
    """Sum of squares that corrections leave of normal equations (P + 1, P + 1)."""
    P = len(x)
    total = N[P, P]
    for p in range(P):
        along = 0.0
        for q in range(p):
            along += N[p, q] * x[q]
        total += x[p] * (2.0 * (along + N[p, P]) + N[p, p] * x[p])
    return float(max(total, 0.0))


@looped
def fit_chains(
    N: Array, n: Array, floor: Array, prior: Array, freedom: float, rounds: int
) -> tuple[Array, Array, Array, Array, Array]:
    """Corrections (S, P), covariance (S, P, P), what is left of each chain (G, S), cost of the corrections' freedom (S,), share of each chain in what is known of the matrix (G, S)."""
    G, S, P = len(N), N.shape[1], N.shape[2] - 1
    x, cov, left = np.zeros((S, P)), np.zeros((S, P, P)), np.zeros((G, S))
    cost, share, weight = np.zeros(S), np.zeros((G, S)), np.zeros(G)
    precision, H, L = np.zeros((P, P)), np.zeros((P, P + 1)), np.zeros((P, P))
    narrowed = 0.0
    for s in range(S):
        width = factor(prior[s], L)
        invert_factored(L, precision)
        for _ in range(rounds):
            clear(H)
            for g in range(G):
                weight[g] = 0.0
                if n[g, s] > 0.0:
                    spread = left_over(N[g, s], x[s]) + floor[g, s]
                    weight[g] = (freedom + n[g, s]) / spread
                    for p in range(P):
                        for q in range(p + 1):
                            H[p, q] += weight[g] * N[g, s, p, q]
                        H[p, P] += weight[g] * N[g, s, p, P]
            for p in range(P):
                x[s, p] = -H[p, P]
                for q in range(p + 1):
                    H[p, q] += precision[p, q]
            narrowed = factor(H, L)
            solve_factored(L, x[s].reshape(P, 1))
        invert_factored(L, cov[s])
        square = 0.0
        for p in range(P):
            for q in range(P):
                square += x[s, p] * precision[p, q] * x[s, q]
        cost[s] = -0.5 * (square + narrowed + width)
        for g in range(G):
            left[g, s] = left_over(N[g, s], x[s]) + floor[g, s]
            for p in range(TURNED):
                for q in range(TURNED):
                    share[g, s] += weight[g] * N[g, s, p, q] * cov[s, q, p]
    return x, cov, left, cost, share
