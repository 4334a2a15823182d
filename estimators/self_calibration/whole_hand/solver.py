"""The most probable movement of a whole hand, from fingers that were solved one by one.

In      Solutions of limbs over the same samples, each with the hand's sensor as its root
Out     HandSolution: each limb's Solution with the covariance that it has in the whole; draws of all limbs together
Source  solver.py, posterior.py for one limb
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.numerics.typing import Array, Indices
from handscope.estimators.self_calibration import normal_equations
from handscope.estimators.self_calibration.problem import Noise, Unknowns, columns
from handscope.estimators.self_calibration.solver import Ground, Limits, Outcome, Solution, down
from handscope.estimators.self_calibration.uncertainty import (
    parameter_covariance,
    posterior,
    sandwich_covariance,
)
from handscope.estimators.self_calibration.whole_hand import normal_equations as hand_equations
from handscope.estimators.self_calibration.whole_hand import problem as whole_hand_problem
from handscope.estimators.self_calibration.whole_hand.normal_equations import HandFactor, HandNormal
from handscope.estimators.self_calibration.whole_hand.problem import HandPlace, HandProblem


@dataclass(frozen=True)
class HandSolution:
    problem: HandProblem
    at: HandPlace
    outcome: Outcome
    costs: tuple[float, ...]
    normal: HandNormal
    factor: HandFactor
    pulled: Array  # (P,) misfit.sizes


def solve(
    alone: Sequence[Solution],
    noise: Noise,
    limits: Limits,
    go_on: Callable[[int, float], bool] = lambda k, cost: True,
) -> HandSolution:
    """Go down from what was found limb by limb."""
    problem, start = (
        whole_hand_problem.gathered([s.problem for s in alone], noise),
        whole_hand_problem.merged([s.at for s in alone]),
    )
    way = down(
        Ground(whole_hand_problem.rebent, hand_equations.cost, _sloped),
        problem,
        start,
        limits,
        go_on,
    )
    normal = hand_equations.built(way.problem, way.at)
    raw = hand_equations.factored(normal)
    pulls = sandwich_covariance.of_hand(way.problem, way.at, normal, raw)
    factor = replace(
        raw,
        covariance=sandwich_covariance.widened(
            _told(way.problem, way.at, raw, alone), pulls, raw.covariance
        ),
    )
    return HandSolution(
        way.problem,
        way.at,
        way.outcome,
        way.costs,
        normal,
        factor,
        sandwich_covariance.sizes(pulls, raw.covariance),
    )


def _told(
    problem: HandProblem, at: HandPlace, factor: HandFactor, alone: Sequence[Solution]
) -> Array:
    """As sure as movement makes it: noise makes up in the whole what it made up in each limb alone."""
    where = factor.layout
    made_up, before, variances = (
        np.zeros((where.count, where.count)),
        np.zeros((where.count, where.count)),
        np.zeros(where.count),
    )
    before[where.skin, where.skin] = np.diag(1 / hand_equations.skin(problem, at)[1] ** 2)
    arms = []
    for k, (limb, place, one, together) in enumerate(
        zip(problem.limbs, at.limbs, alone, where.parameters)
    ):
        cols = together[: columns(limb.chain).count]
        slopes = hand_equations.priors(limb, place, shares=k == 0)[1]
        made_up[np.ix_(cols, cols)] += one.made_up
        before[np.ix_(cols, cols)] += slopes.T @ slopes
        variances[cols] = parameter_covariance.walked(limb)
        own = np.zeros((2 * len(place.far), where.count))
        own[:, cols] = parameter_covariance.arms(limb, place)
        arms.append(own)
    told = parameter_covariance.without_noise(
        factor.covariance, made_up, before, np.concatenate(arms)
    )
    return told + np.diag(variances)


def _sloped(problem: HandProblem, at: HandPlace) -> tuple[float, Callable[[float], HandPlace]]:
    normal = hand_equations.built(problem, at)

    def stepped(damping: float) -> HandPlace:
        step = hand_equations.step(normal, hand_equations.factored(normal, damping))
        return whole_hand_problem.stepped(at, problem, step.turns, step.parameters)

    return normal.cost, stepped


def of_limbs(found: HandSolution) -> list[Solution]:
    """Each limb as it is in the whole; of its factor only the covariance, draws are those of the whole."""
    return [
        Solution(
            at,
            limb,
            found.outcome,
            found.costs,
            normal_equations.remembered(found.factor.covariance[np.ix_(cols, cols)]),
        )
        for at, limb, cols in zip(
            whole_hand_problem.straightened(found.problem, found.at),
            found.problem.limbs,
            _own(found),
        )
    ]


def _own(found: HandSolution) -> list[Indices]:
    """Where each limb's own columns stand in the whole's."""
    return [
        cols[: columns(limb.chain).count]
        for limb, cols in zip(found.problem.limbs, found.factor.layout.parameters)
    ]


def misfits(found: HandSolution) -> list[tuple[int, float]]:
    """Of each limb the joint at which movement fits worst, and by how much it does not: beyond 1 by more than errors of single samples (`misfit.worst`)."""
    return [
        sandwich_covariance.worst(limb.chain, found.pulled[cols])
        for limb, cols in zip(found.problem.limbs, _own(found))
    ]


def draws(found: HandSolution, count: int) -> Iterator[tuple[Unknowns, ...]]:
    """Places of all limbs as probable as the readings leave them."""
    n, each, P = len(found.problem), found.factor.layout.each, found.factor.layout.count
    numbers = np.stack([posterior.normal_numbers(n * each + P, k) for k in range(count)])
    for step in hand_equations.drawn(
        found.normal,
        found.factor,
        numbers[:, : n * each].reshape(-1, n, each),
        numbers[:, n * each :],
    ):
        yield whole_hand_problem.straightened(
            found.problem,
            whole_hand_problem.stepped(found.at, found.problem, step.turns, step.parameters),
        )
