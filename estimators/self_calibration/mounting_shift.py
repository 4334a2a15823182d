"""Detection of a sensor that moved on its segment: each half of the stretch is solved alone.

In      a Solution of the whole stretch, its Readings
Out     sensors whose joints lie elsewhere, or whose hinges point elsewhere, in the second half than in the first
Source  ours: a test for a structural break (Chow 1960, Econometrica 28): difference of the estimates of both halves in its standard deviations
Limits  smaller shifts than SHIFTED and TILTED are not reported; skin that moves with the joint is no shift
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import initialisation as self_calibration_initialisation
from handscope.estimators.self_calibration import normal_equations, solver
from handscope.estimators.self_calibration.problem import (
    Noise,
    Problem,
    Readings,
    Unknowns,
    build_problem,
    parameter_columns,
)
from handscope.estimators.self_calibration.solver import Limits, Solution
from handscope.estimators.self_calibration.uncertainty import parameter_covariance

SHIFTED, TILTED = 3e-3, 3.0  # m, deg
SURE = 3.0  # standard deviations
STEPS = Limits(iterations=3, least_gain=10.0)  # each half begins close to its minimum
FROM_SCRATCH = Limits(iterations=20, least_gain=0.5)  # where the whole has no minimum


@dataclass(frozen=True)
class MountingShift:
    """A sensor whose mounting differs in the second half."""

    sensor: str
    shift: float  # m, of a joint's centre in the sensor's frame
    tilt: float  # rad, of a hinge


def find_mounting_shifts(solution: Solution, read: Readings) -> list[MountingShift]:
    """The shifts, the most significant first; none where neither the whole nor each half converged."""
    n, whole = len(solution.problem), solution.outcome == "converged"
    spans = ((0, n // 2), (n // 2, n))
    halves = [
        _solve_half(solution, *span)
        if whole
        else _solve_from_scratch(solution.problem, read, *(k * len(read) // n for k in span))
        for span in spans
    ]
    if not whole and any(half.outcome != "converged" for half in halves):
        return []
    ranked = []
    for s, name in enumerate(solution.problem.chain.sensors):
        shifts, tilts = (
            _joint_shifts(solution.problem, halves, s),
            _hinge_tilts(solution.problem, halves, s),
        )
        sure = [size / sd for size, sd in shifts if size > SHIFTED] + [
            size / sd for size, sd in tilts if size > np.radians(TILTED)
        ]
        if max(sure, default=0.0) > SURE:
            ranked.append(
                (
                    max(sure),
                    MountingShift(
                        name,
                        max(size for size, _ in shifts),
                        max((size for size, _ in tilts), default=0.0),
                    ),
                )
            )
    return [slip for _, slip in sorted(ranked, key=lambda t: -t[0])]


def _solve_half(solution: Solution, first: int, stop: int) -> Solution:
    q_GS = solution.at.q_GS[first:stop]
    # the heading is unobservable: it begins as in the whole at this sample
    part = replace(_slice_problem(solution.problem, first, stop), start=q_GS[0])
    return _solve_with_covariance(part, replace(solution.at, q_GS=q_GS), STEPS)


def _solve_from_scratch(whole: Problem, read: Readings, first: int, stop: int) -> Solution:
    """From the initial guess, with the prior sizes of errors: the estimate of a whole without a minimum is no start for its halves."""
    own = Readings(
        read.dt, *(v[first:stop] for v in (read.gyr, read.acc, read.gyr_doubt, read.acc_doubt))
    )
    guess = self_calibration_initialisation.initial_unknowns(
        whole.chain, Noise(), own, whole.flexing
    )
    # what depends on hand and mounting is known already
    part = build_problem(whole.chain, Noise(), own, guess.q_GS[0], "left", {})
    return _solve_with_covariance(
        replace(part, distal=whole.distal, flexing=whole.flexing, length=whole.length),
        guess,
        FROM_SCRATCH,
    )


def _solve_with_covariance(part: Problem, start: Unknowns, limits: Limits) -> Solution:
    half = solver.solve(part, start, limits)
    spurious = parameter_covariance.spurious_information(half.problem, half.at, half.factor)
    sure = parameter_covariance.correct_covariance(half.problem, half.at, half.factor, spurious)
    return replace(half, factor=normal_equations.keep_covariance_only(sure.covariance))


def _joint_shifts(
    problem: Problem, halves: Sequence[Solution], s: int
) -> list[tuple[float, float]]:
    """Shift of each joint of a sensor and its standard deviation, m."""
    chain, c, (at, later) = problem.chain, parameter_columns(problem.chain), (h.at for h in halves)
    found = []
    for joints, where, off in (
        (chain.children, c.near, later.near - at.near),
        (chain.parents, c.far, later.far - at.far),
    ):
        sd = _sd(halves, where).reshape(-1, 3)
        found += [
            (float(np.linalg.norm(off[k])), float(np.linalg.norm(sd[k])))
            for k in np.flatnonzero(joints == s)
        ]
    return found


def _hinge_tilts(problem: Problem, halves: Sequence[Solution], s: int) -> list[tuple[float, float]]:
    """Tilt of each hinge of a sensor, whatever its sign, and its standard deviation, rad."""
    chain, c, (at, later) = problem.chain, parameter_columns(problem.chain), (h.at for h in halves)
    found = []
    for joints, where, first, second in (
        (chain.children, c.axis_near, at.axis_near, later.axis_near),
        (chain.parents, c.axis_far, at.axis_far, later.axis_far),
    ):
        sd = _sd(halves, where).reshape(-1, 2)
        for h in np.flatnonzero(joints[chain.hinges] == s):
            found.append(
                (
                    float(np.arccos(min(abs(first[h] @ second[h]), 1.0))),
                    float(np.linalg.norm(sd[h])),
                )
            )
    return found


def _sd(halves: Sequence[Solution], where: slice) -> Array:
    return np.asarray(
        np.sqrt(np.sum([np.diag(h.factor.covariance)[where] for h in halves], axis=0))
    )


def _slice_problem(problem: Problem, start: int, stop: int) -> Problem:
    return replace(
        problem,
        turns=problem.turns[start : stop - 1],
        later=problem.later[start : stop - 1],
        acc=problem.acc[start:stop],
        turn_sd=problem.turn_sd[start : stop - 1],
        acc_sd=problem.acc_sd[start:stop],
        bent=problem.bent[start:stop],
        by_tilt=problem.by_tilt[start:stop],
    )
