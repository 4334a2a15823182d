"""Errors whose size is known beforehand."""

import numpy as np
import pytest

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import FINGERS, IS_DOF, JOINT, JOINTS, SEGMENTS
from handscope.estimators.numerics import quaternions as quat
from handscope.validation.reproduce.accuracy import (
    angle_errors,
    distance_rmse,
    orientation_error,
    rms,
    tip_rmse,
)

N = 50
DEG = np.pi / 180
RNG = np.random.default_rng(3)


def some_trajectory() -> Trajectory:
    angles = np.where(IS_DOF, RNG.uniform(-1, 1, (N, len(JOINTS), 3)), np.nan)
    tips = RNG.normal(size=(N, len(FINGERS), 3))
    return Trajectory(
        "left",
        np.arange(N) / 100,
        angles,
        np.tile(quat.IDENTITY, (N, len(SEGMENTS), 1)),
        tips,
        np.zeros((N, 17), np.uint8),
    )


def changed(
    truth: Trajectory, angles: float = 0.0, tips: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Trajectory:
    return Trajectory(
        "left", truth.t, truth.angles + angles, truth.q_GS, truth.tips + np.array(tips), truth.flags
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_constant_heading_error_of_ten_degrees_is_ten_of_heading_and_none_of_inclination(
    sign: float,
) -> None:
    q_ref = quat.normalize(RNG.normal(size=(N, 4)))
    error = orientation_error(sign * quat.multiply(quat.about(2, 10 * DEG), q_ref), q_ref)
    np.testing.assert_allclose(error.heading, 10 * DEG, atol=1e-9)
    np.testing.assert_allclose(error.inclination, 0.0, atol=1e-7)
    np.testing.assert_allclose(error.total, 10 * DEG, atol=1e-9)


def test_a_tilt_is_inclination_and_no_heading() -> None:
    q_ref = quat.normalize(RNG.normal(size=(N, 4)))
    error = orientation_error(quat.multiply(quat.about(0, 4 * DEG), q_ref), q_ref)
    np.testing.assert_allclose(error.heading, 0.0, atol=1e-9)
    np.testing.assert_allclose(error.inclination, 4 * DEG, atol=1e-9)


def test_heading_and_inclination_make_up_the_total_as_the_data_set_says() -> None:
    q_e = quat.normalize(RNG.normal(size=(N, 4)))
    error = orientation_error(q_e, np.tile(quat.IDENTITY, (N, 1)))
    w, _, _, z = q_e.T
    np.testing.assert_allclose(error.total, 2 * np.arccos(np.abs(w)), atol=1e-9)
    np.testing.assert_allclose(np.abs(error.heading), np.abs(2 * np.arctan(z / w)), atol=1e-9)
    np.testing.assert_allclose(error.inclination, 2 * np.arccos(np.sqrt(w**2 + z**2)), atol=1e-9)


def test_a_tip_that_is_off_by_three_and_four_millimetres_is_off_by_five() -> None:
    truth = some_trajectory()
    assert tip_rmse(changed(truth, tips=(3e-3, 0.0, -4e-3)), truth, ["index"]) == pytest.approx(
        5e-3, abs=1e-12
    )


def test_a_whole_turn_is_no_error_of_an_angle_and_only_freedoms_count() -> None:
    truth = some_trajectory()
    errors = angle_errors(changed(truth, angles=2 * np.pi + 0.1), truth, ["index_mcp", "index_pip"])
    assert errors.shape == (N, 3)  # flexion and deviation of MCP, flexion of PIP
    np.testing.assert_allclose(errors, 0.1, atol=1e-9)
    assert angle_errors(truth, truth, tuple(JOINT)).shape == (N, int(IS_DOF.sum()))


def test_a_known_distance_counts_whether_it_is_too_long_or_too_short() -> None:
    a = np.zeros((2, 3))
    b = np.array([[0.04, 0.0, 0.0], [0.0, 0.02, 0.0]])
    assert distance_rmse(a, b, 0.03) == pytest.approx(0.01)


def test_an_error_that_is_not_a_number_is_not_averaged_away() -> None:
    with pytest.raises(AssertionError):
        rms(np.array([1.0, np.nan]))
