"""Velocities and accelerations against numerical differentiation, places against forward kinematics."""

from typing import Any

import numpy as np
import pytest

from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import IS_DOF, SEGMENT
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.simulation import joint_compliance, kinematics
from handscope.estimators.simulation.kinematics import Kinematics
from handscope.estimators.simulation.motion import (
    SIZE,
    Motion,
    continue_through,
    move_through,
    shift_motion,
)

DT = 1e-4  # s


def _random_motion(rng: np.random.Generator) -> Motion:
    points = []
    for k in range(5):
        x = np.zeros(SIZE)
        x[:3], x[3:6] = rng.normal(size=3) * 0.1, rng.normal(size=3) * 0.5
        x[6:] = (rng.uniform(-0.5, 0.8, (16, 3)) * IS_DOF).ravel()
        points.append((0.7 * k, x))
    return move_through(points)


@pytest.fixture(params=["left", "right"])
def moving(request: pytest.FixtureRequest, rng: np.random.Generator) -> tuple[Any, Kinematics]:
    """A right hand whose joints give, a left one of exact hinges."""
    geometry, motion = sized(request.param), _random_motion(rng)
    if geometry.hand == "right":
        motion = joint_compliance.JointCompliance(
            motion.spline, np.radians(3.0), joint_compliance.draw_phases(rng)
        )
    return geometry, kinematics.compute_kinematics(motion, geometry, np.arange(0.3, 0.6, DT))


def test_angular_velocity_is_the_derivative_of_orientation(moving: tuple[Any, Kinematics]) -> None:
    k = moving[1]
    step = quat.log(quat.multiply(k.q_GB[2:], quat.conjugate(k.q_GB[:-2]))) / (
        2 * DT
    )  # in the global frame
    np.testing.assert_allclose(step, k.w[1:-1], atol=1e-5 * np.abs(k.w).max())


def test_angular_acceleration_is_the_derivative_of_angular_velocity(
    moving: tuple[Any, Kinematics],
) -> None:
    k = moving[1]
    np.testing.assert_allclose(
        (k.w[2:] - k.w[:-2]) / (2 * DT), k.dw[1:-1], atol=1e-5 * np.abs(k.dw).max()
    )


def test_acceleration_is_the_second_derivative_of_place(moving: tuple[Any, Kinematics]) -> None:
    k = moving[1]
    second = (k.p[2:] - 2 * k.p[1:-1] + k.p[:-2]) / DT**2
    np.testing.assert_allclose(second, k.a[1:-1], atol=1e-4 * np.abs(k.a).max())


def test_places_and_orientations_are_those_of_forward_kinematics(
    moving: tuple[Any, Kinematics],
) -> None:
    geometry, k = moving
    q_pc = joint_angles.compose(k.angles)
    np.testing.assert_allclose(k.tips, forward_kinematics.tips(q_pc, geometry), atol=1e-15)
    chained = forward_kinematics.segments_on(k.q_GB[:, SEGMENT["hand"]], q_pc)
    np.testing.assert_allclose(np.abs((chained * k.q_GB).sum(axis=-1)), 1.0, atol=1e-14)


def test_the_truth_has_no_angle_where_there_is_no_freedom(moving: tuple[Any, Kinematics]) -> None:
    truth = kinematics.true_trajectory(moving[1], "left")
    np.testing.assert_array_equal(np.isnan(truth.angles[0]), ~IS_DOF)


def test_the_base_has_the_palm_down_and_the_fingers_along_global_y() -> None:
    for hand, dorsal, distal in (("left", 0, 1), ("right", 0, 1)):
        R, sign = kinematics.base_orientation(hand), 1.0 if hand == "left" else -1.0
        np.testing.assert_array_equal(sign * R[:, dorsal], [0, 0, 1])
        np.testing.assert_array_equal(sign * R[:, distal], [0, 1, 0])
        assert np.linalg.det(R) == pytest.approx(1.0)


def test_between_its_points_a_motion_is_minimum_jerk_and_rests_outside() -> None:
    end = np.zeros(SIZE)
    end[7] = 1.0
    motion = move_through([(1.0, np.zeros(SIZE)), (3.0, end)])
    x, dx, ddx = motion.at(np.array([0.0, 1.0, 1.5, 2.0, 3.0, 4.0]))
    s = 0.25
    np.testing.assert_allclose(
        x[:, 7], [0, 0, 10 * s**3 - 15 * s**4 + 6 * s**5, 0.5, 1, 1], atol=1e-12
    )
    np.testing.assert_allclose(dx[[0, 1, 3, 4, 5], 7], [0, 0, 1.875 / 2, 0, 0], atol=1e-12)
    np.testing.assert_allclose(ddx[[0, 1, 3, 4, 5], 7], 0.0, atol=1e-12)
    later, _, _ = shift_motion(motion, 2.0).at(np.array([3.5]))
    np.testing.assert_allclose(later, x[2:3], atol=1e-12)


def test_a_motion_goes_on_smoothly_from_any_state(rng: np.random.Generator) -> None:
    motion, goal = _random_motion(rng), np.zeros(SIZE)
    state = tuple(part[0] for part in motion.at(np.array([0.9])))
    on = continue_through(state, [(2.0, goal)], 0.9)
    for there, here in zip(on.at(np.array([0.9])), state):
        np.testing.assert_allclose(there[0], here, atol=1e-9)
    np.testing.assert_allclose(on.at(np.array([2.0]))[0][0], goal, atol=1e-9)
    np.testing.assert_allclose(on.at(np.array([2.0]))[1][0], 0, atol=1e-9)
