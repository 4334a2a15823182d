"""The normal equations of a whole hand: those of its limbs, put together and factored a piece of time at a time, and made again where a step, a draw or a pull needs them.

In      a HandProblem, a HandPlace
Out     increments, covariance of the parameters, draws; time grows linearly with the recording, of memory that of the ends of pieces
Source  Cholesky of a block-tridiagonal matrix: Golub & Van Loan, 4.5; Schur complement: Triggs et al. 2000, 6.1; what is made again instead of kept: checkpoints,
        Griewank 1992, Optimization Methods and Software 1
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
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
from handscope.estimators.self_calibration.uncertainty import posterior
from handscope.estimators.self_calibration.whole_hand import problem as whole_hand_problem
from handscope.estimators.self_calibration.whole_hand import residuals as hand_residuals
from handscope.estimators.self_calibration.whole_hand.problem import (
    HandPlace,
    HandProblem,
    Layout,
)

PIECE = 128  # samples, an even number, whose equations are in memory at once
PAIR = 2  # samples that are factored at once: what spans three samples reaches the next pair, no further
REACH = normal_equations.SPAN - 1  # samples to which a residual reaches beyond its first


@dataclass(frozen=True)
class End:
    """What a piece needs to know of the pair of samples before it, to be factored."""

    below: Array  # (2 each, 2 each) of L, in the rows of the piece's first pair and the columns of that before
    border: Array  # (2 each, P + 1) the rows of that pair of L^-1 [B, a]


@dataclass(frozen=True)
class HandFactor:
    """Of the band A = L L' the ends of pieces, from which all of it is made again; gradient and covariance of the parameters, the trajectory eliminated."""

    problem: HandProblem
    at: HandPlace  # where the derivatives were taken
    damping: float
    layout: Layout
    ends: tuple[End, ...]
    gradient: Array  # (P,)
    covariance: Array  # (P, P)


@dataclass(frozen=True)
class Piece:
    """The factor of a piece's pairs of samples, and their part of the border."""

    samples: range
    L: Array  # (m, 2 each, 2 each)
    below: Array  # (m, 2 each, 2 each) in the rows of the next pair and the columns of its own
    border: Array  # (m, 2 each, columns) of L^-1 [B, a], or of what was asked for of its columns


def factorise(problem: HandProblem, at: HandPlace, damping: float = 0.0) -> HandFactor:
    """The diagonal grows by the factor 1 + damping. LinAlgError where the equations do not tell the unknowns."""
    where = whole_hand_problem.layout(problem)
    P, E = where.count, PAIR * where.each
    C, c = _prior_equations(problem, at, where)
    known, ends = np.zeros((P + 1, P + 1)), list[End]()
    end = End(np.zeros((E, E)), np.zeros((E, P + 1)))
    first, second = _halves(P + 1)
    products = [((first, first), (second, second)), ((first, second),)]
    with _workspace(problem, at, damping, where) as space:
        for start in range(0, len(problem), PIECE):
            ends.append(end)
            piece = _factorise_piece(space, start, end)
            for limb, cols in zip(space.limbs, where.parameters):
                C[np.ix_(cols, cols)] += limb.C
                c[cols] += limb.c
            space.each(partial(_multiply, piece.border.reshape(-1, P + 1), known), products)
            end = End(piece.below[-1].copy(), piece.border[-1].copy())
    known = np.triu(known) + np.triu(known, 1).T
    C[np.diag_indices_from(C)] *= 1 + damping
    covariance = normal_equations.invert(C - known[:P, :P])
    return HandFactor(problem, at, damping, where, tuple(ends), c - known[:P, P], covariance)


@dataclass(frozen=True)
class _Workspace:
    """Memory in which pieces are made one after the other: a piece is valid until the next is made."""

    problem: HandProblem
    at: HandPlace
    damping: float
    layout: Layout
    error_sd: Array  # (n,)
    limbs: tuple[Normal, ...]  # of a piece, and of REACH samples on either side
    L: Array  # (PIECE / PAIR, E, E)
    D: Array
    below: Array
    border: Array  # (PIECE / PAIR, E, P + 1), empty where columns are asked for
    each: Each


@contextmanager
def _workspace(
    problem: HandProblem, at: HandPlace, damping: float, where: Layout, whole: bool = True
) -> Iterator[_Workspace]:
    """With two threads, until the block is left; `whole` where the whole border is made."""
    m, E = PIECE // PAIR, PAIR * where.each
    limbs = tuple(
        normal_equations.empty(PIECE + 2 * REACH, len(rows), len(cols))
        for rows, cols in zip(where.sample, where.parameters)
    )
    L, D, below = np.empty((3, m, E, E))
    border = np.empty((m, E, where.count + 1) if whole else (0, E, 0))
    with parallel.threads() as each:
        error_sd = whole_hand_problem.error_sd(problem)
        yield _Workspace(problem, at, damping, where, error_sd, limbs, L, D, below, border, each)


def _prior_equations(problem: HandProblem, at: HandPlace, where: Layout) -> tuple[Array, Array]:
    """C (P, P) and c (P,) of the priors."""
    C, c = np.zeros((where.count, where.count)), np.zeros(where.count)
    off, sd = hand_residuals.hand_tissue_priors(problem, at)
    C[where.skin, where.skin], c[where.skin] = np.diag(1 / sd**2), off / sd
    for k, cols in enumerate(where.parameters):
        r, K = hand_residuals.limb_priors(problem.limbs[k], at.limbs[k], shares=k == 0)
        own = cols[: K.shape[1]]
        C[np.ix_(own, own)] += K.T @ K
        c[own] += K.T @ r
    return C, c


def _factorise_piece(
    space: _Workspace, start: int, end: End, columns: Array | None = None
) -> Piece:
    """The piece that begins with a sample; of the border what `columns` (P + 1, m) make of it, or all of it."""
    samples = range(start, min(start + PIECE, len(space.problem)))
    m = -(-len(samples) // PAIR)
    space.each(partial(_fill_limb, space, samples), range(len(space.limbs)))
    L, D, below = space.L[:m], space.D[:m], space.below[:m]
    _fill_band(space, samples, D, below)
    _root_band(D, L, below, end.below)
    before = (end.below, *below[:-1])
    if columns is None:
        border = space.border[:m]
        _fill_border(space, samples, border)
        space.each(partial(_whiten, border, end.border, before, L), _halves(border.shape[2]))
    else:
        border = _combine_border(space, samples, columns)
        _whiten(border, end.border @ columns, before, L, slice(None))
    return Piece(samples, L, below, border)


def _pieces_backwards(
    factor: HandFactor, columns: Array | None = None
) -> Iterator[tuple[Piece, Each]]:
    """The pieces of a factor made again, from the last to the first, and the threads that are at work; `columns` as of `_factorise_piece`."""
    whole = columns is None
    with _workspace(factor.problem, factor.at, factor.damping, factor.layout, whole) as space:
        for k in reversed(range(len(factor.ends))):
            yield _factorise_piece(space, PIECE * k, factor.ends[k], columns), space.each


def _fill_limb(space: _Workspace, samples: range, k: int) -> None:
    """The normal equations of limb k in a piece; C and c of the residuals that begin in it."""
    normal, n = space.limbs[k], len(space.problem)
    for array in (normal.A, normal.B, normal.C, normal.a, normal.c):
        array[...] = 0.0
    first, last = max(samples.start - 1, 0), min(samples.stop + 1, n)
    for terms in hand_residuals.terms_of(space.problem, space.at, k, first, last):
        own = slice(max(samples.start - terms.first, 0), max(samples.stop - terms.first, 0))
        placed = replace(terms, first=terms.first - samples.start + REACH)
        normal_equations.add_terms(normal, placed, own)


def _fill_band(space: _Workspace, samples: range, D: Array, below: Array) -> None:
    """Blocks of a piece's pairs (m, E, E), lower triangles, and those below them, in place."""
    m, e, n = len(D), space.layout.each, len(samples)
    D[...], below[...] = 0.0, 0.0
    split = D.reshape(m, PAIR, e, PAIR, e), below.reshape(m, PAIR, e, PAIR, e)
    space.each(partial(_fill_half, space, samples, *split), range(PAIR))
    diagonal = np.arange(PAIR * e)
    D[:, diagonal, diagonal] *= 1 + space.damping
    if n % PAIR:  # the last sample is missing
        D[-1, diagonal[e:], diagonal[e:]] = 1.0


def _fill_half(space: _Workspace, samples: range, D: Array, under: Array, half: int) -> None:
    """The first or the second samples of the pairs, in place."""
    for limb, rows in zip(space.limbs, space.layout.sample):
        _scatter(limb.A[REACH:], rows, half, len(samples), D, under)
    own = 1 / space.error_sd[samples.start + half : samples.stop : PAIR] ** 2
    error = np.arange(space.layout.each)[space.layout.error]
    D[:, half, :, half][np.arange(len(own))[:, None], error, error] += own[:, None]


def _fill_border(space: _Workspace, samples: range, border: Array) -> None:
    """[B, a] (m, E, P + 1) of a piece, in place."""
    where, n = space.layout, len(samples)
    border[...] = 0.0
    split = border.reshape(len(border), PAIR, where.each, -1)

    def fill(half: int) -> None:
        for limb, rows, cols in zip(space.limbs, where.sample, where.parameters):
            _scatter_border(limb.B[REACH:], rows, cols, half, n, split)

    space.each(fill, range(PAIR))
    a = border.reshape(-1, where.each, where.count + 1)[:n, :, -1]
    for limb, rows in zip(space.limbs, where.sample):
        a[:, rows] += limb.a[REACH : REACH + n]
    a[:, where.error] += _error_gradient(space, samples)


def _error_gradient(space: _Workspace, samples: range) -> Array:
    """Of the hand's error's prior (n, 3)."""
    inside = slice(samples.start, samples.stop)
    return np.asarray(space.at.error[inside] / space.error_sd[inside, None] ** 2)


def _combine_border(space: _Workspace, samples: range, columns: Array) -> Array:
    """[B, a] columns (m, E, columns) of a piece."""
    where, n, (of_parameters, of_gradient) = space.layout, len(samples), (columns[:-1], columns[-1])
    inside = slice(REACH, REACH + n)
    border = np.zeros((n + n % PAIR, where.each, columns.shape[1]))
    for limb, rows, cols in zip(space.limbs, where.sample, where.parameters):
        border[:n, rows] += limb.B[inside] @ of_parameters[cols]
        border[:n, rows] += limb.a[inside, :, None] * of_gradient
    border[:n, where.error] += _error_gradient(space, samples)[..., None] * of_gradient
    return border.reshape(-1, PAIR * where.each, columns.shape[1])


def _root_band(D: Array, L: Array, below: Array, before: Array) -> None:
    """Fills L (m, E, E) of a piece's pairs; what is below them becomes L's. `before` (E, E) is what of L is below the pair before them."""
    for own, root, under in zip(D, L, below):
        own -= before @ before.T
        root[...] = _root(own)
        under[...] = blas.dtrsm(1.0, root.T, under.T, lower=0, trans_a=1).T
        before = under


def _root(D: Array) -> Array:
    upper, failed = lapack.dpotrf(D.T, lower=0, clean=1)
    if failed:
        raise np.linalg.LinAlgError("the readings do not tell the trajectory")
    return np.asarray(upper.T)


def _whiten(border: Array, last: Array, before: Sequence[Array], L: Array, cols: slice) -> None:
    """Columns of B (m, E, P) become those of L^-1 B, in place; `last` (E, P) are those of the pair before them, `before` (E, E) is what of L is below the pair before each."""
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


def solve_step(factor: HandFactor) -> Step:
    """Where the minimum of the quadratic model lies from the factor's place."""
    parameters = -factor.covariance @ factor.gradient
    x = _substitute_back(
        factor,
        np.append(parameters, 1.0)[:, None],
        np.arange(len(factor.problem)),
        lambda samples: np.zeros(1),
    )
    return Step(x[..., 0], parameters)


def draw_steps(factor: HandFactor, count: int, samples: Indices) -> list[Step]:
    """Draws from the distribution with the equations' covariance, their turns at these samples."""
    n, each, P = len(factor.problem), factor.layout.each, factor.layout.count

    def numbers(which: range) -> Array:
        drawn = [
            posterior.normal_numbers(len(which) * each, k, which.start * each).reshape(-1, each)
            for k in range(count)
        ]
        return np.stack(drawn, axis=-1)

    of_parameters = np.stack([posterior.normal_numbers(P, k, n * each) for k in range(count)])
    parameters = of_parameters @ np.linalg.cholesky(factor.covariance).T
    columns = np.concatenate([parameters.T, np.zeros((1, count))])
    x = _substitute_back(factor, columns, samples, numbers)
    return [Step(x[..., k], p) for k, p in enumerate(parameters)]


def _substitute_back(
    factor: HandFactor, columns: Array, kept: Indices, numbers: Callable[[range], Array]
) -> Array:
    """L'^-1 (v - L^-1 [B, a] columns) (kept, each, m) of some samples; `numbers` gives v (n, each, m) of samples."""
    each, m = factor.layout.each, columns.shape[1]
    found, ahead = np.empty((len(kept), each, m)), np.zeros((PAIR * each, m))
    for piece, _ in _pieces_backwards(factor, columns):
        x, samples = -piece.border, piece.samples
        by_sample = x.reshape(-1, each, m)[: len(samples)]
        by_sample += numbers(samples)
        _solve_transposed(x, ahead, piece.below, piece.L, slice(None))
        ahead = x[0]
        inside = (kept >= samples.start) & (kept < samples.stop)
        found[inside] = by_sample[kept[inside] - samples.start]
    return found


def project_groups(factor: HandFactor, of_samples: Array, group_size: int) -> Array:
    """B' A^-1 v (groups, P), of every group's v: how gradients by samples' unknowns pull the parameters, but for their sign.

    The v of groups of samples stand in `of_samples` (2, n, each) as in `normal_equations.project_groups`.
    """
    n, each, P = len(factor.problem), factor.layout.each, factor.layout.count
    pulls, ahead = np.zeros((-(-n // group_size), P)), np.zeros((PAIR * each, P + 1))
    for piece, threads in _pieces_backwards(factor):
        solve = partial(_solve_transposed, piece.border, ahead, piece.below, piece.L)
        threads(solve, _halves(P + 1))
        samples = np.array(piece.samples)
        solved = piece.border.reshape(-1, each, P + 1)[: len(samples), :, :P]
        share = np.matmul(of_samples[:, samples].transpose(1, 0, 2), solved)
        for parity, group in enumerate(_groups_of(samples, group_size)):
            np.add.at(pulls, np.clip(group, 0, len(pulls) - 1), share[:, parity])
        ahead = piece.border[0].copy()
    return pulls


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
