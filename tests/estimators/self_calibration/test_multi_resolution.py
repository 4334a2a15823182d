"""Every fourth sample of a problem, and the way back; accelerations averaged before."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.self_calibration import multi_resolution, residuals, solver
from handscope.estimators.self_calibration.solver import Limits, Solution

EVERY = 4


def test_all_samples_come_back_from_every_fourth_of_a_solution(solved: Solution) -> None:
    """Between them by the gyroscopes' turns less biases: within their noise of where they were."""
    found = multi_resolution.refine(
        solved.problem, multi_resolution.thin_unknowns(solved.at, EVERY), EVERY
    )
    off = quat.log(quat.relative(solved.at.q_GS, found.q_GS))
    kept = slice(0, len(off) // EVERY * EVERY, EVERY)
    np.testing.assert_allclose(off[kept], 0, atol=1e-12)
    assert np.degrees(np.linalg.norm(off, axis=2)).max() < 0.05


def test_turns_between_kept_samples_are_those_of_all_samples_between(solved: Solution) -> None:
    """At the minimum of all samples the thinned problem's gyroscopes fit, too."""
    thin = multi_resolution.thin_problem(solved.problem, EVERY)
    at = multi_resolution.thin_unknowns(solved.at, EVERY)
    r = residuals.gyroscope_terms(thin, at, 0, len(thin)).r
    assert len(at.q_GS) == len(thin) == len(r) + 1
    assert np.sqrt(np.mean(r**2)) < 1.2


def test_a_descent_that_begins_with_every_fourth_sample_ends_in_the_same_minimum(
    solved: Solution,
) -> None:
    base, start = solved.problem, replace(solved.at, near=solved.at.near * 1.05)
    limits = Limits(least_gain=1e-4)
    direct = solver.solve(base, start, limits)
    coarse = solver._solve_coarse(base, start, EVERY, limits, lambda k, cost: True)
    refined = solver.solve(base, multi_resolution.refine(base, coarse.at, EVERY), limits)
    sd = np.sqrt(np.diag(direct.factor.covariance))
    step = np.concatenate(
        [(refined.at.far - direct.at.far).ravel(), (refined.at.near - direct.at.near).ravel()]
    )
    assert np.abs(step / sd[: len(step)]).max() < 0.05


@pytest.mark.parametrize("every", [2, 3, 4])
def test_averaged_accelerations_are_those_of_the_middle_with_less_noise(
    solved: Solution, every: int
) -> None:
    """Ten kept samples in a period, as `map` keeps them: a mean alone would be 1.6 % too small."""
    rng, n = np.random.default_rng(4), len(solved.problem)
    wave = np.sin(2 * np.pi / (10 * every) * np.arange(n))[:, None, None]
    still = np.ones(solved.problem.acc_sd.shape)
    true = replace(solved.problem, acc=wave * np.ones_like(solved.problem.acc), acc_sd=still)
    noise = rng.normal(size=true.acc.shape)
    inner = slice(4 * every, n - 4 * every)
    found = multi_resolution.average_accelerations(true, every)
    np.testing.assert_allclose(found.acc[inner], true.acc[inner], atol=2e-3)
    noisy = multi_resolution.average_accelerations(replace(true, acc=noise), every)
    assert (noisy.acc_sd[inner] < 0.8).all()
    assert np.std(noisy.acc[inner]) < 1.3 * noisy.acc_sd[inner].mean()


def test_a_doubtful_sample_makes_the_mean_doubtful(solved: Solution) -> None:
    problem = replace(solved.problem, acc_sd=np.ones_like(solved.problem.acc_sd))
    problem.acc_sd[100, 1] = 1000.0
    found = multi_resolution.average_accelerations(problem, 3)
    np.testing.assert_array_equal(np.flatnonzero(found.acc_sd[:, 1] > 100.0), [99, 100, 101])


def test_no_rate_that_is_kept_is_below_the_one_that_is_asked_for() -> None:
    assert [multi_resolution.thinning(0.01, rate) for rate in (25.0, 30.0, 50.0, 60.0)] == [
        4,
        3,
        2,
        1,
    ]
    assert multi_resolution.thinning(0.04, 50.0) == 1
