"""What is told of a parameter is as sure as movement makes it, and no surer: noise is no information, and biases walk."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.self_calibration import solver
from handscope.estimators.self_calibration.problem import parameter_columns
from handscope.estimators.self_calibration.solver import Solution
from handscope.estimators.self_calibration.uncertainty import parameter_covariance
from handscope.estimators.simulation.artificial_finger import DISTANCES, HINGES
from tests.estimators.self_calibration.fingers import cold, distances, lengths, stiffened

TURNS = tuple(f"forearm_{angle}" for angle in ("flexion", "deviation", "pronation"))


def test_what_noise_makes_up_is_taken_off() -> None:
    """Two arms of 0.1 m, before known within 0.1 m: noise alone tells of the first, movement alone of the second."""
    before, made_up, moved = 100.0 * np.eye(2), np.diag([1e5, 0.0]), np.diag([0.0, 1e6])
    told = parameter_covariance.without_noise(
        np.linalg.inv(before + made_up + moved), made_up, before, np.diag([0.1, 0.1])
    )
    sd = np.sqrt(np.diag(told))
    assert sd[0] == pytest.approx(
        np.hypot(0.1, 0.025), rel=1e-2
    )  # as before, and a quarter of its length by which noise may have pulled it
    assert sd[1] == pytest.approx(1e-3, rel=1e-3)


def test_a_finger_that_moves_well_is_as_sure_as_it_was(solved: Solution) -> None:
    """Noise makes up less than a hundredth of what the movement tells of its arms."""
    c, made_up = (
        parameter_columns(solved.problem.chain),
        parameter_covariance.spurious_information(solved.problem, solved.at, solved.factor),
    )
    told = np.linalg.inv(solved.factor.covariance)
    arms = np.arange(c.near.stop)
    assert (np.diag(made_up)[arms] < 0.01 * np.diag(told)[arms]).all()
    assert np.abs(made_up[c.near.stop :]).max() == 0.0


@pytest.mark.slow
def test_where_the_knuckle_is_from_a_hand_that_only_travels_is_not_claimed() -> None:
    """An arm of 75 mm, off by centimetres; before its standard deviation was 4 mm. The lengths are told as well as ever."""
    found = solver.solve_with_noise(*cold(stiffened(3, 9.0, dict.fromkeys(TURNS, 0.0))))
    c, sd = parameter_columns(found.problem.chain), np.sqrt(np.diag(found.factor.covariance))
    assert np.linalg.norm(sd[c.far][:2]) > 0.03
    assert abs(distances(found.at)[0] - DISTANCES[0]) < 3 * np.linalg.norm(sd[c.far][:2])
    assert found.outcome == "converged"
    np.testing.assert_allclose(lengths(found.at), HINGES, rtol=0.02)


def test_the_bias_at_the_beginning_is_less_sure_where_it_walks(solved: Solution) -> None:
    """16 s of 0.003 deg/s/sqrt(s): 0.003 sqrt(16 / 3) deg/s."""
    walking = replace(solved.problem, noise=replace(solved.problem.noise, gyr_bias_walk=0.003))
    c, found = parameter_columns(walking.chain), parameter_covariance.bias_walk_variance(walking)
    np.testing.assert_allclose(np.sqrt(found[c.bias_gyr]), np.radians(0.006928), rtol=1e-3)
    assert np.delete(found, np.arange(c.bias_gyr.start, c.bias_gyr.stop)).max() == 0.0
