"""What lasts for a while and nobody modelled makes parameters less sure, and is said; what is each sample's own does not."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import messages as self_calibration_messages
from handscope.estimators.self_calibration import (
    mounting_shift,
    normal_equations,
    residuals,
    solver,
)
from handscope.estimators.self_calibration.problem import Unknowns
from handscope.estimators.self_calibration.result import Finger
from handscope.estimators.self_calibration.solver import Solution
from handscope.estimators.self_calibration.uncertainty import sandwich_covariance
from handscope.estimators.self_calibration.whole_hand import normal_equations as hand_equations
from handscope.estimators.self_calibration.whole_hand import residuals as hand_residuals
from tests.estimators.self_calibration.whole_hand.test_normal_equations import _somewhere


def test_the_groups_together_pull_as_the_whole_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """With what was known before they are the gradient that leads to the step; three groups of two samples, two in memory at once."""
    monkeypatch.setattr(sandwich_covariance, "TOGETHER", 0.02)
    monkeypatch.setattr(sandwich_covariance, "GROUPS", 2)
    problem, at = _somewhere()
    factor = hand_equations.factorise(problem, at)
    pulls = sandwich_covariance.hand_pulls(problem, at, factor)
    before = np.zeros(factor.layout.count)
    off, sd = hand_residuals.hand_tissue_priors(problem, at)
    before[factor.layout.skin] = off / sd
    for k, (limb, place, cols) in enumerate(zip(problem.limbs, at.limbs, factor.layout.parameters)):
        r, slopes = hand_residuals.limb_priors(limb, place, shares=k == 0)
        before[cols[: slopes.shape[1]]] += slopes.T @ r
    assert len(pulls) == -(-len(problem) // 2)
    np.testing.assert_allclose(
        -factor.covariance @ (pulls.sum(axis=0) + before),
        hand_equations.solve_step(factor).parameters,
        rtol=1e-4,
        atol=1e-6,
    )


def test_a_limb_alone_is_pulled_as_the_whole_equations_say(solved: Solution) -> None:
    problem, at = solved.problem, _moved_a_little(solved)
    normal = solver.build_normal_equations(problem, at)[0]
    factor = normal_equations.factorise(normal)
    r, slopes = residuals.prior_residuals(problem, at)
    pulls = sandwich_covariance.limb_pulls(problem, at, factor)
    step = normal_equations.solve_step(normal, factor).parameters / np.sqrt(
        np.diag(factor.covariance)
    )
    np.testing.assert_allclose(
        -factor.covariance
        @ (pulls.sum(axis=0) + slopes.T @ r)
        / np.sqrt(np.diag(factor.covariance)),
        step,
        atol=1e-3,
    )
    assert len(pulls) == round(len(problem) * problem.dt / sandwich_covariance.TOGETHER)


def test_an_error_that_lasts_is_no_noise(solved: Solution) -> None:
    """A last phalanx' accelerometer is off by three times its noise: by chance in every sample, or the same for 0.3 s on end."""
    rng, n = np.random.default_rng(3), 600
    chance = rng.normal(size=n)
    lasting = np.convolve(rng.normal(size=n + 29), np.ones(30) / np.sqrt(30), "valid")
    sizes = [_size(solved, off) for off in (np.zeros(n), chance, lasting)]
    assert sizes[0] < 1.0, "as noise makes them, and less where what was known before holds"
    assert sizes[2] > 5 * sizes[1]


def test_the_covariance_grows_where_pulls_say_so_and_shrinks_nowhere() -> None:
    told, pulls = np.diag([1.0, 4.0, 9.0]), np.array([[3.0, 0.0, 0.0], [0.0, 0.1, 0.1]])
    found = sandwich_covariance.widen_covariance(told, pulls, np.eye(3))
    np.testing.assert_allclose(np.diag(found), [9.0, 4.0, 9.0], rtol=1e-12)
    assert np.linalg.eigvalsh(found - told).min() > -1e-12


def test_it_is_said_of_the_joint_where_it_is_worst(solved: Solution) -> None:
    finger = Finger("index", np.arange(len(solved.problem)) * solved.problem.dt, solved, None, None)  # type: ignore[arg-type]
    assert self_calibration_messages.describe_misfit(finger, 1, 0.9) == []
    (said,) = self_calibration_messages.describe_misfit(finger, 1, 4.0)
    assert solved.problem.chain.joints[1] in said and "2.0 times" in said


def _moved_a_little(found: Solution) -> Unknowns:
    return replace(found.at, bias_gyr=found.at.bias_gyr + 1e-4)


def _size(found: Solution, off: Array) -> float:
    """Of the first seconds, with an error (n,) added to what the last sensor's accelerometer reads along x."""
    n = len(off)
    part = mounting_shift._slice_problem(found.problem, 0, n)
    acc = part.acc.copy()
    acc[:, -1, 0] += 3 * part.noise.acc * off
    part = replace(part, acc=acc)
    at = replace(found.at, q_GS=found.at.q_GS[:n])
    factor = normal_equations.factorise(solver.build_normal_equations(part, at)[0])
    return float(
        sandwich_covariance.squared_pulls(
            sandwich_covariance.limb_pulls(part, at, factor), factor.covariance
        ).mean()
    )
