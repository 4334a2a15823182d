"""Sizes of errors that the filter learns of a recording, and those that it derives: noise,
creeping, give of joints, verticals, accelerometers' biases."""

import numpy as np
import pytest

from handscope.estimators.alignment import initial_pose
from handscope.estimators.finger_ekf import inclination_noise, joint_compliance, zero_rate_update
from handscope.estimators.finger_ekf.filter import FilterParams, pack_params
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from tests.estimators.interpreted import interpreted

DEG = np.pi / 180
NUMBERS = pack_params(FilterParams())


@pytest.mark.parametrize("density", [0.01, 0.04])
def test_white_noise_is_separated_from_tremor_and_swaying(
    density: float, rng: np.random.Generator
) -> None:
    """Three seconds at 100 Hz: 3 deg/s at 8 Hz and 0.5 deg/s at 0.7 Hz beside noise of two
    qualities."""
    t = np.arange(300)[:, None] / 100
    moved = 3 * np.sin(2 * np.pi * (8 * t + [0, 0.3, 0.6])) + 0.5 * np.sin(
        2 * np.pi * (0.7 * t + [0.2, 0.5, 0])
    )
    found = initial_pose.white_noise(
        (moved + density * np.sqrt(50) * rng.normal(size=(300, 3))) * DEG, 100.0
    )
    assert found == pytest.approx(density * DEG, rel=0.25)


def test_too_few_samples_tell_no_noise(rng: np.random.Generator) -> None:
    assert initial_pose.white_noise(rng.normal(size=(59, 3)), 100.0) is None


def _rests(rates: Array, biases_known: float = 0.01 * DEG) -> Array:
    """Noise (12, 12) that the last of rests counts with; rates (rests, 4, 3) rad/s that sensors of
    bias 0 show."""
    previous_rest_rate, rest_rate_scatter, P = (
        np.full((4, 3), np.nan),
        np.zeros(2),
        biases_known**2 * np.eye(43),
    )
    for rate in rates:
        rest_time, innovation, H, noise = (
            np.full(4, 1.5),
            np.zeros(12),
            np.zeros((12, 43)),
            np.zeros((12, 12)),
        )
        interpreted(zero_rate_update.update_rest_scatter_row)(
            rate * 1.5, rest_time, np.ones(4), previous_rest_rate, rest_rate_scatter
        )
        interpreted(zero_rate_update.zero_rate_rows)(
            NUMBERS,
            rate * 1.5,
            rest_time,
            np.ones(4),
            np.zeros((4, 3)),
            P,
            rest_rate_scatter,
            innovation,
            H,
            noise,
        )
    np.testing.assert_allclose(innovation, rate.ravel(), atol=1e-15)
    return noise


@pytest.mark.parametrize("creeping", [0.01, 0.3])
def test_scatter_of_rest_rates_is_learnt_from_rest_to_rest(
    creeping: float, rng: np.random.Generator
) -> None:
    noise = _rests(creeping * DEG * rng.normal(size=(40, 4, 3)))
    usual = np.median(np.sqrt(noise.diagonal()))
    first = np.median(np.sqrt(_rests(np.zeros((1, 4, 3))).diagonal()))
    assert first == pytest.approx(0.1 * DEG)  # nothing learnt yet: the option
    assert usual == pytest.approx(max(creeping, 0.1 * np.sqrt(12 / (12 + 39 * 12))) * DEG, rel=0.3)


def test_a_constant_slow_rotation_is_not_taken_for_a_bias() -> None:
    """One finger turns at 0.2 deg/s all the time where biases are known to 0.01: nothing differs
    from rest to rest, yet it counts for little."""
    rates = np.zeros((40, 4, 3))
    rates[:, 3, 2] = 0.2 * DEG
    sd = np.sqrt(_rests(rates).diagonal()).reshape(4, 3)
    assert sd[3, 2] > 0.19 * DEG
    assert sd[:3].max() < 0.05 * DEG


def _learnt(seemed: Array, known: float, turned: float) -> Array:
    """How much each joint is believed to give (3,), deg, after windows of 0.2 s in which axes of
    hinges seemed off by (windows, 3 joints, 2) deg, where the filter knows them to `known` deg and
    they turn by `turned` rad in each."""
    compliance_stats, variance, free = (
        np.zeros((3, 2)),
        np.empty(3),
        np.tile([1.0, 0.0, 0.0], (3, 1)),
    )
    own_variance, innovation = np.full(9, (known * DEG) ** 2), np.zeros(18)
    rows = 9 + 3 * np.arange(3)[:, None] + [1, 2]
    before, after = np.tile(quat.IDENTITY, (3, 1)), quat.about(2, np.full(3, turned))
    for one in seemed:
        interpreted(joint_compliance.compliance_variance_row)(NUMBERS, compliance_stats, variance)
        innovation[rows], noise = (
            one * DEG,
            np.diag(np.repeat([0.0, 5.0], 9) * np.repeat(np.append(np.ones(3), variance), 3)),
        )
        interpreted(joint_compliance.update_compliance_row)(
            NUMBERS,
            before,
            after,
            own_variance,
            free,
            variance,
            5.0,
            innovation,
            noise,
            compliance_stats,
        )
    interpreted(joint_compliance.compliance_variance_row)(NUMBERS, compliance_stats, variance)
    return np.sqrt(variance) / DEG


@pytest.mark.parametrize(("joint_compliance_deg", "believed"), [(0.6, 2.0), (6.0, 6.0)])
def test_that_a_joint_gives_more_than_is_believed_is_learnt_while_it_moves(
    joint_compliance_deg: float, believed: float, rng: np.random.Generator
) -> None:
    """Beside errors of the filter's own as large as it says."""
    seemed = np.hypot(joint_compliance_deg, 0.5) * rng.normal(size=(2000, 3, 2))
    np.testing.assert_allclose(_learnt(seemed, 0.5, 0.3), believed, rtol=0.2)


def test_a_joint_that_lies_as_it_lay_tells_nothing_of_how_it_gives(
    rng: np.random.Generator,
) -> None:
    np.testing.assert_allclose(
        _learnt(6.0 * rng.normal(size=(2000, 3, 2)), 0.5, 0.0), 2.0, rtol=1e-6
    )


def test_what_the_filter_does_not_know_itself_is_not_taken_for_give(
    rng: np.random.Generator,
) -> None:
    """Hinges that give nothing, seats known to 5 deg."""
    assert _learnt(5.0 * rng.normal(size=(2000, 3, 2)), 5.0, 0.3).max() < 2.5


def test_a_vertical_is_the_less_sure_the_faster_the_sensor_has_turned() -> None:
    variance, mean_square_rate = np.empty(4), np.array([0.0, 100.0, 400.0, 50.0]) ** 2 * DEG**2
    interpreted(inclination_noise.inclination_variance_row)(NUMBERS, mean_square_rate, variance)
    np.testing.assert_allclose(
        np.sqrt(variance) / DEG, np.hypot(0.18, 0.0016 * np.array([0, 100, 400, 50])), rtol=1e-9
    )


def test_biases_of_accelerometers_count_as_drawn_ones_err_and_not_where_sensors_lie_as_they_began(
    rng: np.random.Generator,
) -> None:
    """Each sensor's own turn (u - u_0) x b / g, minus its parent's as the joint's child sees it."""
    initial_vertical, q = np.tile([1.0, 0.0, 0.0], (4, 1)), quat.normalize(rng.normal(size=(3, 4)))
    current_vertical = quat.rotate(quat.normalize(rng.normal(size=(4, 4))), initial_vertical)
    found, nothing = np.zeros((9, 9)), np.zeros((9, 9))
    interpreted(inclination_noise.add_accelerometer_biases_row)(
        NUMBERS, q, initial_vertical, current_vertical, found
    )
    interpreted(inclination_noise.add_accelerometer_biases_row)(
        NUMBERS, q, initial_vertical, initial_vertical, nothing
    )
    assert not nothing.any()
    turned = np.cross(
        current_vertical - initial_vertical, 0.05 / 9.80665 * rng.normal(size=(20000, 4, 3))
    )
    errors = (turned[:, 1:] - quat.rotate(quat.conjugate(q), turned[:, :3])).reshape(-1, 9)
    np.testing.assert_allclose(found, errors.T @ errors / len(errors), atol=0.04 * found.max())
