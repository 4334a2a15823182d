"""Maximum a posteriori movement and parameters by the Levenberg-Marquardt method.

In      a Problem and where to begin
Out     Solution: the place of the minimum, how it was reached, the factor of its normal equations (posterior.py makes covariances of it)
Source  Kortier, thesis (4.7), (4.19); damping: Nielsen 1999, IMM-REP-1999-05; outliers of accelerometers and gyroscopes: weights of Huber's loss, by sensor and sample
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Generic, Literal, TypeVar

import numpy as np

from handscope.estimators.numerics.typing import Array, Bools
from handscope.estimators.self_calibration import (
    multi_resolution,
    normal_equations,
    outliers,
    residuals,
)
from handscope.estimators.self_calibration.normal_equations import Factor
from handscope.estimators.self_calibration.outliers import Outlier
from handscope.estimators.self_calibration.problem import (
    Problem,
    Unknowns,
    apply_increment,
    parameter_columns,
    with_flexion,
    with_noise,
)
from handscope.estimators.self_calibration.residuals import Terms
from handscope.estimators.self_calibration.uncertainty import parameter_covariance, posterior

CHUNK = 512  # samples whose derivatives are in memory at once
# steps; half a sum of squares, far below what a standard deviation of one parameter is
AROUND, CIRCLE = 4, 1.0
SMALL = 0.1  # of a standard deviation
SLOW = 0.3  # share of the previous decrease: a step with an old factor that gains more converges slowly
SETTLED = 100.0  # times the least gain: below that, an increase by less than the least gain is an oscillation about the minimum
FREE = 1e-6  # damping beyond which a step is no Newton step
UNLIKELY = 3.0  # standard deviations by which an estimate may differ from its prior until the prior is enlarged
Outcome = Literal["converged", "not converged", "stopped"]
P = TypeVar("P")
X = TypeVar("X")


@dataclass(frozen=True)
class Limits:
    """Limits of the iterations."""

    iterations: int = 30
    least_gain: float = 0.002  # least decrease of the cost to go on: all parameters are then within a tenth of their standard deviations
    rough_gain: float = 0.5  # the same in rounds before the last
    # of the cost: a step that gained less is followed by one with the same factor
    chord: float = 0.1
    rounds: int = 4  # in which the sizes of errors are estimated and impacts are found
    # beyond so many standard deviations a sample counts as if its noise were larger
    knock: float = 4.0


@dataclass(frozen=True)
class Solution:
    """The maximum a posteriori estimate, the course of the iteration, and the factor of the normal equations."""

    at: Unknowns
    problem: Problem  # with the estimated noise
    outcome: Outcome
    costs: tuple[float, ...]  # half the sum of squares at the start and after each step
    factor: Factor  # of the normal equations there
    outliers: tuple[Outlier, ...] = ()
    # (P, P) parameter_covariance.spurious_information
    spurious_information: Array = field(default_factory=lambda: np.empty((0, 0)))


@dataclass(frozen=True)
class Linearised(Generic[P, X]):
    """The normal equations at a place, as functions that give steps."""

    cost: float
    damped: Callable[
        [float], X
    ]  # the unknowns after a step with some damping; LinAlgError where the equations are singular
    # of other unknowns: their cost, and the unknowns after a step with the last factor of these; None where that is no cheaper
    chord: Callable[[P, X], tuple[float, X]] | None = None


@dataclass(frozen=True)
class ProblemOps(Generic[P, X]):
    """Operations of a kind of problem P with unknowns X, for `levenberg_marquardt`."""

    # the problem with the flexion of joints at these unknowns
    update_flexion: Callable[[P, X], P]
    cost: Callable[[P, X], float]
    linearise: Callable[[P, X], Linearised[P, X]]


@dataclass(frozen=True)
class DescentResult(Generic[P, X]):
    """The end of the iteration."""

    problem: P
    at: X
    outcome: Outcome
    costs: tuple[float, ...]


def solve(
    problem: Problem,
    start: Unknowns,
    limits: Limits = Limits(),
    go_on: Callable[[int, float], bool] = lambda k, cost: True,
    spare: Factor | None = None,
) -> Solution:
    """Minimise the cost from `start`; `go_on` (iteration, cost) is called after every step and stops by returning False. Reuses the memory of `spare` where sizes agree."""
    last = [spare] if spare is not None else []
    result = levenberg_marquardt(_operations(last), problem, start, limits, go_on)
    normal, _ = build_normal_equations(result.problem, result.at, last[0] if last else None)
    return Solution(
        result.at,
        result.problem,
        result.outcome,
        result.costs,
        normal_equations.factorise_in_place(normal),
    )


def _operations(last: list[Factor]) -> ProblemOps[Problem, Unknowns]:
    """Operations of a chain; all use the memory of one factor, the last, which the list holds."""

    def linearise(problem: Problem, at: Unknowns) -> Linearised[Problem, Unknowns]:
        normal, here = build_normal_equations(problem, at, last[0] if last else None)
        whole = [normal]  # until it is factored

        def damped(damping: float) -> Unknowns:
            own = whole.pop() if whole else build_normal_equations(problem, at, last[0])[0]
            last[:] = [Factor(own.A, own.B, own.C)]
            last[:] = [normal_equations.factorise_in_place(own, damping)]
            return _apply_step(problem, at, normal_equations.solve_step(own, last[0]))

        def chord(other: Problem, there: Unknowns) -> tuple[float, Unknowns]:
            gradient, cost_there = normal_equations.with_gradient(
                normal, _terms(other, there), residuals.prior_residuals(other, there)
            )
            return cost_there, _apply_step(
                other, there, normal_equations.solve_step(gradient, last[0])
            )

        return Linearised(here, damped, chord)

    return ProblemOps(with_flexion, cost, linearise)


def _apply_step(problem: Problem, at: Unknowns, step: normal_equations.Step) -> Unknowns:
    return apply_increment(
        at, problem.chain, step.turns.reshape(len(problem), -1, 3), step.parameters
    )


def levenberg_marquardt(
    ops: ProblemOps[P, X], problem: P, start: X, limits: Limits, go_on: Callable[[int, float], bool]
) -> DescentResult[P, X]:
    """Minimise the cost of any kind of problem by the Levenberg-Marquardt method; near the minimum several steps share a factor."""
    at, damping, growth, renewing, gain = start, 1e-9, 2.0, True, np.inf
    costs: list[float] = [ops.cost(problem, at)]
    known: Linearised[P, X] | None = None  # of an earlier place, near enough for another step
    outcome: Outcome = "not converged"
    for k in range(limits.iterations):
        if renewing:
            problem = ops.update_flexion(problem, at)
        if known is not None and known.chord is not None:
            costs[-1], there = known.chord(problem, at)
            reached = ops.cost(problem, there)
            if gain < SETTLED * limits.least_gain and abs(reached - costs[-1]) < limits.least_gain:
                outcome = "converged"
                break
            if not reached < costs[-1]:
                known = None
        is_chord = known is not None
        if known is None:
            known = ops.linearise(problem, at)
            costs[-1] = known.cost
        if (
            renewing and k >= AROUND and costs[-1] > costs[-1 - AROUND] - limits.least_gain
        ):  # the iteration oscillates
            if max(costs[-1 - AROUND :]) - min(costs[-1 - AROUND :]) < CIRCLE:
                outcome = "converged"
                break
            renewing = False  # the flexion stays fixed from here: that of a stiff joint is as unobservable as the places of its bones
        while not is_chord:
            try:
                there = known.damped(damping)
                reached = ops.cost(problem, there)
            except np.linalg.LinAlgError:
                reached = np.inf
            is_settled = (
                gain < SETTLED * limits.least_gain and reached - costs[-1] < limits.least_gain
            )
            if reached < costs[-1] or is_settled or damping > 1e8:
                break
            damping, growth = damping * growth, growth * 2
        if not reached < costs[-1]:
            outcome = "converged" if k else "not converged"
            break
        gain, before = costs[-1] - reached, gain
        at, growth = there, 2.0
        costs.append(reached)
        is_slow = is_chord and gain > SLOW * before
        if gain < limits.least_gain * (SLOW if is_slow else 1.0):
            outcome = "converged"
            break
        if known.chord is None or is_slow or damping > FREE or gain > limits.chord * reached:
            known = None
        damping *= 0.1
        if not go_on(k + 1, reached):
            outcome = "stopped"
            break
    return DescentResult(problem, at, outcome, tuple(costs))


def solve_with_noise(
    problem: Problem,
    start: Unknowns,
    limits: Limits = Limits(),
    go_on: Callable[[int, float], bool] = lambda k, cost: True,
    free: Bools | None = None,
) -> Solution:
    """Solve in rounds: after each the sizes of errors are estimated anew, and outliers get less weight.

    `free` (n,): samples of free movement, all where not given. In the first round skin follows in proportion: impacts that are not detected yet would bias its non-linearity.
    """
    rough = replace(limits, least_gain=limits.rough_gain)
    base = problem
    free = np.ones(len(base), bool) if free is None else free
    strange = outliers.detect_outliers(
        outliers.none_detected(len(base)),
        posterior.acceleration_deviations(base, start),
        outliers.GROSS,
        base.dt,
        free,
    )
    lawful = replace(base.noise, skin_law=posterior.LEAST_LAW)
    initial = replace(
        with_noise(base, lawful, strange.doubt),
        turn_sd=base.turn_sd * np.where(strange.suspect, outliers.OPENED, 1.0)[:, None],
    )
    steps = 0
    every = multi_resolution.thinning(base.dt, multi_resolution.COARSE)
    is_long = len(base) * base.dt >= multi_resolution.LEAST
    if every > 1 and is_long and not strange.suspect.any():
        coarse = _solve_coarse(initial, start, every, rough, go_on)
        if coarse.outcome == "stopped":
            return replace(solve(initial, start, replace(limits, iterations=0)), outcome="stopped")
        if coarse.outcome == "converged":
            start, steps = multi_resolution.refine(initial, coarse.at, every), len(coarse.costs) - 1
    solution = _check_convergence(solve(initial, start, rough, _after(steps, go_on)))
    for left in range(limits.rounds - 2, -1, -1):
        if solution.outcome != "converged":
            break
        steps += len(solution.costs) - 1
        strange = outliers.detect_outliers(
            strange,
            posterior.acceleration_deviations(solution.problem, solution.at),
            limits.knock,
            base.dt,
            free,
        )
        turns = base.turn_sd * outliers.turn_noise_factors(strange, base, solution.at, limits.knock)
        less = with_noise(solution.problem, solution.problem.noise, strange.doubt)
        reset = replace(less, turn_sd=turns, mounting_sd=base.mounting_sd, length_sd=base.length_sd)
        doubted = reweight_priors(reset, solution.at)
        noise = posterior.estimate_noise(doubted, solution.at, solution.factor)
        if doubted.noise is lawful:
            noise = replace(noise, skin_law=base.noise.skin_law)
        solution = _check_convergence(
            solve(
                with_noise(doubted, noise),
                solution.at,
                rough if left else limits,
                _after(steps, go_on),
                solution.factor,
            )
        )
    off = posterior.acceleration_deviations(with_noise(base, solution.problem.noise), solution.at)
    spurious = parameter_covariance.spurious_information(
        solution.problem, solution.at, solution.factor
    )
    return replace(
        solution,
        factor=parameter_covariance.correct_covariance(
            solution.problem, solution.at, solution.factor, spurious
        ),
        spurious_information=spurious,
        outliers=outliers.list_outliers(strange, base, solution.at, off, free),
    )


def _solve_coarse(
    problem: Problem,
    start: Unknowns,
    every: int,
    limits: Limits,
    go_on: Callable[[int, float], bool],
) -> DescentResult[Problem, Unknowns]:
    """The minimum for every k-th sample: near that of all samples, in a fraction of the time."""
    return levenberg_marquardt(
        _operations([]),
        multi_resolution.thin_problem(problem, every),
        multi_resolution.thin_unknowns(start, every),
        limits,
        go_on,
    )


def _after(steps: int, go_on: Callable[[int, float], bool]) -> Callable[[int, float], bool]:
    """`go_on` with the iteration counted from `steps` on."""
    return lambda k, cost: go_on(steps + k, cost)


def _check_convergence(solution: Solution) -> Solution:
    """Set the outcome to converged where the next step is small against each parameter's standard deviation, also along unobservable directions."""
    if solution.outcome != "not converged":
        return solution
    spurious = parameter_covariance.spurious_information(
        solution.problem, solution.at, solution.factor
    )
    sure = parameter_covariance.correct_covariance(
        solution.problem, solution.at, solution.factor, spurious
    ).covariance
    step = normal_equations.solve_step(_gradient(solution), solution.factor).parameters
    return replace(
        solution,
        outcome="converged"
        if (np.abs(step) < SMALL * np.sqrt(np.diag(sure))).all()
        else solution.outcome,
    )


def _gradient(solution: Solution) -> normal_equations.Normal:
    """The normal equations with the gradient there, for a step with the factor that is known."""
    L, Y, covariance = solution.factor.L, solution.factor.Y, solution.factor.covariance
    blank = normal_equations.Normal(L, Y, covariance, np.zeros(Y.shape[:2]), np.zeros(Y.shape[2]))
    priors = residuals.prior_residuals(solution.problem, solution.at)
    return normal_equations.with_gradient(blank, _terms(solution.problem, solution.at), priors)[0]


def reweight_priors(problem: Problem, at: Unknowns) -> Problem:
    """Enlarge the standard deviation of each prior that the estimate contradicts significantly."""
    mounting_sd, length_sd = problem.mounting_sd.copy(), problem.length_sd.copy()
    for priors, sds in (
        (residuals.mounting_priors(problem, at), mounting_sd),
        (residuals.length_priors(problem, at), length_sd),
    ):
        for known in priors:
            off = float(np.linalg.norm(known.off))
            if off > UNLIKELY * known.sd:
                sds[known.sensor] = max(sds[known.sensor], off)
    return replace(problem, mounting_sd=mounting_sd, length_sd=length_sd)


def cost(problem: Problem, at: Unknowns) -> float:
    """Half the sum of the squared residuals (4.19)."""
    total = 0.5 * float((residuals.prior_residuals(problem, at)[0] ** 2).sum())
    for start in range(0, len(problem), CHUNK):
        for kind in residuals.EVERY_SAMPLE:
            r = residuals.residuals_alone(kind)(problem, at, start, start + CHUNK)
            total += 0.5 * float((r**2).sum())
    return total


def build_normal_equations(
    problem: Problem, at: Unknowns, spare: Factor | None = None
) -> tuple[normal_equations.Normal, float]:
    """The normal equations at a place, and its cost; in the memory of `spare`, if it is of that size."""
    each, count = 3 * len(problem.chain.sensors), parameter_columns(problem.chain).count
    normal = normal_equations.empty(len(problem), each, count, spare)
    priors = residuals.prior_residuals(problem, at)
    return normal, normal_equations.add_everything(normal, _terms(problem, at), priors)


def _terms(problem: Problem, at: Unknowns) -> Iterator[Terms]:
    for start in range(0, len(problem), CHUNK):
        for kind in residuals.EVERY_SAMPLE:
            yield kind(problem, at, start, start + CHUNK)
