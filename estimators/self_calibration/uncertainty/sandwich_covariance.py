"""Sandwich covariance of the parameters, for errors that the model lacks and that last a while: skin that lags behind a joint, a compliant joint.

In      a limb, or the whole hand, the place of its minimum, the factor of its normal equations
Out     the gradient of each half second by the parameters (its pull); a covariance that includes these; how much larger they are than independent errors explain
Source  covariance of an estimate under a wrong model, from observations in groups: Huber 1967, 5th Berkeley Symposium; Liang & Zeger 1986,
        Biometrika 73. Where residuals are independent, as the model assumes, the pulls agree with the normal equations
Limits  an error that pulls a parameter in the same way in every half second cannot be told from the parameter; it shows in other parameters only
"""

from collections.abc import Callable, Iterable, Iterator
from functools import partial

import numpy as np

from handscope.estimators.numerics.typing import Array, Indices
from handscope.estimators.self_calibration import normal_equations, residuals
from handscope.estimators.self_calibration.normal_equations import Factor
from handscope.estimators.self_calibration.problem import (
    Chain,
    Problem,
    Unknowns,
    parameter_columns,
)
from handscope.estimators.self_calibration.residuals import Terms
from handscope.estimators.self_calibration.whole_hand import normal_equations as hand_equations
from handscope.estimators.self_calibration.whole_hand import problem as whole_hand_problem
from handscope.estimators.self_calibration.whole_hand import residuals as hand_residuals
from handscope.estimators.self_calibration.whole_hand.normal_equations import HandFactor
from handscope.estimators.self_calibration.whole_hand.problem import HandPlace, HandProblem

TOGETHER = 0.5  # s of a group: such errors last for about 0.2 s, as long as a finger bends in one direction
GROUPS = 16  # whose residuals are in memory at once
# residuals, rows of a sample's unknowns, columns of the parameters that they depend on
Placed = tuple[Terms, Indices, Indices]


def widen_covariance(corrected: Array, pulls: Array, covariance: Array) -> Array:
    """The covariance `corrected` (P, P), raised in every direction to at least that of the pulls (m, P); `covariance` (P, P) is that of the normal equations."""
    root = np.linalg.cholesky(corrected)
    off = np.linalg.solve(root, covariance @ pulls.T)
    size, directions = np.linalg.eigh(off @ off.T)
    spread = root @ directions * np.sqrt(np.maximum(size, 1.0))
    return np.asarray(spread @ spread.T)


def squared_pulls(pulls: Array, covariance: Array) -> Array:
    """Squared pulls on each parameter (P,) relative to what independent errors of the estimated size explain: 1, and less where the prior dominates."""
    return np.asarray(np.einsum("mp,mp->p", pulls @ covariance, pulls))


def worst_joint(chain: Chain, squares: Array) -> tuple[int, float]:
    """The joint whose own parameters are pulled most, and the mean over all of a limb; `squares` (P,) of `squared_pulls`."""
    c, joints = parameter_columns(chain), len(chain.joints)
    own = sum(
        squares[where].reshape(joints, -1).sum(axis=1)
        for where in (c.far, c.near, c.skin_turn, c.skin_slide, c.law)
    )
    for where in (c.axis_far, c.axis_near):
        own[chain.hinges] += squares[where].reshape(-1, 2).sum(axis=1)
    return int(np.argmax(own)), float(squares.mean())


def limb_pulls(problem: Problem, at: Unknowns, factor: Factor) -> Array:
    """Gradients (m, P) of half the sum of squares by the parameters, of each group of samples, with the movement eliminated."""
    rows = np.arange(factor.Y.shape[1])

    def terms(first: int, last: int) -> Iterator[Placed]:
        for kind in residuals.EVERY_SAMPLE:
            own = kind(problem, at, first, last)
            yield own, rows, own.cols

    return _group_pulls(
        factor.Y.shape, problem.dt, terms, partial(normal_equations.project_groups, factor)
    )


def hand_pulls(problem: HandProblem, at: HandPlace, factor: HandFactor) -> Array:
    """The same of the whole hand."""
    where, sd = factor.layout, whole_hand_problem.error_sd(problem)[:, None]

    def terms(first: int, last: int) -> Iterator[Placed]:
        for k, (rows, cols) in enumerate(zip(where.sample, where.parameters)):
            for own in hand_residuals.terms_of(problem, at, k, first, last):
                yield own, rows, cols[own.cols]
        r, none = (at.error / sd)[first:last], np.empty(0, np.intp)
        error = Terms(
            first,
            1,
            r,
            np.eye(whole_hand_problem.OWN) / sd[first:last, None],
            np.empty((len(r), whole_hand_problem.OWN, 0)),
            none,
        )
        yield error, np.arange(where.each)[where.error], none

    return _group_pulls(
        (len(problem), where.each, where.count),
        problem.limbs[0].dt,
        terms,
        partial(hand_equations.project_groups, factor),
    )


def _group_pulls(
    shape: tuple[int, int, int],
    dt: float,
    terms: Callable[[int, int], Iterable[Placed]],
    project: Callable[[Array, int], Array],
) -> Array:
    """Pulls (m, P); `shape` is samples, unknowns of a sample, parameters; `project` gives B' A^-1 v (m, P) of the v of all groups, every other one in (2, n, unknowns)."""
    (n, e, P), each = shape, round(TOGETHER / dt)
    own, of_samples = np.zeros((-(-n // each), P)), np.zeros((2, n, e))
    for first in range(0, n, GROUPS * each):
        for one, rows, cols in terms(first, min(first + GROUPS * each, n)):
            begins = np.maximum(one.first + np.arange(len(one.r)), first)
            _add_gradients(own, of_samples, one, rows, cols, begins // each)
    return own - project(of_samples, each)


def _add_gradients(
    own: Array, of_samples: Array, terms: Terms, rows: Indices, cols: Indices, group: Indices
) -> None:
    """Gradients of residuals by parameters and by samples' unknowns, to those of their groups (T,), in place; `of_samples` (2, n, unknowns) in turn: groups beside each other overlap."""
    T = len(terms.r)
    if not T:
        return
    if len(cols):
        np.add.at(
            own, (group[:, None], cols), np.einsum("tmp,tm->tp", terms.by_parameters, terms.r)
        )
    by = np.einsum("tmi,tm->ti", terms.by_turns, terms.r).reshape(T, terms.knots, -1)
    for knot in range(terms.knots):
        place = group[:, None] % len(of_samples)
        of_samples[place, terms.first + knot + np.arange(T)[:, None], rows] += by[:, knot]
