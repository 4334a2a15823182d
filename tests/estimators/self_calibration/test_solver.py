from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.hand.anatomy import FLEXION, JOINT
from handscope.estimators.self_calibration import mounting_shift, normal_equations, segments, solver
from handscope.estimators.self_calibration.problem import parameter_columns
from handscope.estimators.self_calibration.solver import Limits, Solution
from handscope.estimators.self_calibration.uncertainty import posterior
from handscope.estimators.simulation import artificial_finger
from handscope.estimators.simulation.artificial_finger import SEGMENTS
from tests.estimators.self_calibration.fingers import (
    DURATION,
    WHITE,
    cold,
    distances,
    lengths,
    readings,
    recorded,
    slipped,
)


def test_a_finger_is_measured_from_a_cold_start(solved: Solution) -> None:
    assert solved.outcome == "converged"
    np.testing.assert_allclose(lengths(solved.at), artificial_finger.HINGES, rtol=0.01)
    np.testing.assert_allclose(distances(solved.at), artificial_finger.DISTANCES, rtol=0.01)
    c, sd = parameter_columns(solved.problem.chain), np.sqrt(np.diag(solved.factor.covariance))
    worn = recorded(1, DURATION).sensors.bias
    np.testing.assert_allclose(
        solved.at.bias_gyr, worn[:, :3], atol=np.radians(0.02)
    )  # it rests for 2 s at either end
    np.testing.assert_allclose(solved.at.bias_acc, worn[:, 3:6], atol=0.02)
    assert np.abs((solved.at.bias_gyr - worn[:, :3]).ravel() / sd[c.bias_gyr]).max() < 3.0
    assert abs(solved.at.delay[0]) < 1e-4


@pytest.mark.slow
def test_scale_and_cross_axis_errors_are_found_and_what_they_leave_is_told() -> None:
    """Readings that are off by some thousandths: without the matrices among the unknowns lengths were off by 4 % of 20 s, five times what was told."""
    made = artificial_finger.record_trial(
        np.random.default_rng(5),
        replace(WHITE, gyr_scale=0.004, acc_scale=0.004, cross_axis=0.004),
        duration=DURATION,
    )
    found, true = (
        solver.solve_with_noise(*cold(made)),
        np.linalg.inv(made.sensors.matrix) - np.eye(3),
    )
    c, sd = parameter_columns(found.problem.chain), np.sqrt(np.diag(found.factor.covariance))
    assert found.outcome == "converged"
    assert found.problem.noise.scale == pytest.approx(0.004, rel=0.4)
    for where, matrices, truth in (
        (c.scale_gyr, found.at.scale_gyr, true[0]),
        (c.scale_acc, found.at.scale_acc, true[1]),
    ):
        off = (matrices - truth).ravel() / sd[where]
        assert 0.5 < np.sqrt(np.mean(off**2)) < 1.5
    told = segments.of_solution(found, made.hand, made.mounting)
    for name in SEGMENTS[1:3]:
        assert told.lengths[name] == pytest.approx(
            artificial_finger.HINGES, abs=3 * told.lengths_sd[name], rel=0.0
        )
        assert told.lengths_sd[name] < 0.015 * artificial_finger.HINGES


def test_skin_that_follows_the_joint_is_told_apart(with_skin: Solution) -> None:
    assert with_skin.outcome == "converged"
    np.testing.assert_allclose(lengths(with_skin.at), artificial_finger.HINGES, rtol=0.01)
    np.testing.assert_allclose(distances(with_skin.at), artificial_finger.DISTANCES, rtol=0.03)
    assert np.abs(with_skin.at.law).max() < 0.05, (
        "it follows in proportion, and is not believed to do anything else"
    )


def test_the_size_of_the_noise_is_found(solved: Solution) -> None:
    white = 300e-6 * 9.80665 * np.sqrt(50.0)  # m/s^2 a sample
    assert solved.problem.noise.acc == pytest.approx(white, rel=0.05)
    assert solved.problem.noise.skin_turn < 0.5  # there is none, the first belief was 3 deg


@pytest.mark.parametrize("which", ["solved", "with_skin"])
def test_standard_deviations_are_honest(which: str, request: pytest.FixtureRequest) -> None:
    found: Solution = request.getfixturevalue(which)
    drawn = np.array(
        [
            lengths(at)
            for at in posterior.draw_places(found.problem, found.at, found.factor, 60, np.arange(2))
        ]
    )
    off = (lengths(found.at) - artificial_finger.HINGES) / drawn.std(axis=0)
    assert np.abs(off).max() < 3.0
    assert drawn.std(axis=0).max() < 0.01 * artificial_finger.HINGES


def test_numbers_for_draws_are_normal_and_independent() -> None:
    a, b = posterior.normal_numbers(20000, 0), posterior.normal_numbers(20000, 1)
    for moment, expected in (
        (a.mean(), 0),
        (a.std(), 1),
        ((a**4).mean() / 3, 1),
        ((a * b).mean(), 0),
        ((a[1:] * a[:-1]).mean(), 0),
    ):
        assert moment == pytest.approx(expected, abs=0.05)


def test_draws_agree_with_the_covariance(solved: Solution) -> None:
    c = parameter_columns(solved.problem.chain)
    drawn = np.array(
        [
            at.bias_gyr.ravel()
            for at in posterior.draw_places(
                solved.problem, solved.at, solved.factor, 150, np.arange(2)
            )
        ]
    )
    np.testing.assert_allclose(
        drawn.std(axis=0), np.sqrt(np.diag(solved.factor.covariance)[c.bias_gyr]), rtol=0.2
    )


def test_the_minimum_is_one(solved: Solution) -> None:
    """The gradient is gone: no parameter wants to move by more than a tenth of its standard deviation."""
    step = normal_equations.solve_step(
        solver.build_normal_equations(solved.problem, solved.at)[0], solved.factor
    )
    assert np.abs(step.parameters / np.sqrt(np.diag(solved.factor.covariance))).max() < 0.1


@pytest.mark.slow
def test_a_knock_is_trusted_less(solved: Solution) -> None:
    """A sensor hit for three samples changes nothing that matters."""
    acc = solved.problem.acc.copy()
    acc[600:603, 2] += [40.0, -60.0, 25.0]
    found = solver.solve_with_noise(replace(solved.problem, acc=acc), solved.at)
    assert found.outcome == "converged"
    assert found.problem.acc_sd[601, 2] > 10 * np.median(found.problem.acc_sd)
    np.testing.assert_allclose(lengths(found.at), lengths(solved.at), rtol=0.003)
    assert {(jolt.sensor, jolt.kind, abs(jolt.sample - 601) < 3) for jolt in found.outliers} == {
        (2, "acc", True)
    }


@pytest.mark.slow
def test_knocks_that_all_sensors_feel_are_carried_from_a_cold_start() -> None:
    """Six in 16 s, on accelerometers and gyroscopes, the others a fifth as hard: each is laid at the sensor that was hit."""
    recording, rng = recorded(2, DURATION, skin=True), np.random.default_rng(7)
    read = readings(recording)
    gyr, acc = read.gyr.copy(), read.acc.copy()
    hits = {200: 0, 410: 2, 650: 1, 900: 3, 1180: 2, 1400: 1}
    for at, hit in hits.items():
        shares = np.where(np.arange(4) == hit, 1.0, 0.2)[:, None]
        for values, size, rung in ((acc, 30.0, [0.7, -0.6]), (gyr, 3.0, [0.7, -0.4])):
            way = rng.standard_normal((4, 3))
            values[at : at + 2] += np.multiply.outer(
                rung, size * shares * way / np.linalg.norm(way, axis=1, keepdims=True)
            )
    found = solver.solve_with_noise(*cold(recording, read=replace(read, gyr=gyr, acc=acc)))
    assert found.outcome == "converged" and len(found.costs) < 15
    np.testing.assert_allclose(lengths(found.at), artificial_finger.HINGES, rtol=0.02)
    assert {at for at in hits if any(abs(jolt.sample - at) < 5 for jolt in found.outliers)} == set(
        hits
    )
    assert all(
        hits[min(hits, key=lambda at: abs(at - jolt.sample))] == jolt.sensor
        for jolt in found.outliers
    )


def test_it_stops_when_told_to() -> None:
    problem, guess = cold(recorded(1, DURATION))
    heard: list[int] = []
    found = solver.solve_with_noise(problem, guess, go_on=lambda k, cost: heard.append(k) or k < 2)
    assert found.outcome == "stopped"
    assert heard == [1, 2]


def test_how_far_joints_are_flexed_is_known(with_skin: Solution) -> None:
    """Between bones, with the sign of the nominal mounting's axis: not from whichever end of its movement a joint is at more often."""
    angles = recorded(2, DURATION, skin=True).truth.angles[
        :, [JOINT[j] for j in with_skin.problem.chain.joints], FLEXION
    ]
    np.testing.assert_allclose(
        with_skin.problem.bent, angles, atol=np.radians(5.0)
    )  # the skin itself turns by 2


def test_a_sensor_that_slipped_is_named(with_skin: Solution) -> None:
    """Turned by 12 deg on its phalanx for the second half."""
    made = slipped(recorded(2, DURATION, skin=True), 2, 12.0)
    found = solver.solve(cold(made)[0], with_skin.at, Limits(iterations=1))
    first = mounting_shift.find_mounting_shifts(found, readings(made))[0]
    assert first.sensor == "index_middle"
    assert first.tilt == pytest.approx(np.radians(12.0), abs=np.radians(3.0))


def test_no_sensor_slipped_where_none_did_though_the_whole_came_to_no_end(
    with_skin: Solution,
) -> None:
    read = readings(recorded(2, DURATION, skin=True))
    assert mounting_shift.find_mounting_shifts(with_skin, read) == []
    lost = replace(
        with_skin, outcome="not converged", at=replace(with_skin.at, near=-with_skin.at.near)
    )
    assert mounting_shift.find_mounting_shifts(lost, read) == []


def test_halves_of_a_stretch_begin_where_the_whole_has_its_minimum(with_skin: Solution) -> None:
    """Wherever the hand has turned to by then: else a half would be asked before it came down, and called another."""
    n = len(with_skin.problem)
    for first, stop in ((0, n // 2), (n // 2, n)):
        half = mounting_shift._solve_half(with_skin, first, stop)
        assert half.outcome == "converged"
        assert half.costs[0] < 1.1 * half.costs[-1]
