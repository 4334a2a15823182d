"""The normal equations of a whole hand: those of its limbs, put together two samples at a time while they are factored.

In      a HandProblem, a HandPlace
Out     increments, covariance of the parameters, draws; time and memory grow linearly with the recording, one factor of the border never exists as a whole
Source  Cholesky of a block-tridiagonal matrix: Golub & Van Loan, 4.5; Schur complement: Triggs et al. 2000, 6.1
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.linalg import blas, lapack

from handscope.estimators.numerics import parallel
from handscope.estimators.numerics.jit import looped
from handscope.estimators.numerics.parallel import Each
from handscope.estimators.numerics.typing import Array, Indices
from handscope.estimators.self_calibration import normal_equations
from handscope.estimators.self_calibration.normal_equations import Normal, Step
from handscope.estimators.self_calibration.whole_hand import problem as whole_hand_problem
from handscope.estimators.self_calibration.whole_hand import residuals as hand_residuals
from handscope.estimators.self_calibration.whole_hand.problem import (
    OWN,
    HandPlace,
    HandProblem,
    Layout,
)

PAIR = 2  # samples that are factored at once: what spans three samples reaches the next pair, no further
TOGETHER = 16  # pairs whose share of the border is whitened and summed at once


@dataclass(frozen=True)
class HandNormal:
    """Normal equations of all limbs with their common unknowns."""

    layout: Layout
    limbs: tuple[Normal, ...]  # their C and c are taken up in the whole's
    error: Array  # (n, 3) residuals of the hand's accelerometer's error
    error_sd: Array  # (n,)
    C: Array  # (P, P)
    c: Array  # (P,)
    cost: float


@dataclass(frozen=True)
class HandFactor:
    """Of the band A = L L' in blocks of pairs of samples; the covariance of the parameters."""

    layout: Layout
    L: Array  # (K, 2 each, 2 each)
    below: Array  # (K, 2 each, 2 each) in the rows of pair k + 1 and the columns of pair k
    covariance: Array  # (P, P)


def build_normal_equations(problem: HandProblem, at: HandPlace) -> HandNormal:
    """The normal equations at a place, and its cost."""
    where, sd = whole_hand_problem.layout(problem), whole_hand_problem.error_sd(problem)
    C, c = np.zeros((where.count, where.count)), np.zeros(where.count)
    off, skin_sd = hand_residuals.hand_tissue_priors(problem, at)
    C[where.skin, where.skin], c[where.skin] = np.diag(1 / skin_sd**2), off / skin_sd
    total = 0.5 * float(((at.error / sd[:, None]) ** 2).sum() + (off**2).sum())
    with parallel.threads() as each:
        limbs = each(lambda k: _limb_equations(problem, at, k), range(len(problem.limbs)))
    for (normal, of_limb), cols in zip(limbs, where.parameters):
        C[np.ix_(cols, cols)] += normal.C
        c[cols] += normal.c
        total += of_limb
    return HandNormal(
        where, tuple(normal for normal, _ in limbs), at.error / sd[:, None] ** 2, sd, C, c, total
    )


def _limb_equations(problem: HandProblem, at: HandPlace, k: int) -> tuple[Normal, float]:
    """The normal equations of limb k, and its share of the cost."""
    limb, cols = problem.limbs[k], whole_hand_problem.layout(problem).parameters[k]
    normal = normal_equations.empty(len(limb), 3 * len(limb.chain.sensors) + OWN, len(cols))
    priors = hand_residuals.limb_priors(limb, at.limbs[k], shares=k == 0)
    return normal, normal_equations.add_everything(
        normal, hand_residuals.terms_of(problem, at, k), priors
    )


def without_band(normal: HandNormal) -> HandNormal:
    """What steps, pulls and draws need beside the factor."""
    none = np.empty((0, normal_equations.SPAN, 0, 0))
    return replace(normal, limbs=tuple(replace(limb, A=none) for limb in normal.limbs))


def with_gradient(normal: HandNormal, problem: HandProblem, at: HandPlace) -> HandNormal:
    """The same equations with the gradient, and the cost, of another place."""
    (off, skin_sd), sd = hand_residuals.hand_tissue_priors(problem, at), normal.error_sd
    c, limbs = np.zeros(normal.layout.count), []
    c[normal.layout.skin] = off / skin_sd
    total = 0.5 * float(((at.error / sd[:, None]) ** 2).sum() + (off**2).sum())
    for k, (limb, cols) in enumerate(zip(normal.limbs, normal.layout.parameters)):
        priors = hand_residuals.limb_priors(problem.limbs[k], at.limbs[k], shares=k == 0)
        there, own = normal_equations.with_gradient(
            limb, hand_residuals.terms_of(problem, at, k), priors
        )
        limbs.append(there)
        c[cols] += there.c
        total += own
    error = at.error / sd[:, None] ** 2
    return replace(normal, limbs=tuple(limbs), error=error, c=c, cost=total)


def factorise(normal: HandNormal, damping: float = 0.0) -> HandFactor:
    """The diagonal grows by the factor 1 + damping. LinAlgError where the equations do not tell the unknowns."""
    where, E = normal.layout, PAIR * normal.layout.each
    P, K = where.count, -(-len(normal.error) // PAIR)
    L, below = np.zeros((K, E, E)), np.zeros((K, E, E))
    known, last = np.zeros((P, P)), np.zeros((E, P))
    first, second = halves = _halves(P)
    products = [((first, first), (second, second)), ((first, second),)]
    with parallel.threads() as each:
        for k in range(0, K, TOGETHER):
            D, border = _fill_blocks(normal, k, below[k : k + TOGETHER], damping, each)
            _root_band(D, L, below, k)
            before = below[
                np.arange(k, k + len(D)) - 1
            ]  # before the first is nothing: there `last` is zero
            each(partial(_whiten, border, last, before, L[k : k + len(D)]), halves)
            each(partial(_multiply, border.reshape(-1, P), known), products)
            last = border[-1].copy()  # the border itself is free
    known = np.triu(known) + np.triu(known, 1).T
    C = normal.C.copy()
    C[np.diag_indices_from(C)] *= 1 + damping
    return HandFactor(where, L, below, normal_equations.invert(C - known))


def _root_band(D: Array, L: Array, below: Array, first: int) -> None:
    """Fills L and what is below it for the pairs from `first` on."""
    for j, k in enumerate(range(first, first + len(D))):
        if k:
            D[j] -= below[k - 1] @ below[k - 1].T
        L[k] = _root(D[j])
        below[k] = blas.dtrsm(1.0, L[k].T, below[k].T, lower=0, trans_a=1).T


def _root(D: Array) -> Array:
    upper, failed = lapack.dpotrf(D.T, lower=0, clean=1)
    if failed:
        raise np.linalg.LinAlgError("the readings do not tell the trajectory")
    return np.asarray(upper.T)


def _whiten(border: Array, last: Array, before: Array, L: Array, cols: slice) -> None:
    """Columns of B (m, E, P) become those of L^-1 B, in place; `last` (E, P) are those of the pair before them."""
    known, half = np.ascontiguousarray(last[:, cols]), border.shape[1] // PAIR
    for own, below, root in zip(border[:, :, cols], before, L):
        rest = own.copy()
        rest[:half] -= below[:half] @ known
        rest[half:] -= below[half:, half:] @ known[half:]  # a pair's last sample sees one of them
        known = blas.dtrsm(1.0, root.T, rest.T, side=1, lower=0, overwrite_b=1).T
        own[...] = known


def _multiply(border: Array, known: Array, where: Sequence[tuple[slice, slice]]) -> None:
    """Adds blocks of border' border, in place."""
    for rows, cols in where:
        known[rows, cols] += border[:, rows].T @ border[:, cols]


def _fill_blocks(
    normal: HandNormal, k: int, below: Array, damping: float, each: Each
) -> tuple[Array, Array]:
    """Blocks of the pairs from k on (m, E, E), lower triangles, and of the border (m, E, P); fills what is below them."""
    m, e, P = len(below), normal.layout.each, normal.layout.count
    D, B = np.zeros((m, PAIR, e, PAIR, e)), np.zeros((m, PAIR, e, P))
    each(partial(_fill_half, normal, k, D, B, below.reshape(m, PAIR, e, PAIR, e)), range(PAIR))
    whole, diagonal = D.reshape(m, PAIR * e, PAIR * e), np.arange(PAIR * e)
    whole[:, diagonal, diagonal] *= 1 + damping
    return whole, B.reshape(m, PAIR * e, P)


def _fill_half(normal: HandNormal, k: int, D: Array, B: Array, under: Array, half: int) -> None:
    """The first or the second samples of the pairs from k on, in place."""
    where, n, (m, _, e, _, _) = normal.layout, len(normal.error), D.shape
    first, stop = PAIR * k + half, min(PAIR * (k + m), n)
    t, pairs = np.arange(first, stop, PAIR), np.arange(len(range(first, stop, PAIR)))
    error = np.arange(e)[where.error]
    for limb, rows in zip(normal.limbs, where.sample):
        _scatter(limb.A, rows, first, stop, D, under)
    _fill_border_half(normal, k, B, half)
    D[:, half, :, half][pairs[:, None], error, error] += 1 / normal.error_sd[t, None] ** 2
    D[len(t) :, half, np.arange(e), half, np.arange(e)] = (
        1.0  # no sample: the last pair of an odd number
    )


def _fill_border_half(normal: HandNormal, k: int, border: Array, half: int) -> None:
    """Columns of the border (m, PAIR, each, P) of the first or the second samples of the pairs from k on, in place."""
    first, stop = PAIR * k + half, min(PAIR * (k + len(border)), len(normal.error))
    for limb, rows, cols in zip(normal.limbs, normal.layout.sample, normal.layout.parameters):
        _scatter_border(limb.B, rows, cols, first, stop, border)


@looped
def _scatter(A: Array, rows: Indices, first: int, stop: int, D: Array, under: Array) -> None:
    """Blocks of a limb's every second sample to those of the whole, in place."""
    for k in range((stop - first + 1) // 2):
        t = first + 2 * k
        half = t % 2
        for i in range(rows.shape[0]):
            for j in range(rows.shape[0]):
                D[k, half, rows[i], half, rows[j]] += A[t, 0, i, j]
                if half == 0:
                    D[k, 1, rows[i], 0, rows[j]] += A[t, 1, i, j]
                else:
                    under[k, 0, rows[i], 1, rows[j]] += A[t, 1, i, j]
                under[k, half, rows[i], half, rows[j]] += A[t, 2, i, j]


@looped
def _scatter_border(
    B: Array, rows: Indices, cols: Indices, first: int, stop: int, border: Array
) -> None:
    """The same of the columns of the parameters."""
    for k in range((stop - first + 1) // 2):
        t = first + 2 * k
        for i in range(rows.shape[0]):
            for j in range(cols.shape[0]):
                border[k, t % 2, rows[i], cols[j]] += B[t, i, j]


def solve_step(normal: HandNormal, factor: HandFactor) -> Step:
    """Where the minimum of the quadratic model lies from here; the factor may be of equations elsewhere."""
    gradient = np.zeros((len(normal.error), normal.layout.each))
    for limb, rows in zip(normal.limbs, normal.layout.sample):
        gradient[:, rows] += limb.a
    gradient[:, normal.layout.error] += normal.error
    pulled = project_on_parameters(normal, factor, gradient[None])[0]
    parameters = factor.covariance @ (pulled - normal.c)
    rhs = -gradient - _border_product(normal, parameters)
    x = _backward(factor, _forward(factor, _pair_samples(rhs[None])))
    return Step(_split_pairs(x, normal)[0], parameters)


def draw_steps(
    normal: HandNormal, factor: HandFactor, of_samples: Array, of_parameters: Array
) -> list[Step]:
    """Draws from the distribution with the equations' covariance, of independent standard normal numbers (m, n, each) and (m, P)."""
    parameters = of_parameters @ np.linalg.cholesky(factor.covariance).T
    border = _forward(
        factor, _pair_samples(np.stack([_border_product(normal, p) for p in parameters]))
    )
    x = _backward(factor, _pair_samples(of_samples) - border)
    return [Step(*one) for one in zip(_split_pairs(x, normal), parameters)]


def project_on_parameters(normal: HandNormal, factor: HandFactor, of_samples: Array) -> Array:
    """B' A^-1 v (m, P), of v (m, n, each): how gradients by samples' unknowns pull the parameters, but for their sign."""
    x = _split_pairs(_backward(factor, _forward(factor, _pair_samples(of_samples))), normal)
    projected = np.zeros((len(x), normal.layout.count))
    for limb, rows, cols in zip(normal.limbs, normal.layout.sample, normal.layout.parameters):
        projected[:, cols] += np.tensordot(x[:, :, rows], limb.B, axes=((1, 2), (0, 1)))
    return projected


def project_groups(
    normal: HandNormal, factor: HandFactor, of_samples: Array, group_size: int
) -> Array:
    """The same (groups, P) of groups of samples, whose v stand in `of_samples` (2, n, each) as in `normal_equations.project_groups`.

    A^-1 B is made from the end to the beginning, of L^-1 B of a few pairs at a time: of a first pass one row before each of these is kept. Time grows linearly with the recording.
    """
    n, P, pairs = len(normal.error), normal.layout.count, len(factor.L)
    pulls, ahead = np.zeros((-(-n // group_size), P)), np.zeros((factor.L.shape[1], P))
    starts, before = range(0, pairs, TOGETHER), [np.zeros_like(ahead)]
    with parallel.threads() as each:
        for k in starts[:-1]:
            before.append(_whitened_border(normal, factor, k, before[-1], each)[-1].copy())
        for k in reversed(starts):
            border = _whitened_border(normal, factor, k, before.pop(), each)
            stop = k + len(border)
            each(
                partial(_solve_transposed, border, ahead, factor.below[k:stop], factor.L[k:stop]),
                _halves(P),
            )
            samples = np.arange(PAIR * k, min(PAIR * stop, n))
            solved = border.reshape(-1, normal.layout.each, P)[: len(samples)]
            share = np.matmul(of_samples[:, samples].transpose(1, 0, 2), solved)
            for parity, group in enumerate(_groups_of(samples, group_size)):
                np.add.at(pulls, np.clip(group, 0, len(pulls) - 1), share[:, parity])
            ahead = border[0].copy()
    return pulls


def _whitened_border(
    normal: HandNormal, factor: HandFactor, k: int, last: Array, each: Each
) -> Array:
    """Rows of L^-1 B (m, 2 each, P) of the pairs from k on; `last` (2 each, P) are those of the pair before them."""
    L, P = factor.L[k : k + TOGETHER], normal.layout.count
    border = np.zeros((len(L), PAIR * normal.layout.each, P))
    of_samples = border.reshape(len(L), PAIR, -1, P)
    each(partial(_fill_border_half, normal, k, of_samples), range(PAIR))
    before = factor.below[np.arange(k, k + len(L)) - 1]
    each(partial(_whiten, border, last, before, L), _halves(P))
    return border


def _solve_transposed(border: Array, ahead: Array, below: Array, L: Array, cols: slice) -> None:
    """Columns of Y (m, E, P) become those of L'^-1 Y, in place; `ahead` (E, P) are those of the pair behind them."""
    known, half = np.ascontiguousarray(ahead[:, cols]), border.shape[1] // PAIR
    for own, under, root in zip(border[::-1, :, cols], below[::-1], L[::-1]):
        rest = own.copy()
        rest[:half] -= under[:half, :half].T @ known[:half]
        rest[half:] -= under[:, half:].T @ known
        known = blas.dtrsm(1.0, root.T, rest.T, side=1, lower=0, trans_a=1, overwrite_b=1).T
        own[...] = known


def _groups_of(samples: Indices, size: int) -> tuple[Indices, Indices]:
    """The even and the odd group that each sample may belong to: its own, and the nearest one beside that."""
    own = samples // size
    beside = np.where(2 * (samples - own * size) < size, own - 1, own + 1)
    return np.where(own % 2 == 0, own, beside), np.where(own % 2 == 1, own, beside)


def _halves(count: int) -> tuple[slice, slice]:
    return slice(0, count // 2), slice(count // 2, count)


def _border_product(normal: HandNormal, parameters: Array) -> Array:
    """B p (n, each)."""
    product = np.zeros((len(normal.error), normal.layout.each))
    for limb, rows, cols in zip(normal.limbs, normal.layout.sample, normal.layout.parameters):
        product[:, rows] += limb.B @ parameters[cols]
    return product


def _pair_samples(v: Array) -> Array:
    """(m, n, each) as (K, m, 2 each), a sample of zeros where one is missing."""
    m, n, each = v.shape
    whole = np.concatenate([v, np.zeros((m, n % PAIR, each))], axis=1)
    return whole.reshape(m, -1, PAIR * each).transpose(1, 0, 2)


def _split_pairs(x: Array, normal: HandNormal) -> Array:
    """The way back, (m, n, each)."""
    return x.transpose(1, 0, 2).reshape(x.shape[1], -1, normal.layout.each)[:, : len(normal.error)]


def _forward(factor: HandFactor, y: Array) -> Array:
    """L^-1 y, of rows (K, m, 2 each)."""
    y = y.copy()
    for k in range(len(y)):
        if k:
            y[k] -= y[k - 1] @ factor.below[k - 1].T
        y[k] = blas.dtrsm(1.0, factor.L[k].T, y[k].T, lower=0, trans_a=1).T
    return y


def _backward(factor: HandFactor, x: Array) -> Array:
    """L'^-1 x, of rows (K, m, 2 each)."""
    x = x.copy()
    for k in range(len(x) - 1, -1, -1):
        if k + 1 < len(x):
            x[k] -= x[k + 1] @ factor.below[k]
        x[k] = blas.dtrsm(1.0, factor.L[k].T, x[k].T, lower=0).T
    return x
