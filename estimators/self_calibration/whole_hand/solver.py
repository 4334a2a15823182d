"""The most probable movement of a whole hand, from fingers that were solved one by one.

In      Solutions of limbs over the same samples, each with the hand's sensor as its root
Out     HandSolution: from it each limb's Solution with its covariance within the whole hand; draws of all limbs together
Source  solver.py, posterior.py for one limb
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from handscope.estimators.numerics.typing import Array, Indices
from handscope.estimators.self_calibration import normal_equations
from handscope.estimators.self_calibration.problem import Noise, Unknowns, parameter_columns
from handscope.estimators.self_calibration.solver import (
    DescentResult,
    Limits,
    Linearised,
    Outcome,
    ProblemOps,
    Solution,
    levenberg_marquardt,
)
from handscope.estimators.self_calibration.uncertainty import (
    parameter_covariance,
    sandwich_covariance,
)
from handscope.estimators.self_calibration.whole_hand import normal_equations as hand_equations
from handscope.estimators.self_calibration.whole_hand import problem as whole_hand_problem
from handscope.estimators.self_calibration.whole_hand import residuals as hand_residuals
from handscope.estimators.self_calibration.whole_hand.normal_equations import HandFactor
from handscope.estimators.self_calibration.whole_hand.problem import HandPlace, HandProblem

NEAR = 0.05  # decrease of the cost for each parameter: a third of a standard deviation of each
UNDAMPED = 1e-8


@dataclass(frozen=True)
class HandSolution:
    """The most probable unknowns of the whole hand, and how they were reached."""

    problem: HandProblem
    at: HandPlace
    outcome: Outcome
    costs: tuple[float, ...]
    factor: HandFactor
    pulled: Array  # (P,) sandwich_covariance.squared_pulls


def solve(
    alone: Sequence[Solution],
    noise: Noise,
    limits: Limits,
    go_on: Callable[[int, float], bool] = lambda k, cost: True,
) -> HandSolution:
    """Minimise the cost of the whole hand from the solutions of its limbs; `go_on` (iteration, cost) stops it by False."""
    problem, start = (
        whole_hand_problem.gather_limbs([s.problem for s in alone], noise),
        whole_hand_problem.merge_places([s.at for s in alone]),
    )
    last: list[_Factored] = []
    result = levenberg_marquardt(
        ProblemOps(
            whole_hand_problem.with_hand_flexion, hand_residuals.cost, partial(_linearise, last)
        ),
        problem,
        start,
        limits,
        go_on,
    )
    raw = (
        last[0].factor
        if last and _is_near(last[0], result)
        else hand_equations.factorise(result.problem, result.at)
    )
    last.clear()
    pulls = sandwich_covariance.hand_pulls(result.problem, result.at, raw)
    factor = replace(
        raw,
        covariance=sandwich_covariance.widen_covariance(
            _corrected_covariance(result.problem, result.at, raw, alone), pulls, raw.covariance
        ),
    )
    return HandSolution(
        result.problem,
        result.at,
        result.outcome,
        result.costs,
        factor,
        sandwich_covariance.squared_pulls(pulls, raw.covariance),
    )


def _corrected_covariance(
    problem: HandProblem, at: HandPlace, factor: HandFactor, alone: Sequence[Solution]
) -> Array:
    """Covariance (P, P) without spurious information, which is taken from each limb alone."""
    where = factor.layout
    spurious, before, variances = (
        np.zeros((where.count, where.count)),
        np.zeros((where.count, where.count)),
        np.zeros(where.count),
    )
    before[where.skin, where.skin] = np.diag(
        1 / hand_residuals.hand_tissue_priors(problem, at)[1] ** 2
    )
    arms = []
    for k, (limb, place, one, together) in enumerate(
        zip(problem.limbs, at.limbs, alone, where.parameters)
    ):
        cols = together[: parameter_columns(limb.chain).count]
        slopes = hand_residuals.limb_priors(limb, place, shares=k == 0)[1]
        spurious[np.ix_(cols, cols)] += one.spurious_information
        before[np.ix_(cols, cols)] += slopes.T @ slopes
        variances[cols] = parameter_covariance.bias_walk_variance(limb)
        own = np.zeros((2 * len(place.far), where.count))
        own[:, cols] = parameter_covariance.arm_directions(limb, place)
        arms.append(own)
    covariance = parameter_covariance.without_noise(
        factor.covariance, spurious, before, np.concatenate(arms)
    )
    return covariance + np.diag(variances)


@dataclass(frozen=True)
class _Factored:
    """The last factor of the minimisation."""

    cost: float  # where it was made
    factor: HandFactor


def _is_near(last: _Factored, result: DescentResult[HandProblem, HandPlace]) -> bool:
    """Whether the last factor holds for the minimum, too: the cost has decreased little since, for so many unknowns."""
    return (
        last.factor.damping <= UNDAMPED
        and result.outcome == "converged"
        and last.cost - result.costs[-1] < NEAR * last.factor.layout.count
    )


def _linearise(
    last: list[_Factored], problem: HandProblem, at: HandPlace
) -> Linearised[HandProblem, HandPlace]:
    cost = hand_residuals.cost(problem, at)

    def damped(damping: float) -> HandPlace:
        last.clear()  # two at once would be most of what is in memory
        factor = hand_equations.factorise(problem, at, damping)
        last.append(_Factored(cost, factor))
        step = hand_equations.solve_step(factor)
        return whole_hand_problem.apply_hand_increment(at, problem, step.turns, step.parameters)

    return Linearised(cost, damped)


def split_limbs(solution: HandSolution) -> list[Solution]:
    """The solution of each limb within the whole hand; its factor holds the covariance only, draws come from the whole (`draw_places`)."""
    return [
        Solution(
            at,
            limb,
            solution.outcome,
            solution.costs,
            normal_equations.keep_covariance_only(solution.factor.covariance[np.ix_(cols, cols)]),
        )
        for at, limb, cols in zip(
            whole_hand_problem.remove_hand_tissue(solution.problem, solution.at),
            solution.problem.limbs,
            _limb_columns(solution),
        )
    ]


def _limb_columns(solution: HandSolution) -> list[Indices]:
    """Columns of each limb's own parameters among those of the hand."""
    return [
        cols[: parameter_columns(limb.chain).count]
        for limb, cols in zip(solution.problem.limbs, solution.factor.layout.parameters)
    ]


def worst_joints(solution: HandSolution) -> list[tuple[int, float]]:
    """Of each limb the joint at which movement fits worst, and by how much: a value above 1 is more than errors of single samples explain (`sandwich_covariance.worst_joint`)."""
    return [
        sandwich_covariance.worst_joint(limb.chain, solution.pulled[cols])
        for limb, cols in zip(solution.problem.limbs, _limb_columns(solution))
    ]


def draw_places(
    solution: HandSolution, count: int, samples: Indices
) -> Iterator[tuple[Unknowns, ...]]:
    """Draws from the posterior: unknowns of all limbs, orientations of these samples."""
    problem, at = whole_hand_problem.at_samples(solution.problem, solution.at, samples)
    for step in hand_equations.draw_steps(solution.factor, count, samples):
        yield whole_hand_problem.remove_hand_tissue(
            problem,
            whole_hand_problem.apply_hand_increment(at, problem, step.turns, step.parameters),
        )
