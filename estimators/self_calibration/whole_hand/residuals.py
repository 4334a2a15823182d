"""Residuals of a whole hand with their derivatives: those of its limbs, seen through the error and the skin that they have in common.

In      a HandProblem, a HandPlace, a limb, a stretch of samples
Out     Terms by the limb's sensors' turns, the hand's error and skin; priors; the cost
Source  Kortier, thesis ch. 4; ../residuals.py
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Indices
from handscope.estimators.self_calibration import residuals
from handscope.estimators.self_calibration import soft_tissue as skin_motion
from handscope.estimators.self_calibration.problem import Problem, Unknowns, parameter_columns
from handscope.estimators.self_calibration.residuals import Terms
from handscope.estimators.self_calibration.whole_hand import problem as whole_hand_problem
from handscope.estimators.self_calibration.whole_hand.problem import OWN, HandPlace, HandProblem

CHUNK = 512  # samples whose derivatives are in memory at once


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
