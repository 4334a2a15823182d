"""The normal equations of a trajectory with a few parameters: banded in time, bordered by the parameters, solved by a Schur complement.

In      Terms of consecutive samples
Out     increments of orientations and parameters, covariance of the parameters; time and memory grow linearly with the recording
Source  Triggs et al. 2000, Bundle adjustment - a modern synthesis, 6.1 (bordered systems); Cholesky of a band of blocks: Golub & Van Loan, 4.3, 4.5
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.numerics.jit import looped
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration.residuals import Terms

SPAN = 3  # samples that one residual touches at most


@dataclass(frozen=True)
class Normal:
    """[[A, B], [B', C]] [x, p] = -[a, c]; A is symmetric, of e x e blocks: A[t, d] stands in row t + d and column t."""

    A: Array  # (n, SPAN, e, e)
    B: Array  # (n, e, P)
    C: Array  # (P, P)
    a: Array  # (n, e)
    c: Array  # (P,)


@dataclass(frozen=True)
class Step:
    """A Gauss-Newton step of orientations (rad) and parameters."""

    turns: Array  # (n, e)
    parameters: Array  # (P,)


@dataclass(frozen=True)
class Factor:
    """A = L L' with blocks as A's; Y = L^-1 B; the covariance of the parameters."""

    L: Array  # (n, SPAN, e, e)
    Y: Array  # (n, e, P)
    covariance: Array  # (P, P)


def keep_covariance_only(covariance: Array) -> Factor:
    """A factor with the covariance only: of a minute of one finger the rest is a hundred megabytes."""
    return Factor(np.empty((0, SPAN, 0, 0)), np.empty((0, 0, len(covariance))), covariance)


def empty(samples: int, each: int, parameters: int) -> Normal:
    """Nothing known yet of `samples` with `each` unknowns."""
    n, e, p = samples, each, parameters
    return Normal(
        np.zeros((n, SPAN, e, e)),
        np.zeros((n, e, p)),
        np.zeros((p, p)),
        np.zeros((n, e)),
        np.zeros(p),
    )


def add_terms(normal: Normal, terms: Terms) -> None:
    """Add residuals, in place."""
    if not len(terms.r):
        return
    _gather(
        terms.first,
        terms.knots,
        terms.r,
        terms.by_turns,
        terms.by_parameters,
        terms.cols,
        normal.A,
        normal.B,
        normal.a,
    )
    if len(terms.cols):
        flat = terms.by_parameters.reshape(-1, len(terms.cols))
        normal.C[np.ix_(terms.cols, terms.cols)] += flat.T @ flat
        normal.c[terms.cols] += flat.T @ terms.r.ravel()


def factorise(normal: Normal, damping: float = 0.0) -> Factor:
    """The diagonal grows by the factor 1 + damping. LinAlgError where the unknowns are not observable."""
    L, Y, schur = eliminate_trajectory(normal, damping)
    return Factor(L, Y, invert(schur))


def eliminate_trajectory(normal: Normal, damping: float = 0.0) -> tuple[Array, Array, Array]:
    """L and Y of `Factor`, and the Schur complement of the parameters (P, P). LinAlgError where the trajectory is not observable."""
    L, Y, C = normal.A.copy(), normal.B.copy(), normal.C.copy()
    diagonal = np.arange(L.shape[2])
    L[:, 0, diagonal, diagonal] *= 1 + damping
    C[np.diag_indices_from(C)] *= 1 + damping
    sound = np.ones(1)
    _factor(L, Y, sound)
    if not sound[0]:
        raise np.linalg.LinAlgError("the readings do not tell the trajectory")
    flat = Y.reshape(-1, Y.shape[2])
    return L, Y, C - flat.T @ flat


def invert(schur: Array) -> Array:
    """Of a symmetric matrix (P, P) that is positive definite, of parameters of very different size: m, rad/s, rad."""
    scale = 1 / np.sqrt(np.abs(np.diag(schur)) + 1e-300)
    root = np.linalg.inv(np.linalg.cholesky(0.5 * (schur + schur.T) * np.outer(scale, scale)))
    return np.asarray(root.T @ root * np.outer(scale, scale))


def solve_step(normal: Normal, factor: Factor) -> Step:
    """Where the minimum of the quadratic model lies from here."""
    y = normal.a.copy()
    _forward(factor.L, y)
    parameters = factor.covariance @ (
        factor.Y.reshape(-1, factor.Y.shape[2]).T @ y.ravel() - normal.c
    )
    x = -y - factor.Y @ parameters
    _backward(factor.L, x)
    return Step(x, parameters)


def draw_step(factor: Factor, from_trajectory: Array, from_parameters: Array) -> Step:
    """One draw from the distribution with the equations' covariance, of independent standard normal numbers (n, e) and (P,)."""
    parameters = np.linalg.cholesky(factor.covariance) @ from_parameters
    x = from_trajectory - factor.Y @ parameters
    _backward(factor.L, x)
    return Step(x, parameters)


def draw_trajectory(factor: Factor, numbers: Array) -> Array:
    """The trajectory's part (n, e) of a draw while the parameters stay, of independent standard normal numbers (n, e)."""
    x = numbers.copy()
    _backward(factor.L, x)
    return x


def project_on_parameters(factor: Factor, of_samples: Array) -> Array:
    """B' A^-1 v (P,), of v (n, e): how gradients by samples' unknowns pull the parameters, but for their sign."""
    y = of_samples.copy()
    _forward(factor.L, y)
    return np.asarray(factor.Y.reshape(-1, factor.Y.shape[2]).T @ y.ravel())


def whiten(factor: Factor, B: Array) -> Array:
    """L^-1 B (n, e, P)."""
    columns_whitened = np.empty_like(B)
    for column in range(B.shape[2]):
        y = np.ascontiguousarray(B[:, :, column])
        _forward(factor.L, y)
        columns_whitened[:, :, column] = y
    return columns_whitened


@looped
def _gather(
    first: int, knots: int, r: Array, J: Array, K: Array, cols: Array, A: Array, B: Array, a: Array
) -> None:
    e, p = A.shape[2], cols.shape[0]
    by_turns, by_parameters = np.empty(knots * e), np.empty(p)
    for t in range(J.shape[0]):
        for i in range(J.shape[2]):
            block, row, by_residual = i // e, i % e, 0.0
            by_turns[:], by_parameters[:] = 0.0, 0.0
            for m in range(J.shape[1]):
                v = J[t, m, i]
                if v == 0.0:
                    continue
                for j in range((block + 1) * e):
                    by_turns[j] += v * J[t, m, j]
                for j in range(p):
                    by_parameters[j] += v * K[t, m, j]
                by_residual += v * r[t, m]
            for other in range(block + 1):
                for j in range(e):
                    A[first + t + other, block - other, row, j] += by_turns[other * e + j]
            for j in range(p):
                B[first + t + block, row, cols[j]] += by_parameters[j]
            a[first + t + block, row] += by_residual


@looped
def _factor(L: Array, Y: Array, sound: Array) -> None:
    n, e, P = L.shape[0], L.shape[2], Y.shape[2]
    for t in range(n):
        for back in range(1, min(t, SPAN - 1) + 1):  # what the samples before know
            F = L[t - back, back]
            for i in range(e):
                for k in range(e):
                    v = F[i, k]
                    for p in range(P):
                        Y[t, i, p] -= v * Y[t - back, k, p]
            for ahead in range(SPAN - back):
                G = L[t - back, back + ahead]
                for i in range(e):
                    for j in range(e):
                        total = 0.0
                        for k in range(e):
                            total += G[i, k] * F[j, k]
                        L[t, ahead, i, j] -= total
        D = L[t, 0]
        for j in range(e):
            for k in range(j):
                for i in range(j, e):
                    D[i, j] -= D[i, k] * D[j, k]
            if not D[j, j] > 0.0:
                sound[0] = 0.0
                return
            root = np.sqrt(D[j, j])
            for i in range(j, e):
                D[i, j] /= root
            for i in range(j):
                D[i, j] = 0.0
        for ahead in range(1, min(SPAN, n - t)):
            G = L[t, ahead]
            for i in range(e):
                for j in range(e):
                    total = G[i, j]
                    for k in range(j):
                        total -= G[i, k] * D[j, k]
                    G[i, j] = total / D[j, j]
        for i in range(e):
            for k in range(i):
                v = D[i, k]
                for p in range(P):
                    Y[t, i, p] -= v * Y[t, k, p]
            for p in range(P):
                Y[t, i, p] /= D[i, i]


@looped
def _forward(L: Array, y: Array) -> None:
    n, e = y.shape
    for t in range(n):
        for back in range(1, min(t, SPAN - 1) + 1):
            for i in range(e):
                for k in range(e):
                    y[t, i] -= L[t - back, back, i, k] * y[t - back, k]
        for i in range(e):
            for k in range(i):
                y[t, i] -= L[t, 0, i, k] * y[t, k]
            y[t, i] /= L[t, 0, i, i]


@looped
def _backward(L: Array, x: Array) -> None:
    n, e = x.shape
    for t in range(n - 1, -1, -1):
        for ahead in range(1, min(SPAN, n - t)):
            for i in range(e):
                for k in range(e):
                    x[t, k] -= L[t, ahead, i, k] * x[t + ahead, i]
        for i in range(e - 1, -1, -1):
            for k in range(i + 1, e):
                x[t, i] -= L[t, 0, k, i] * x[t, k]
            x[t, i] /= L[t, 0, i, i]
