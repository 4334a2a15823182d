"""The normal equations of a trajectory with a few parameters: banded in time, bordered by the parameters, solved by a Schur complement.

In      Terms of consecutive samples
Out     increments of orientations and parameters, covariance of the parameters; time and memory grow linearly with the recording
Source  Triggs et al. 2000, Bundle adjustment - a modern synthesis, 6.1 (bordered systems); Cholesky of a band of blocks: Golub & Van Loan, 4.3, 4.5
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.numerics.jit import inlined, looped
from handscope.estimators.numerics.typing import Array, Indices
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


def empty(samples: int, each: int, parameters: int, spare: Factor | None = None) -> Normal:
    """Nothing known yet of `samples` with `each` unknowns; in the memory of a factor of the same size that is not needed any more."""
    n, e, p = samples, each, parameters
    if spare is not None and spare.Y.shape == (n, e, p):
        A, B = spare.L, spare.Y
        A[...], B[...] = 0.0, 0.0
    else:
        A, B = np.zeros((n, SPAN, e, e)), np.zeros((n, e, p))
    return Normal(A, B, np.zeros((p, p)), np.zeros((n, e)), np.zeros(p))


def add_terms(normal: Normal, terms: Terms, own: slice = slice(None)) -> None:
    """Add residuals, in place; to C and c only those of their `own` samples."""
    if not len(terms.r):
        return
    _gather(
        terms.first,
        terms.knots,
        terms.r,
        terms.by_turns,
        terms.by_parameters,
        _find_column_runs(terms.cols),
        normal.A,
        normal.B,
        normal.a,
    )
    if len(terms.cols):
        flat = terms.by_parameters[own].reshape(-1, len(terms.cols))
        normal.C[np.ix_(terms.cols, terms.cols)] += flat.T @ flat
        normal.c[terms.cols] += flat.T @ terms.r[own].ravel()


def add_everything(normal: Normal, terms: Iterable[Terms], priors: tuple[Array, Array]) -> float:
    """Add residuals, and those of the first parameters alone with their derivatives (m,), (m, own), in place; half the sum of their squares."""
    (r, K), own = priors, priors[1].shape[1]
    total = 0.5 * float((r**2).sum())
    for one in terms:
        add_terms(normal, one)
        total += 0.5 * float((one.r**2).sum())
    normal.C[:own, :own] += K.T @ K
    normal.c[:own] += K.T @ r
    return total


def with_gradient(
    normal: Normal, terms: Iterable[Terms], priors: tuple[Array, Array]
) -> tuple[Normal, float]:
    """The same equations with the gradient of residuals as of `add_everything`; half the sum of their squares."""
    (r, K), a, c = priors, np.zeros_like(normal.a), np.zeros_like(normal.c)
    total = 0.5 * float((r**2).sum())
    c[: K.shape[1]] = K.T @ r
    for one in terms:
        T, e = len(one.r), a.shape[1]
        by = np.matmul(one.r[:, None], one.by_turns).reshape(T, one.knots, e)
        for knot in range(one.knots):
            a[one.first + knot : one.first + knot + T] += by[:, knot]
        if len(one.cols):
            c[one.cols] += one.by_parameters.reshape(-1, len(one.cols)).T @ one.r.ravel()
        total += 0.5 * float((one.r**2).sum())
    return replace(normal, a=a, c=c), total


def _find_column_runs(cols: Indices) -> Indices:
    """Runs (m, 3) of consecutive columns: their first and last place among `cols`, and the first of them."""
    starts = np.flatnonzero(np.diff(cols, prepend=-2) != 1)
    return np.stack([starts, np.append(starts, len(cols))[1:], cols[starts]], axis=1)


def factorise(normal: Normal, damping: float = 0.0) -> Factor:
    """The diagonal grows by the factor 1 + damping. LinAlgError where the unknowns are not observable."""
    L, Y, schur = eliminate_trajectory(normal, damping)
    return Factor(L, Y, invert(schur))


def factorise_in_place(normal: Normal, damping: float = 0.0) -> Factor:
    """The same in the memory of A and B, which are lost."""
    return Factor(normal.A, normal.B, invert(_eliminate(normal, damping)))


def eliminate_trajectory(normal: Normal, damping: float = 0.0) -> tuple[Array, Array, Array]:
    """L and Y of `Factor`, and the Schur complement of the parameters (P, P). LinAlgError where the trajectory is not observable."""
    own = replace(normal, A=normal.A.copy(), B=normal.B.copy())
    return own.A, own.B, _eliminate(own, damping)


def _eliminate(normal: Normal, damping: float) -> Array:
    L, Y, C = normal.A, normal.B, normal.C.copy()
    diagonal = np.arange(L.shape[2])
    L[:, 0, diagonal, diagonal] *= 1 + damping
    C[np.diag_indices_from(C)] *= 1 + damping
    sound = np.ones(1)
    _factor(L, Y, sound)
    if not sound[0]:
        raise np.linalg.LinAlgError("the readings do not tell the trajectory")
    flat = Y.reshape(-1, Y.shape[2])
    return np.asarray(C - flat.T @ flat)


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


def project_groups(factor: Factor, of_samples: Array, each: int) -> Array:
    """B' A^-1 v (groups, P), of every group's v (n, e): how gradients by samples' unknowns pull the parameters, but for their sign.

    A group has `each` samples, v is 0 but there and less than half a group beside it, and stands in `of_samples` (2, n, e), even groups in the first. Time grows linearly with the recording.
    """
    pulls = np.zeros((-(-len(factor.Y) // each), factor.Y.shape[2]))
    _project_groups(factor.L, factor.Y, of_samples, each, pulls)
    return pulls


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
    first: int,
    knots: int,
    r: Array,
    J: Array,
    K: Array,
    runs: Indices,
    A: Array,
    B: Array,
    a: Array,
) -> None:
    """Three residuals at a time: of a joint, a hinge or a sensor, most of whose derivatives are zero."""
    e, rows = A.shape[2], J.shape[1]
    by_turns, by_parameters = np.empty(knots * e), np.empty(K.shape[2])
    for t in range(J.shape[0]):
        for i in range(J.shape[2]):
            block, row, by_residual = i // e, i % e, 0.0
            for j in range((block + 1) * e):
                by_turns[j] = 0.0
            for j in range(K.shape[2]):
                by_parameters[j] = 0.0
            for m in range(0, rows - 2, 3):
                u, v, w = J[t, m, i], J[t, m + 1, i], J[t, m + 2, i]
                if u == 0.0 and v == 0.0 and w == 0.0:
                    continue
                for j in range((block + 1) * e):
                    by_turns[j] += u * J[t, m, j] + v * J[t, m + 1, j] + w * J[t, m + 2, j]
                for j in range(K.shape[2]):
                    by_parameters[j] += u * K[t, m, j] + v * K[t, m + 1, j] + w * K[t, m + 2, j]
                by_residual += u * r[t, m] + v * r[t, m + 1] + w * r[t, m + 2]
            for m in range(rows - rows % 3, rows):
                u = J[t, m, i]
                for j in range((block + 1) * e):
                    by_turns[j] += u * J[t, m, j]
                for j in range(K.shape[2]):
                    by_parameters[j] += u * K[t, m, j]
                by_residual += u * r[t, m]
            for other in range(block + 1):
                there = A[first + t + other, block - other, row]
                own = by_turns[other * e : (other + 1) * e]
                for j in range(e):
                    there[j] += own[j]
            for k in range(runs.shape[0]):
                own = by_parameters[runs[k, 0] : runs[k, 1]]
                there = B[first + t + block, row, runs[k, 2] : runs[k, 2] + own.shape[0]]
                for j in range(own.shape[0]):
                    there[j] += own[j]
            a[first + t + block, row] += by_residual


@looped
def _factor(L: Array, Y: Array, sound: Array) -> None:
    n, e, P = L.shape[0], L.shape[2], Y.shape[2]
    for t in range(n):
        for back in range(1, min(t, SPAN - 1) + 1):  # what the samples before know
            _subtract_product(L[t - back, back], Y[t - back], Y[t])
            for ahead in range(SPAN - back):
                G, F = L[t - back, back + ahead], L[t - back, back]
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
            _subtract_rows(D[i], i, Y[t], Y[t, i])
            for p in range(P):
                Y[t, i, p] /= D[i, i]


@inlined
def _subtract_product(F: Array, Z: Array, Y: Array) -> None:
    """Takes F Z off Y, in place."""
    for i in range(F.shape[0]):
        _subtract_rows(F[i], F.shape[1], Z, Y[i])


@inlined
def _subtract_rows(f: Array, count: int, Z: Array, y: Array) -> None:
    """Takes f Z off y, of the first rows of Z, in place; four rows at a time are read for one that is written."""
    P = y.shape[0]
    for k in range(0, count - 3, 4):
        u, v, w, x = f[k], f[k + 1], f[k + 2], f[k + 3]
        for p in range(P):
            y[p] -= u * Z[k, p] + v * Z[k + 1, p] + w * Z[k + 2, p] + x * Z[k + 3, p]
    for k in range(count - count % 4, count):
        u = f[k]
        for p in range(P):
            y[p] -= u * Z[k, p]


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
def _project_groups(L: Array, Y: Array, of_samples: Array, each: int, pulls: Array) -> None:
    n, e, P = Y.shape
    solved = np.empty((SPAN, e, P))  # A^-1 B of the samples ahead
    for t in range(n - 1, -1, -1):
        x = solved[t % SPAN]
        x[:] = Y[t]
        for ahead in range(1, min(SPAN, n - t)):
            _subtract_product(L[t, ahead].T.copy(), solved[(t + ahead) % SPAN], x)
        for i in range(e - 1, -1, -1):
            for k in range(i + 1, e):
                for p in range(P):
                    x[i, p] -= L[t, 0, k, i] * x[k, p]
            for p in range(P):
                x[i, p] /= L[t, 0, i, i]
        own = t // each
        beside = own - 1 if 2 * (t - own * each) < each else own + 1
        for group in (own, beside):
            if 0 <= group < pulls.shape[0]:
                for i in range(e):
                    v = of_samples[group % 2, t, i]
                    for p in range(P):
                        pulls[group, p] += v * x[i, p]


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
