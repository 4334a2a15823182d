"""Self-calibration in a sliding window: samples that leave are marginalised to a Gaussian prior.

In      readings of a chain's sensors, some samples at a time; where to begin
Out     Window: orientations of its samples and all parameters, estimated from all readings so far; covariance of one sample with the parameters
        and the sensors' orientations in the pose, which stay among the unknowns: the joints were straight there
Source  residuals and unknowns: map's (Kortier, thesis ch. 4); marginalisation: Sibley, Matthies & Sukhatme 2010, J Field Robot 27:587
Limits  samples that have left stay linearised at their estimate of that time: errors of a poor start remain in the prior (Dong-Si & Mourikis 2011, ICRA, 5655).
        Sizes of errors are given, not estimated; parameters are constant
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import normal_equations, residuals
from handscope.estimators.self_calibration.normal_equations import Factor, Normal
from handscope.estimators.self_calibration.problem import (
    Chain,
    Columns,
    Noise,
    Problem,
    Readings,
    Unknowns,
    apply_increment,
    build_problem,
    parameter_columns,
    tangents,
    with_flexion,
)
from handscope.estimators.self_calibration.residuals import Terms

EVERY_SAMPLE = (
    residuals.gyroscope_terms,
    residuals.joint_acceleration_terms,
    residuals.hinge_terms,
    residuals.mean_acceleration_terms,
)  # `MarginalPrior` holds the initial orientations
SHARED = 2  # samples of the window that those that left have touched: a joint's meeting spans three
TAIL = 3  # last readings that are needed again: two samples of the window and the one ahead of it, without which the last turn is not known
POSE_SD = 1e-3  # rad: what the first sample may have turned from the pose; the hand is held still
HEADING_SD = 1e-3  # rad: the root's heading is free and is held where it began


@dataclass(frozen=True)
class MarginalPrior:
    """Information of the samples that left the window: a quadratic form of the increment from the linearisation point, over SHARED samples, parameters and pose."""

    at: Unknowns  # of SHARED samples, where it was linearised
    pose: Array  # (S, 4) there
    H: Array  # (SHARED e + P + e, the same) e unknowns a sample, P parameters
    g: Array  # (SHARED e + P + e,)


@dataclass(frozen=True)
class Window:
    """The samples within the window, with the prior of those that left."""

    problem: Problem  # of the window's samples
    tail: Readings  # the last TAIL readings
    at: Unknowns
    pose: Array  # (S, 4) orientations of the sensors in the pose
    prior: MarginalPrior


@dataclass(frozen=True)
class WindowResult:
    """A window after a step."""

    window: Window
    factor: Factor  # of the window's normal equations before the oldest samples left; parameters and pose are its border
    left: int  # how many of its samples did
    misfit: float  # RMS of the residuals of joints' accelerations in their standard deviations


def start_window(  # noqa: PLR0913
    chain: Chain,
    noise: Noise,
    readings: Readings,
    first: Unknowns,
    sd: Array,
    pose: Array,
    in_pose: bool,
    hand: Hand,
    mounting: Mapping[str, Array],
) -> Window:
    """A window of all but the last of at least TAIL `readings`; `first` has the orientations of the first sample, known to `sd` (S, 3) rad in the sensors' frames.

    `pose` (S, 4) is as well known; `in_pose`: the first sample is still there.
    """
    n = len(readings) - 1
    whole = build_problem(chain, noise, readings, first.q_GS[0], hand, mounting)
    problem = _slice_problem(replace(whole, bias_prior=first.bias_gyr), 0, n)
    at = _integrate_gyroscopes(first, problem.turns, problem.dt)
    e, P = 3 * len(chain.sensors), parameter_columns(chain).count
    upright = quat.rotate(quat.conjugate(first.q_GS[0, 0]), np.array([0.0, 0.0, 1.0]))
    H, own = np.zeros((SHARED * e + P + e, SHARED * e + P + e)), np.diag(1 / np.ravel(sd) ** 2)
    own[:3, :3] += np.outer(upright, upright) / HEADING_SD**2
    H[:e, :e] = own
    H[-e:, -e:] = np.eye(e) / POSE_SD**2 if in_pose else own
    if in_pose:
        H[:e, :e] += np.eye(e) / POSE_SD**2
        H[:e, -e:] = H[-e:, :e] = -np.eye(e) / POSE_SD**2
    began = first.q_GS[0] if in_pose else pose
    prior = MarginalPrior(_slice_samples(at, 0, SHARED), began, H, np.zeros(len(H)))
    return Window(problem, _slice_readings(readings, n + 1 - TAIL, n + 1), at, began, prior)


def extend_window(window: Window, fresh: Readings) -> Window:
    """The window with as many samples more as `fresh` has; where they are oriented is what gyroscopes say."""
    m, problem = len(fresh), window.problem
    both = _join_readings(window.tail, fresh)
    # what depends on hand and mounting is known already
    piece = build_problem(problem.chain, problem.noise, both, problem.start, "left", {})
    new, between = slice(SHARED, SHARED + m), slice(SHARED - 1, SHARED - 1 + m)
    grown = replace(
        problem,
        turns=np.concatenate([problem.turns, piece.turns[between]]),
        later=np.concatenate([problem.later, piece.later[between]]),
        turn_sd=np.concatenate([problem.turn_sd, piece.turn_sd[between]]),
        acc=np.concatenate([problem.acc, piece.acc[new]]),
        acc_sd=np.concatenate([problem.acc_sd, piece.acc_sd[new]]),
        bent=np.concatenate([problem.bent, np.zeros((m, problem.bent.shape[1]))]),
        by_tilt=np.concatenate([problem.by_tilt, np.zeros((m, *problem.by_tilt.shape[1:]))]),
    )
    ahead = _integrate_gyroscopes(
        _slice_samples(window.at, -1, None), piece.turns[between], problem.dt
    )
    at = replace(window.at, q_GS=np.concatenate([window.at.q_GS, ahead.q_GS[1:]]))
    return replace(
        window, problem=grown, tail=_slice_readings(both, len(both) - TAIL, len(both)), at=at
    )


def solve_window(window: Window, most: int, rounds: int, straight: float) -> WindowResult:
    """Gauss-Newton steps, `rounds` of them; then the oldest samples leave until there are `most`. LinAlgError where it is not observable.

    `straight` (rad): how far a joint may have been off in the pose.
    """
    for _ in range(rounds):
        window = replace(window, problem=with_flexion(window.problem, window.at))
        here, terms = (
            window,
            [kind(window.problem, window.at, 0, len(window.problem)) for kind in EVERY_SAMPLE],
        )
        factor, window = _gauss_newton_step(window, terms, straight)
    leave = max(0, len(window.problem) - most)
    prior = _marginalise_oldest(here, terms, leave) if leave else window.prior
    remaining = replace(
        window,
        problem=_slice_problem(window.problem, leave, len(window.problem)),
        at=_slice_samples(window.at, leave, None),
        prior=prior,
    )
    return WindowResult(
        remaining,
        factor,
        leave,
        float(np.sqrt(np.mean(terms[1].r ** 2))) if terms[1].r.size else 0.0,
    )


def inherit_prior(fresh: Window, before: Window) -> Window:
    """A new window that inherits the prior on parameters and pose of another one, linearised at the same point."""
    k = SHARED * 3 * len(before.pose)
    H, g = np.zeros_like(fresh.prior.H), np.zeros_like(fresh.prior.g)
    H[:k, :k] = fresh.prior.H[:k, :k]
    H[k:, k:], g[k:] = _eliminate(before.prior.H, before.prior.g, k)
    here = replace(before.prior.at, q_GS=fresh.at.q_GS)
    return replace(
        fresh,
        at=here,
        pose=before.prior.pose,
        prior=MarginalPrior(_slice_samples(here, 0, SHARED), before.prior.pose, H, g),
    )


def covariance(factor: Factor, k: int) -> Array:
    """Of the orientations of sample k from the end (1 is the last) with the parameters (e + P, e + P)."""
    n, span, e, _ = factor.L.shape
    root = np.zeros((k * e, k * e))
    for row in range(k):
        for ahead in range(min(span, k - row)):
            root[(row + ahead) * e : (row + ahead + 1) * e, row * e : (row + 1) * e] = factor.L[
                n - k + row, ahead
            ]
    own = solve_triangular(root, np.eye(k * e, e), lower=True)
    M = own.T @ factor.Y[n - k :].reshape(k * e, -1)
    across = -M @ factor.covariance
    return np.block([[own.T @ own - across @ M.T, across], [across.T, factor.covariance]])


def _gauss_newton_step(
    window: Window, terms: Sequence[Terms], straight: float
) -> tuple[Factor, Window]:
    at, chain = window.at, window.problem.chain
    S, P = len(chain.sensors), parameter_columns(chain).count
    normal = _build_normal(len(window.problem), window, terms)
    r, K = residuals.prior_residuals(window.problem, at)
    normal.C[:P, :P] += K.T @ K
    normal.c[:P] += K.T @ r
    r, K = _straight_pose_residuals(window, straight)
    normal.C[...] += K.T @ K
    normal.c[...] += K.T @ r
    factor = normal_equations.factorise(normal)
    step = normal_equations.solve_step(normal, factor)
    if not (np.isfinite(step.turns).all() and np.isfinite(step.parameters).all()):
        raise np.linalg.LinAlgError("the step is not finite")
    pose = quat.normalize(quat.multiply(window.pose, quat.exp(step.parameters[P:].reshape(S, 3))))
    return factor, replace(
        window,
        at=apply_increment(at, chain, step.turns.reshape(-1, S, 3), step.parameters[:P]),
        pose=pose,
    )


def _straight_pose_residuals(window: Window, sd: float) -> tuple[Array, Array]:
    """In the pose neighbouring bones lie in one line: residuals (m,) and their derivatives by parameters and pose (m, P + e)."""
    at, chain = window.at, window.problem.chain
    c, R = parameter_columns(chain), quat.matrix(window.pose)
    bones = {s: (before, behind) for s, before, behind in residuals.bones(chain)}
    r, by = [], []
    for i, j in zip(chain.parents, chain.children):
        if i in bones and j in bones:
            off, slope = np.zeros(3), np.zeros((3, c.count + R.shape[0] * 3))
            for sign, s in ((1.0, int(i)), (-1.0, int(j))):
                b, a = bones[s]
                along = at.far[a] - at.near[b]
                size = float(np.linalg.norm(along)) + 1e-12
                unit = along / size
                turned = sign * R[s] @ (np.eye(3) - np.outer(unit, unit)) / size
                off += sign * R[s] @ unit
                slope[:, c.far.start + 3 * a : c.far.start + 3 * a + 3] += turned
                slope[:, c.near.start + 3 * b : c.near.start + 3 * b + 3] -= turned
                slope[:, c.count + 3 * s : c.count + 3 * s + 3] -= sign * R[s] @ quat.skew(unit)
            r.append(off / sd)
            by.append(slope / sd)
    return np.concatenate([np.zeros(0), *r]), np.concatenate(
        [np.zeros((0, c.count + R.shape[0] * 3)), *by]
    )


def _marginalise_oldest(window: Window, terms: Sequence[Terms], leave: int) -> MarginalPrior:
    """Marginalise the first samples and the prior onto the next two samples, the parameters and the pose."""
    heads = [
        replace(
            t, r=t.r[:leave], by_turns=t.by_turns[:leave], by_parameters=t.by_parameters[:leave]
        )
        for t in terms
    ]
    rest, slope = _eliminate(
        *_to_dense(_build_normal(leave + SHARED, window, heads)),
        leave * 3 * len(window.problem.chain.sensors),
    )
    return MarginalPrior(_slice_samples(window.at, leave, leave + SHARED), window.pose, rest, slope)


def _eliminate(H: Array, g: Array, k: int) -> tuple[Array, Array]:
    """A quadratic form with its first k unknowns eliminated. LinAlgError where they are not observable."""
    eliminated = cho_solve(cho_factor(H[:k, :k]), np.column_stack([H[:k, k:], g[:k]]))
    rest = H[k:, k:] - H[k:, :k] @ eliminated[:, :-1]
    return 0.5 * (rest + rest.T), g[k:] - H[k:, :k] @ eliminated[:, -1]


def _build_normal(n: int, window: Window, terms: Sequence[Terms]) -> Normal:
    """Of the first n samples' residuals and of the past, without what is known of parameters and pose before."""
    chain, prior = window.problem.chain, window.prior
    e, c = 3 * len(chain.sensors), parameter_columns(chain)
    normal = normal_equations.empty(n, e, c.count + e)
    for t in terms:
        normal_equations.add_terms(normal, t)
    increment, slope = _increment_since_prior(prior, window, c)
    H, g = slope.T @ prior.H @ slope, slope.T @ (prior.H @ increment + prior.g)
    normal.A[0, 0] += H[:e, :e]
    normal.A[0, 1] += H[e : 2 * e, :e]
    normal.A[1, 0] += H[e : 2 * e, e : 2 * e]
    normal.B[:SHARED] += H[: SHARED * e, SHARED * e :].reshape(SHARED, e, -1)
    normal.C[...] += H[SHARED * e :, SHARED * e :]
    normal.a[:SHARED] += g[: SHARED * e].reshape(SHARED, e)
    normal.c[...] += g[SHARED * e :]
    return normal


def _increment_since_prior(prior: MarginalPrior, window: Window, c: Columns) -> tuple[Array, Array]:
    """Increment (m,) from the prior's linearisation point to here, and its Jacobian (m, m)."""
    before, at, S = prior.at, window.at, len(window.pose)
    turns = quat.log(
        quat.relative(
            np.concatenate([before.q_GS, prior.pose[None]]),
            np.concatenate([at.q_GS[:SHARED], window.pose[None]]),
        )
    )
    p, slope = np.zeros(c.count), np.eye(turns.size + c.count)
    places = [*range(0, 3 * SHARED * S, 3), *range(3 * SHARED * S + c.count, len(slope), 3)]
    for k, own in zip(places, residuals.inverse_jacobian(turns).reshape(-1, 3, 3)):
        slope[k : k + 3, k : k + 3] = own
    for name in (
        "far",
        "near",
        "bias_gyr",
        "bias_acc",
        "scale_gyr",
        "scale_acc",
        "skin_turn",
        "skin_slide",
        "delay",
        "tilt",
        "law",
    ):
        p[getattr(c, name)] = np.ravel(getattr(at, name) - getattr(before, name))
    for where, old, new in (
        (c.axis_far, before.axis_far, at.axis_far),
        (c.axis_near, before.axis_near, at.axis_near),
    ):
        was, now = tangents(old), tangents(new)
        p[where] = np.einsum("mij,mi->mj", was, new).ravel()
        for h, own in enumerate(np.einsum("mij,mik->mjk", was, now)):
            place = 3 * SHARED * S + where.start + 2 * h
            slope[place : place + 2, place : place + 2] = own
    return np.concatenate([turns[:SHARED].ravel(), p, turns[SHARED].ravel()]), slope


def _to_dense(normal: Normal) -> tuple[Array, Array]:
    """The same equations as one matrix and one gradient."""
    n, span, e, _ = normal.A.shape
    P = len(normal.c)
    H = np.zeros((n * e + P, n * e + P))
    for t in range(n):
        for ahead in range(min(span, n - t)):
            row, column = slice((t + ahead) * e, (t + ahead + 1) * e), slice(t * e, (t + 1) * e)
            H[row, column] = normal.A[t, ahead]
            H[column, row] = normal.A[t, ahead].T
    H[: n * e, n * e :] = normal.B.reshape(n * e, P)
    H[n * e :, : n * e] = H[: n * e, n * e :].T
    H[n * e :, n * e :] = normal.C
    return H, np.concatenate([normal.a.ravel(), normal.c])


def _integrate_gyroscopes(at: Unknowns, turns: Array, dt: float) -> Unknowns:
    """From the one sample of `at` on as gyroscopes say: their turns (n-1, S, 3) less biases."""
    q_GS = np.empty((len(turns) + 1, *at.q_GS.shape[1:]))
    q_GS[0] = at.q_GS[0]
    steps = quat.exp(turns + np.einsum("sij,tsj->tsi", at.scale_gyr, turns) - dt * at.bias_gyr)
    for k, step in enumerate(steps):
        q_GS[k + 1] = quat.normalize(quat.multiply(q_GS[k], step))
    return replace(at, q_GS=q_GS)


def _slice_problem(problem: Problem, start: int, stop: int) -> Problem:
    turns = {
        name: getattr(problem, name)[start : stop - 1] for name in ("turns", "later", "turn_sd")
    }
    return replace(
        problem,
        **turns,
        **{
            name: getattr(problem, name)[start:stop]
            for name in ("acc", "acc_sd", "bent", "by_tilt")
        },
    )


def _slice_samples(at: Unknowns, start: int, stop: int | None) -> Unknowns:
    return replace(at, q_GS=at.q_GS[start:stop])


def _slice_readings(r: Readings, start: int, stop: int) -> Readings:
    return Readings(r.dt, *(v[start:stop] for v in (r.gyr, r.acc, r.gyr_doubt, r.acc_doubt)))


def _join_readings(a: Readings, b: Readings) -> Readings:
    pairs = (a.gyr, b.gyr), (a.acc, b.acc), (a.gyr_doubt, b.gyr_doubt), (a.acc_doubt, b.acc_doubt)
    return Readings(a.dt, *(np.concatenate(pair) for pair in pairs))
