"""The normal equations of a whole hand: those of its limbs, put together two samples at a time while they are factored.

In      a HandProblem, a HandPlace
Out     increments, covariance of the parameters, draws; time and memory grow linearly with the recording, one factor of the border never exists as a whole
Source  Cholesky of a block-tridiagonal matrix: Golub & Van Loan, 4.5; Schur complement: Triggs et al. 2000, 6.1
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.linalg import blas, lapack

from handscope.estimators.numerics import parallel
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import looped
from handscope.estimators.numerics.parallel import Each
from handscope.estimators.numerics.typing import Array, Indices
from handscope.estimators.self_calibration import normal_equations, residuals
from handscope.estimators.self_calibration import soft_tissue as skin_motion
from handscope.estimators.self_calibration.normal_equations import Normal, Step
from handscope.estimators.self_calibration.problem import Problem, Unknowns, parameter_columns
from handscope.estimators.self_calibration.residuals import Terms
from handscope.estimators.self_calibration.whole_hand import problem as whole_hand_problem
from handscope.estimators.self_calibration.whole_hand.problem import (
    OWN,
    HandPlace,
    HandProblem,
    Layout,
)

CHUNK = 512  # samples whose derivatives are in memory at once
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
    off, skin_sd = hand_tissue_priors(problem, at)
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
    priors = limb_priors(limb, at.limbs[k], shares=k == 0)
    return normal, normal_equations.add_everything(normal, terms_of(problem, at, k), priors)


def without_band(normal: HandNormal) -> HandNormal:
    """What steps, pulls and draws need beside the factor."""
    none = np.empty((0, normal_equations.SPAN, 0, 0))
    return replace(normal, limbs=tuple(replace(limb, A=none) for limb in normal.limbs))


def with_gradient(normal: HandNormal, problem: HandProblem, at: HandPlace) -> HandNormal:
    """The same equations with the gradient, and the cost, of another place."""
    (off, skin_sd), sd = hand_tissue_priors(problem, at), normal.error_sd
    c, limbs = np.zeros(normal.layout.count), []
    c[normal.layout.skin] = off / skin_sd
    total = 0.5 * float(((at.error / sd[:, None]) ** 2).sum() + (off**2).sum())
    for k, (limb, cols) in enumerate(zip(normal.limbs, normal.layout.parameters)):
        priors = limb_priors(problem.limbs[k], at.limbs[k], shares=k == 0)
        there, own = normal_equations.with_gradient(limb, terms_of(problem, at, k), priors)
        limbs.append(there)
        c[cols] += there.c
        total += own
    error = at.error / sd[:, None] ** 2
    return replace(normal, limbs=tuple(limbs), error=error, c=c, cost=total)


def cost(problem: HandProblem, at: HandPlace) -> float:
    """Half the sum of the squared residuals."""
    total = 0.5 * float(
        ((at.error / whole_hand_problem.error_sd(problem)[:, None]) ** 2).sum()
        + (hand_tissue_priors(problem, at)[0] ** 2).sum()
    )
    for k, limb in enumerate(problem.limbs):
        total += 0.5 * float((limb_priors(limb, at.limbs[k], shares=k == 0)[0] ** 2).sum())
        for start in range(0, len(limb), CHUNK):
            for kind in _residual_kinds(k):
                total += 0.5 * float(
                    (_residuals_only(problem, at, k, kind, start, start + CHUNK) ** 2).sum()
                )
    return total


def hand_tissue_priors(problem: HandProblem, at: HandPlace) -> tuple[Array, Array]:
    """How far the hand's skin moves its sensor, and its laws, in standard deviations, and these (7 F,)."""
    noise, quarter = problem.noise, np.pi / 2
    F = len(problem.limbs)
    sizes = np.radians(noise.skin_turn) / quarter, 1e-3 * noise.skin_slide / quarter, noise.skin_law
    sd = np.repeat(sizes, (3 * F, 3 * F, F))
    return np.concatenate([at.skin_turn.ravel(), at.skin_slide.ravel(), at.skin_law]) / sd, sd


def terms_of(
    problem: HandProblem, at: HandPlace, k: int, first: int = 0, last: int | None = None
) -> Iterator[Terms]:
    """Residuals of limb k with derivatives by its sensors' turns, the hand's error and skin; what all limbs have in common only with the first. Of samples from `first` to before `last`."""
    limb, place = problem.limbs[k], at.limbs[k]
    quiet, bending, end = (
        _without_hand_noise(limb),
        whole_hand_problem.root_flexion(problem),
        len(limb) if last is None else last,
    )
    for start in range(first, end, CHUNK):
        stop = min(start + CHUNK, end)
        for kind in _residual_kinds(k):
            if kind is residuals.joint_acceleration_terms:
                yield _joint_terms(quiet, place, at, bending, start, stop)
            else:
                yield _add_hand_columns(_drop_shared_rows(kind(limb, place, start, stop), kind, k))


def _residual_kinds(k: int) -> tuple[Callable[[Problem, Unknowns, int, int], Terms], ...]:
    """Of residuals of limb k: the first tells how the hand stays."""
    return tuple(
        kind
        for kind in residuals.EVERY_SAMPLE
        if k == 0 or kind is not residuals.mean_acceleration_terms
    )


def _drop_shared_rows(terms: Terms, kind: Callable[..., Terms], k: int) -> Terms:
    """Rows of the hand's sensor are the first limb's."""
    if k == 0 or kind is residuals.hinge_terms:
        return terms
    return replace(
        terms,
        r=terms.r[:, 3:],
        by_turns=terms.by_turns[:, 3:],
        by_parameters=terms.by_parameters[:, 3:],
    )


def _without_hand_noise(limb: Problem) -> Problem:
    """With the hand's noise an unknown."""
    return replace(limb, acc_sd=np.where(np.arange(limb.acc_sd.shape[1]) == 0, 0.0, limb.acc_sd))


def _residuals_only(
    problem: HandProblem, at: HandPlace, k: int, kind: Callable[..., Terms], start: int, stop: int
) -> Array:
    """Residuals of limb k without derivatives."""
    limb, place = problem.limbs[k], at.limbs[k]
    if kind is residuals.joint_acceleration_terms:
        return _joint_residuals(
            _without_hand_noise(limb),
            place,
            at,
            whole_hand_problem.root_flexion(problem),
            start,
            stop,
        )[0]
    r = residuals.residuals_alone(kind)(limb, place, start, stop)
    return r if k == 0 or kind is residuals.hinge_terms else r[:, 3:]  # as `_drop_shared_rows`


def _joint_residuals(
    quiet: Problem, place: Unknowns, at: HandPlace, bending: Array, start: int, stop: int
) -> tuple[Array, Array]:
    """Residuals (T, J, 3) of `_joint_terms`; the part of them that the skin makes."""
    first, stop, root = (
        max(start, 1),
        min(stop, len(quiet) - 1),
        whole_hand_problem.root_joint(quiet.chain),
    )
    r = residuals.joint_acceleration_residuals(quiet, place, first, stop).reshape(
        stop - first, len(quiet.chain.joints), 3
    )
    seen = residuals.whitening_matrix(quiet, first, stop)[:, :, root, None]
    samples = np.arange(first - 1, stop + 1)
    v = place.far[root] - skin_motion.place_in_sensor(
        skin_motion.displace_sensor(
            skin_motion.tissue_response(bending[samples], at.skin_law), at.skin_turn, at.skin_slide
        ),
        place.far[root],
    )
    swung = np.einsum("tij,tj->ti", quat.matrix(place.q_GS[samples, 0]), v)
    e = np.diff(swung, 2, axis=0) / quiet.dt**2
    pulled = seen * e[:, None] / residuals.common_scale(place)
    return r + pulled - seen * at.error[first:stop, None], pulled


def _joint_terms(
    quiet: Problem, place: Unknowns, at: HandPlace, bending: Array, start: int, stop: int
) -> Terms:
    """Joints on the hand see the error of its accelerometer, and its sensor pulled by the skin."""
    terms, chain = (
        _add_hand_columns(residuals.joint_acceleration_terms(quiet, place, start, stop)),
        quiet.chain,
    )
    T, J, S, c = len(terms.r), len(chain.joints), len(chain.sensors), parameter_columns(chain)
    first, k = terms.first + 1, whole_hand_problem.root_joint(chain)
    seen = residuals.whitening_matrix(quiet, first, first + T)[:, :, k]  # (T, J)
    grown, (r, by_pull) = (
        residuals.common_scale(place),
        _joint_residuals(quiet, place, at, bending, start, stop),
    )
    by_turn, by_far, by_skin = tissue_acceleration(
        quiet, place, at, bending, first + np.arange(T)[:, None] + np.arange(-1, 2)
    )

    def shared(v: Array) -> Array:
        """What is seen at the joint on the hand (T, 3, ...), in the whitened rows (T, J, 3, ...)."""
        return np.asarray(np.einsum("tj,t...->tj...", seen / grown, v))

    by = terms.by_turns.reshape(T, J, 3, terms.knots, 3 * S + OWN)
    by[..., :3] += shared(by_turn.transpose(0, 2, 1, 3))
    for axis in range(3):
        by[:, :, axis, 1, axis - OWN] = -seen
    slopes = terms.by_parameters.reshape(T, J, 3, len(terms.cols))
    slopes[..., 3 * k : 3 * k + 3] += shared(by_far)
    slopes[..., -9 * S :] -= by_pull[..., None] * np.tile(np.eye(3).ravel(), S) / (3 * S * grown)
    slopes = np.concatenate([slopes, shared(by_skin)], axis=3)
    cols = np.concatenate([terms.cols, c.count + np.arange(by_skin.shape[2])])
    by_turns, by_parameters = by.reshape(terms.by_turns.shape), slopes.reshape(T, 3 * J, len(cols))
    return replace(
        terms, r=r.reshape(T, 3 * J), by_turns=by_turns, by_parameters=by_parameters, cols=cols
    )


def tissue_acceleration(
    limb: Problem, place: Unknowns, at: HandPlace, bending: Array, samples: Indices
) -> tuple[Array, Array, Array]:
    """What the hand's skin does to the acceleration of a limb's joint on the hand: by the turns of three samples (T, 3, 3, 3), its arm, the skin."""
    arm, bent = place.far[whole_hand_problem.root_joint(limb.chain)], bending[samples]  # (T, 3, F)
    b = skin_motion.tissue_response(bent, at.skin_law)
    R = (
        residuals.SECOND_DIFFERENCE[:, None, None]
        / limb.dt**2
        * quat.matrix(place.q_GS[:, 0])[samples]
    )
    moved = skin_motion.displace_sensor(b, at.skin_turn, at.skin_slide)
    v = arm - skin_motion.place_in_sensor(moved, arm)
    by_far = (R @ (np.eye(3) - moved.back)).sum(axis=1)
    turned, slid = -R @ skin_motion.place_by_turn(moved, arm), R @ moved.back
    by_turn, by_slide = (np.einsum("tkf,tkij->tifj", b, v) for v in (turned, slid))
    by_law = np.einsum(
        "tkf,tkif->tif",
        skin_motion.tissue_response_derivatives(bent, at.skin_law)[1],
        turned @ at.skin_turn.T + slid @ at.skin_slide.T,
    )
    T, _, F = b.shape
    by_skin = np.concatenate(
        [by_turn.reshape(T, 3, 3 * F), by_slide.reshape(T, 3, 3 * F), by_law], axis=2
    )
    return -R @ quat.skew(v), by_far, by_skin


def _add_hand_columns(terms: Terms) -> Terms:
    """Columns for the hand's error, behind the turns of each sample."""
    T, m = terms.r.shape
    by = terms.by_turns.reshape(T, m, terms.knots, terms.by_turns.shape[2] // terms.knots)
    wide = np.concatenate([by, np.zeros((T, m, terms.knots, OWN))], axis=3)
    return replace(terms, by_turns=wide.reshape(T, m, terms.knots * wide.shape[3]))


def limb_priors(limb: Problem, at: Unknowns, shares: bool) -> tuple[Array, Array]:
    """Residuals and Jacobian of the priors of one limb."""
    r, K = residuals.prior_residuals(limb, at)
    if shares:
        return r, K
    own = np.delete(K, whole_hand_problem.shared_columns(limb.chain), axis=1).any(axis=1)
    return r[own], K[own]


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
