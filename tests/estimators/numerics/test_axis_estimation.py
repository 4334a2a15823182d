"""Axes of flexion and rotations between sensors, from rates made up with known ones."""

import numpy as np
import pytest

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.axis_estimation import (
    fit_bending,
    fit_common_rotation,
    principal_axis,
)
from handscope.estimators.numerics.typing import Array
from tests.simulated import DEG

DT = 0.01
T = np.arange(0.0, 9.0, DT)
AXIS = np.array([0.48, -0.6, 0.64])


def flexed(rng: np.random.Generator, sway: float = 0.0) -> Array:
    """Three times 70 deg there and back about AXIS, with noise of 0.02 rad/s and a sway across
    it."""
    rate = 35 * DEG * (2 * np.pi / 3) * np.sin(2 * np.pi * T / 3)
    across = np.cross(AXIS, [1.0, 0.0, 0.0])
    return (
        np.outer(rate, AXIS)
        + sway * np.outer(np.sin(1.3 * T), across)
        + rng.normal(scale=0.02, size=(len(T), 3))
    )


def whirled(t: Array) -> Array:
    return np.stack([np.sin(3.1 * t), 0.8 * np.cos(2.3 * t), 0.5 * np.sin(4.7 * t + 1)], axis=1)


def test_the_axis_of_flexion_is_found_with_its_sign_and_its_three_repetitions() -> None:
    found = fit_bending(flexed(np.random.default_rng(1)), DT)
    assert np.arccos(found.axis @ AXIS) < 0.2 * DEG
    assert found.repetitions == 3
    assert found.extent == pytest.approx(70 * DEG, abs=1 * DEG)
    assert found.planarity > 0.99
    assert found.repeatability < 1 * DEG


def test_a_sensor_put_on_the_other_way_round_sees_the_opposite_axis_and_still_flexion_is_positive() -> (
    None
):
    turned = quat.about(0, np.pi)
    found = fit_bending(quat.rotate(turned, flexed(np.random.default_rng(1))), DT)
    assert np.arccos(found.axis @ quat.rotate(turned, AXIS)) < 0.2 * DEG


def test_a_knock_against_the_table_does_not_turn_the_axis() -> None:
    rate = flexed(np.random.default_rng(2))
    rate[300:310] += [0.0, 15.0, 0.0]
    plain = np.linalg.eigh(rate.T @ rate)[1][:, -1]
    assert np.arccos(abs(plain @ AXIS)) > 5 * DEG  # what a plain principal axis makes of it
    assert np.arccos(abs(principal_axis(rate) @ AXIS)) < 0.5 * DEG


def test_what_is_not_in_one_plane_says_so() -> None:
    assert fit_bending(flexed(np.random.default_rng(3), sway=1.0), DT).planarity < 0.85


def test_repetitions_about_different_axes_are_not_repeatable() -> None:
    rate = flexed(np.random.default_rng(4))
    rate[600:] = quat.rotate(quat.exp(np.array([0.0, 0.4, 0.0])), rate[600:])
    assert fit_bending(rate, DT).repeatability > 8 * DEG


def test_two_sensors_on_one_body_are_related_by_their_rates() -> None:
    rng = np.random.default_rng(5)
    q_ab = quat.exp(np.array([0.4, -1.9, 0.8]))
    rate_b = whirled(T)
    rate_a = quat.rotate(q_ab, rate_b) + rng.normal(scale=0.02, size=rate_b.shape)
    found = fit_common_rotation(rate_a, rate_b)
    assert quat.angle(quat.relative(q_ab, found.q_ab)) < 0.3 * DEG
    assert 0.01 < found.residual < 0.05
    assert found.spread > 0.5


def test_a_turn_about_one_axis_only_shows_as_little_spread() -> None:
    rate = np.outer(np.sin(2 * T), AXIS) + np.random.default_rng(6).normal(
        scale=0.01, size=(len(T), 3)
    )
    assert fit_common_rotation(rate, rate).spread < 0.05
