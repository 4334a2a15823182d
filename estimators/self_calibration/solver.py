"""Levenberg's and Marquardt's way down to the most probable movement and parameters.

In      a Problem and where to begin
Out     Solution: the place of the minimum, how it was reached, the factor of its normal equations (posterior.py makes covariances of it)
Source  Kortier, thesis (4.7), (4.19); damping: Nielsen 1999, IMM-REP-1999-05; outliers of accelerometers and gyroscopes: weights of Huber's loss, by sensor and sample
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Generic, Literal, TypeVar

import numpy as np

from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import normal_equations, outliers, residuals
from handscope.estimators.self_calibration.normal_equations import Factor
from handscope.estimators.self_calibration.outliers import Jolt
from handscope.estimators.self_calibration.problem import (
    Problem,
    Unknowns,
    bent,
    columns,
    moved,
    resized,
)
from handscope.estimators.self_calibration.uncertainty import parameter_covariance, posterior

CHUNK = 512  # samples whose derivatives are in memory at once
AROUND, CIRCLE = (
    4,
    1.0,
)  # steps; half a sum of squares, far below what a standard deviation of one parameter is
SMALL = 0.1  # of a standard deviation
UNLIKELY = 3.0  # standard deviations that what was known before may be off until it is doubted
Outcome = Literal["converged", "not converged", "stopped"]
P = TypeVar("P")
X = TypeVar("X")


@dataclass(frozen=True)
class Limits:
    iterations: int = 30
    least_gain: float = 0.002  # of half the sum of squares, that a step must gain to go on: then all are within a tenth of their standard deviations
    rough_gain: float = 0.5  # the same in rounds before the last
    rounds: int = 4  # in which the sizes of errors are learnt and knocks are found
    knock: float = (
        4.0  # beyond so many standard deviations a sample counts as if its noise were larger
    )


@dataclass(frozen=True)
class Solution:
    at: Unknowns
    problem: Problem  # with the noise as it was found to be
    outcome: Outcome
    costs: tuple[float, ...]  # half the sum of squares at the start and after each step
    factor: Factor  # of the normal equations there
    jolts: tuple[Jolt, ...] = ()
    made_up: Array = field(
        default_factory=lambda: np.empty((0, 0))
    )  # (P, P) information that noise makes up, covariance.apparent


@dataclass(frozen=True)
class Ground(Generic[P, X]):
    """What the way down must know of a kind of problem P and of its places X."""

    renewed: Callable[
        [P, X], P
    ]  # the problem with what it believes of joints' bending as it is here
    cost: Callable[[P, X], float]
    sloped: Callable[
        [P, X], tuple[float, Callable[[float], X]]
    ]  # cost, and where a step of some damping leads; LinAlgError where nowhere


@dataclass(frozen=True)
class Way(Generic[P, X]):
    """How far down it went."""

    problem: P
    at: X
    outcome: Outcome
    costs: tuple[float, ...]


def solve(
    problem: Problem,
    start: Unknowns,
    limits: Limits = Limits(),
    go_on: Callable[[int, float], bool] = lambda k, cost: True,
) -> Solution:
    """Go down from `start`; `go_on` hears iteration and cost after every step and stops it by saying no."""
    way = down(Ground(bent, cost, _sloped), problem, start, limits, go_on)
    return Solution(
        way.at,
        way.problem,
        way.outcome,
        way.costs,
        normal_equations.factored(built(way.problem, way.at)[0]),
    )


def _sloped(problem: Problem, at: Unknowns) -> tuple[float, Callable[[float], Unknowns]]:
    normal, here = built(problem, at)

    def stepped(damping: float) -> Unknowns:
        step = normal_equations.step(normal, normal_equations.factored(normal, damping))
        return moved(at, problem.chain, step.turns.reshape(len(problem), -1, 3), step.parameters)

    return here, stepped


def down(
    ground: Ground[P, X], problem: P, start: X, limits: Limits, go_on: Callable[[int, float], bool]
) -> Way[P, X]:
    """Step by step to the minimum, of any kind of problem."""
    at, damping, growth, renewing = start, 1e-9, 2.0, True
    costs: list[float] = [ground.cost(problem, at)]
    outcome: Outcome = "not converged"
    for k in range(limits.iterations):
        if renewing:
            problem = ground.renewed(problem, at)
        costs[-1], stepped = ground.sloped(problem, at)
        if (
            renewing and k >= AROUND and costs[-1] > costs[-1 - AROUND] - limits.least_gain
        ):  # what is left goes round in circles
            if max(costs[-1 - AROUND :]) - min(costs[-1 - AROUND :]) < CIRCLE:
                outcome = "converged"
                break
            renewing = False  # from here with joints flexed as they are: how a stiff one is flexed is as little told as where its bones lie
        while True:
            try:
                there = stepped(damping)
                reached = ground.cost(problem, there)
            except np.linalg.LinAlgError:
                reached = np.inf
            if reached < costs[-1] or damping > 1e8:
                break
            damping, growth = damping * growth, growth * 2
        if not reached < costs[-1]:
            outcome = "converged" if k else "not converged"
            break
        gain = costs[-1] - reached
        at, damping, growth = there, damping * 0.1, 2.0
        costs.append(reached)
        if gain < limits.least_gain:
            outcome = "converged"
            break
        if not go_on(k + 1, reached):
            outcome = "stopped"
            break
    return Way(problem, at, outcome, tuple(costs))


def learnt(
    problem: Problem,
    start: Unknowns,
    limits: Limits = Limits(),
    go_on: Callable[[int, float], bool] = lambda k, cost: True,
) -> Solution:
    """The same in rounds: after each the sizes of errors are what they were met as, and samples that fit nowhere are trusted less.

    In the first skin follows in proportion: knocks that are not known yet would be taken for its law.
    """
    rough = replace(limits, least_gain=limits.rough_gain)
    base = problem
    strange = outliers.looked(
        outliers.none(len(base)), posterior.strange(base, start), outliers.GROSS, base.dt
    )
    lawful = replace(base.noise, skin_law=posterior.LEAST_LAW)
    begun = replace(
        resized(base, lawful, strange.doubt),
        turn_sd=base.turn_sd * np.where(strange.knocked, outliers.OPENED, 1.0)[:, None],
    )
    found, steps = _settled(solve(begun, start, rough, go_on)), 0
    for left in range(limits.rounds - 2, -1, -1):
        if found.outcome != "converged":
            break
        steps += len(found.costs) - 1
        strange = outliers.looked(
            strange, posterior.strange(found.problem, found.at), limits.knock, base.dt
        )
        turns = base.turn_sd * outliers.turn_doubt(strange, base, found.at, limits.knock)
        less = resized(found.problem, found.problem.noise, strange.doubt)
        told = replace(less, turn_sd=turns, seat_sd=base.seat_sd, length_sd=base.length_sd)
        doubted = doubting(told, found.at)
        noise = posterior.learnt(doubted, found.at, found.factor)
        if doubted.noise is lawful:
            noise = replace(noise, skin_law=base.noise.skin_law)
        found = _settled(
            solve(
                resized(doubted, noise),
                found.at,
                rough if left else limits,
                lambda k, c, before=steps: go_on(before + k, c),  # type: ignore[misc]
            )
        )
    off = posterior.strange(resized(base, found.problem.noise), found.at)
    made_up = parameter_covariance.apparent(found.problem, found.at, found.factor)
    return replace(
        found,
        factor=parameter_covariance.honest(found.problem, found.at, found.factor, made_up),
        made_up=made_up,
        jolts=outliers.jolts(strange, base, found.at, off),
    )


def _settled(found: Solution) -> Solution:
    """Converged also where the way leads on in directions that no movement tells: the next step is small against what is known of each parameter."""
    if found.outcome != "not converged":
        return found
    made_up = parameter_covariance.apparent(found.problem, found.at, found.factor)
    sure = parameter_covariance.honest(found.problem, found.at, found.factor, made_up).covariance
    step = normal_equations.step(built(found.problem, found.at)[0], found.factor).parameters
    return replace(
        found,
        outcome="converged"
        if (np.abs(step) < SMALL * np.sqrt(np.diag(sure))).all()
        else found.outcome,
    )


def doubting(problem: Problem, at: Unknowns) -> Problem:
    """The problem with what was known before counting as uncertain as it was found to be off, where that is more than chance makes it."""
    seat_sd, length_sd = problem.seat_sd.copy(), problem.length_sd.copy()
    for told, sds in (
        (residuals.seating(problem, at), seat_sd),
        (residuals.sizing(problem, at), length_sd),
    ):
        for known in told:
            off = float(np.linalg.norm(known.off))
            if off > UNLIKELY * known.sd:
                sds[known.sensor] = max(sds[known.sensor], off)
    return replace(problem, seat_sd=seat_sd, length_sd=length_sd)


def cost(problem: Problem, at: Unknowns) -> float:
    """Half the sum of the squared residuals (4.19)."""
    total = 0.5 * float((residuals.priors(problem, at)[0] ** 2).sum())
    for start in range(0, len(problem), CHUNK):
        for kind in residuals.EVERY_SAMPLE:
            alone = kind is residuals.meeting  # most of the work is in its derivatives
            r = (
                residuals.met(problem, at, start, start + CHUNK)
                if alone
                else kind(problem, at, start, start + CHUNK).r
            )
            total += 0.5 * float((r**2).sum())
    return total


def built(problem: Problem, at: Unknowns) -> tuple[normal_equations.Normal, float]:
    """The normal equations at a place, and its cost."""
    each = 3 * len(problem.chain.sensors)
    normal = normal_equations.empty(len(problem), each, columns(problem.chain).count)
    r, K = residuals.priors(problem, at)
    total = 0.5 * float((r**2).sum())
    for start in range(0, len(problem), CHUNK):
        for kind in residuals.EVERY_SAMPLE:
            terms = kind(problem, at, start, start + CHUNK)
            normal_equations.add(normal, terms)
            total += 0.5 * float((terms.r**2).sum())
    normal.C[...] += K.T @ K
    normal.c[...] += K.T @ r
    return normal, total
