"""Calibrations applied to readings, and found from a sensor laid down in many positions."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.estimators.data.samples import ACC, GYR, MAG
from handscope.estimators.errors import InputError
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.sensors.imu_calibration import (
    CALIBRATED,
    ImuCalibration,
    apply,
    compose,
    saturation_level,
)
from handscope.estimators.sensors.six_position_calibration import (
    SolvedCalibration,
    SolveParams,
    solve,
)
from handscope.estimators.sensors.static_segments import (
    RestParams,
    distinct_positions,
    find_rests,
    missing_positions,
)
from handscope.estimators.simulation.sensors import IDEAL
from tests.laid_down import SIX, Readings, laid_down, many_positions

PARAMS = SolveParams()
# the six sides, and a turn about z held level
TURNED_TOO = [
    *SIX,
    *(quat.multiply(SIX[1], quat.about(2, k * np.pi / 2)) for k in range(3)),
]
SEEDS = st.integers(0, 2**32 - 1)


def drawn(seed: int, share: float = 0.05) -> ImuCalibration:
    rng = np.random.default_rng(seed)
    matrix = {q: np.eye(3) + share * rng.uniform(-1, 1, (3, 3)) for q in CALIBRATED}
    return ImuCalibration(matrix, {q: rng.normal(size=3) for q in CALIBRATED})


def solved(r: Readings, params: SolveParams = PARAMS) -> SolvedCalibration:
    return solve(params, "index_distal", r.t, r.gyr, r.acc, r.t, r.mag)


@given(SEEDS)
def test_a_calibration_takes_its_own_inverse_out_of_the_readings(seed: int) -> None:
    made, rng = [drawn(seed), drawn(seed + 1)], np.random.default_rng([seed, 5])
    truth = rng.normal(size=(7, 2, 9))
    read = truth.copy()
    for k, c in enumerate(made):
        for n, q in enumerate(CALIBRATED):
            read[:, k, 3 * n : 3 * n + 3] = (
                truth[:, k, 3 * n : 3 * n + 3] @ np.linalg.inv(c.matrix[q]).T + c.bias[q]
            )
    np.testing.assert_allclose(apply(made, CALIBRATED, read), truth, atol=1e-12)


@given(SEEDS, st.integers(0, 40))
def test_blocks_may_be_cut_anywhere(seed: int, where: int) -> None:
    values = np.random.default_rng(seed).normal(size=(40, 1, 6))
    pieces = [apply([drawn(seed)], (GYR, ACC), v) for v in (values[:where], values[where:])]
    np.testing.assert_array_equal(np.concatenate(pieces), apply([drawn(seed)], (GYR, ACC), values))


@given(SEEDS)
def test_two_calibrations_in_turn_are_one(seed: int) -> None:
    first, second, values = (
        drawn(seed),
        drawn(seed + 1),
        np.random.default_rng([seed, 5]).normal(size=(5, 1, 9)),
    )
    np.testing.assert_allclose(
        apply([compose(first, second)], CALIBRATED, values),
        apply([second], CALIBRATED, apply([first], CALIBRATED, values)),
        atol=1e-12,
    )


def test_a_calibration_that_does_nothing_leaves_every_bit() -> None:
    values = np.random.default_rng(0).normal(size=(5, 1, 9))
    np.testing.assert_array_equal(apply([ImuCalibration()], CALIBRATED, values), values)
    assert ImuCalibration().trivial and not drawn(0).trivial


def test_missing_samples_stay_missing_and_a_silent_accelerometer_stays_silent() -> None:
    values = np.ones((3, 1, 6))
    values[0, 0, 1] = np.nan
    values[1, 0, 3:] = 0.0
    corrected = apply([drawn(1)], (GYR, ACC), values)
    assert np.isnan(corrected[0, 0, :3]).all() and np.isfinite(corrected[0, 0, 3:]).all()
    assert (corrected[1, 0, 3:] == 0).all()


@given(SEEDS)
def test_a_reading_at_the_sensors_limit_reaches_the_corrected_limit(seed: int) -> None:
    c, rng = drawn(seed, 0.03), np.random.default_rng(seed)
    read = rng.uniform(-40, 40, (50, 1, 3))
    read[:, 0, seed % 3] = 40.0 * rng.choice([-1, 1], 50)
    corrected = apply([c], (GYR,), read)
    assert (np.abs(corrected).max(axis=-1) >= saturation_level([c], GYR, 40.0) - 1e-9).all()
    assert saturation_level([ImuCalibration()], GYR, 40.0) == 40.0


def test_without_noise_the_errors_are_recovered() -> None:
    errors = replace(
        IDEAL,
        gyr_bias=5.0,
        acc_bias=0.5,
        mag_bias=30.0,
        gyr_scale=0.03,
        acc_scale=0.03,
        mag_scale=0.05,
        cross_axis=0.02,
    )
    r = laid_down(many_positions(3), 3, errors)
    found = solved(r)
    for quantity, tolerance in {
        ACC: 1e-6,
        GYR: 2e-5,
        MAG: 1e-6,
    }.items():  # the gyroscope's is that of integrating at 100 Hz
        M = r.truth.matrix[quantity] / (
            np.cbrt(np.linalg.det(r.truth.matrix[quantity])) if quantity == MAG else 1.0
        )
        np.testing.assert_allclose(found.calibration.matrix[quantity], M, atol=tolerance)
        np.testing.assert_allclose(
            found.calibration.bias[quantity],
            r.bias[quantity],
            atol=1e-6 * np.abs(r.bias[quantity]).max(),
        )


def test_the_errors_found_are_as_far_from_the_true_ones_as_is_said() -> None:
    squares: dict[tuple[str, str], list[float]] = {}
    for seed in range(12):
        r = laid_down(many_positions(seed), seed)
        found = solved(r)
        assert found.unobserved == ()
        for q in CALIBRATED:
            M = r.truth.matrix[q] / (np.cbrt(np.linalg.det(r.truth.matrix[q])) if q == MAG else 1.0)
            squares.setdefault((q, "matrix"), []).append(
                float(np.mean(((found.calibration.matrix[q] - M) / found.matrix_sd[q]) ** 2))
            )
            squares.setdefault((q, "bias"), []).append(
                float(np.mean(((found.calibration.bias[q] - r.bias[q]) / found.bias_sd[q]) ** 2))
            )
    for key, values in squares.items():
        # of 1: 12 sensors with 3 to 9 correlated parameters each
        assert 0.4 < np.mean(values) < 1.6, key


def test_what_is_left_at_rest_and_over_a_turn_is_the_noise() -> None:
    found = solved(laid_down(many_positions(1), 1))
    before, left = found.residuals[ACC]
    assert before > 0.3 and left < 0.002  # m/s^2
    before, left = found.residuals[GYR]
    assert before > np.radians(2.0) and left < np.radians(0.05)
    # the magnetometer's noise, as a share of the field
    assert found.residuals[MAG][1] < 1.2 * 0.6e-6 / 48e-6


def test_six_sides_give_scales_and_say_what_they_do_not_give() -> None:
    r = laid_down(TURNED_TOO, 1)
    found = solved(r)
    assert found.positions == 6
    assert any("cross axes of the accelerometer" in what for what in found.unobserved)
    np.testing.assert_allclose(
        np.diag(found.calibration.matrix[ACC]), np.diag(r.truth.matrix[ACC]), atol=0.001
    )
    np.testing.assert_allclose(found.calibration.bias[ACC], r.bias[ACC], atol=0.02)
    assert np.isinf(found.matrix_sd[ACC][0, 1])


@pytest.mark.parametrize("left_out", range(6))
def test_a_side_that_is_missing_is_named(left_out: int) -> None:
    kept = [q for k, q in enumerate(SIX) if k != left_out]
    up = quat.rotate(quat.conjugate(SIX[left_out]), np.array([0.0, 0, 1]))
    axis, way = "xyz"[int(np.argmax(np.abs(up)))], "up" if up.sum() > 0 else "down"
    with pytest.raises(
        InputError,
        match=f"index_distal: 5 positions at rest found, none with its {axis} axis pointing {way}",
    ):
        solved(laid_down(kept, 1, IDEAL))


def test_a_turn_that_is_missing_is_named() -> None:
    with pytest.raises(InputError, match="turns about its z axis are missing"):
        solved(laid_down(SIX, 1))


def test_a_magnetometer_that_stands_still_is_left_out_and_said() -> None:
    r = laid_down(many_positions(2), 2)
    for mag, words in (
        (np.ones_like(r.mag), "constant"),
        (np.full_like(r.mag, np.nan), "no samples"),
    ):
        found = solved(replace(r, mag=mag))
        assert MAG not in found.calibration.matrix
        assert words in found.unobserved[-1]


def test_an_octahedron_of_positions_in_any_direction_misses_none() -> None:
    turned: list[Array] = [quat.rotate(q, np.array([0.0, 0, 1])) for q in SIX]
    for q in quat.normalize(np.random.default_rng(0).normal(size=(200, 4))):
        assert missing_positions([quat.rotate(q, up) for up in turned]) == []


def test_rests_are_found_where_they_were_and_the_turns_are_not() -> None:
    r = laid_down(many_positions(5), 5, rest=3.0, turn=2.0)
    rests = find_rests(RestParams(), r.t, r.gyr, r.acc)
    assert len(rests) == 14
    for k, rest in enumerate(rests):
        # the turns begin and end slowly
        assert 5.0 * k - 0.01 <= r.t[rest.first] < r.t[rest.last - 1] <= 5.0 * k + 3.3
    assert len(distinct_positions(rests)) <= 14
    assert find_rests(RestParams(), r.t, np.full_like(r.gyr, np.nan), r.acc) == []
