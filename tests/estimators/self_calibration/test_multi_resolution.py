"""Every fourth sample of a problem, and the way back."""

from dataclasses import replace

import numpy as np

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.self_calibration import multi_resolution, residuals, solver
from handscope.estimators.self_calibration.solver import Limits, Solution


def test_all_samples_come_back_from_every_fourth_of_a_solution(solved: Solution) -> None:
    """Between them by the gyroscopes' turns less biases: within their noise of where they were."""
    found = multi_resolution.refine(solved.problem, multi_resolution.thin_unknowns(solved.at))
    off = quat.log(quat.relative(solved.at.q_GS, found.q_GS))
    kept = slice(
        0, len(off) // multi_resolution.EVERY * multi_resolution.EVERY, multi_resolution.EVERY
    )
    np.testing.assert_allclose(off[kept], 0, atol=1e-12)
    assert np.degrees(np.linalg.norm(off, axis=2)).max() < 0.05


def test_turns_between_kept_samples_are_those_of_all_samples_between(solved: Solution) -> None:
    """At the minimum of all samples the thinned problem's gyroscopes fit, too."""
    thin = multi_resolution.thin_problem(solved.problem)
    at = multi_resolution.thin_unknowns(solved.at)
    r = residuals.gyroscope_terms(thin, at, 0, len(thin)).r
    assert len(at.q_GS) == len(thin) == len(r) + 1
    assert np.sqrt(np.mean(r**2)) < 1.2


def test_a_descent_that_begins_with_every_fourth_sample_ends_in_the_same_minimum(
    solved: Solution,
) -> None:
    base, start = solved.problem, replace(solved.at, near=solved.at.near * 1.05)
    limits = Limits(least_gain=1e-4)
    direct = solver.solve(base, start, limits)
    coarse = solver._solve_every_fourth(base, start, limits, lambda k, cost: True)
    refined = solver.solve(base, multi_resolution.refine(base, coarse.at), limits)
    sd = np.sqrt(np.diag(direct.factor.covariance))
    step = np.concatenate(
        [(refined.at.far - direct.at.far).ravel(), (refined.at.near - direct.at.near).ravel()]
    )
    assert np.abs(step / sd[: len(step)]).max() < 0.05
