"""The pieces of a force's way: its zero, the way to a higher rate, the turn of the tips, what is held."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from handscope.estimators.force import (
    contact,
    fingertip_torques,
    force_balance,
    identification,
    interpolation,
    tip_orientation,
    zero,
)
from handscope.estimators.force.tip_orientation import TipParams, Tips
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

DEG = np.pi / 180


def pushes(t: Array) -> Array:
    """Nothing, then 2 N for three seconds, then nothing (n, 1, 3)."""
    size = np.clip(np.minimum(t - 4.0, 7.0 - t) / 0.3, 0.0, 1.0)
    return size[:, None, None] * np.array([0.4, -0.2, 2.0])


def test_the_zero_is_followed_through_a_contact_and_knows_how_well() -> None:
    t, surprise = np.arange(0.0, 12.0, 1 / 12), []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        drift = 0.2 * rng.normal(size=3) + np.cumsum(
            0.03 / np.sqrt(12) * rng.normal(size=(len(t), 1, 3)), axis=0
        )
        found = zero.estimate_zero(
            zero.ZeroParams(),
            t,
            pushes(t) + drift + 0.05 * rng.normal(size=drift.shape),
            np.array([0.05]),
        )
        assert not found.free[(t > 4.2) & (t < 6.8)].any()
        assert found.free[t < 3.5].mean() > 0.9
        surprise.append((((found.level - drift) / found.sd[..., None]) ** 2).mean())
    assert 0.6 < np.mean(surprise) < 1.6


def test_a_light_touch_below_the_noise_of_a_reading_is_no_zero() -> None:
    """0.5 N for two seconds before the contact, noise 0.2 N: it was taken for free, and the zero for one that jumps."""
    t = np.arange(0.0, 12.0, 1 / 12)
    touch = np.where((t > 2.0) & (t < 4.0), 0.5, 0.0)[:, None, None] * np.array([0.0, 0.0, 1.0])
    for seed in range(10):
        rng = np.random.default_rng(seed)
        found = zero.estimate_zero(
            zero.ZeroParams(),
            t,
            pushes(t) + touch + 0.2 * rng.normal(size=(len(t), 1, 3)),
            np.array([0.2]),
        )
        assert found.jump.max() < 4
        assert found.free[(t > 2.5) & (t < 6.5)].mean() < 0.1
        assert found.free[t > 8.0].mean() > 0.9


@pytest.mark.parametrize("walk", [0.015, 0.02, 0.06, 0.15])
def test_how_fast_a_zero_walks_is_read_from_the_free_sensor(walk: float) -> None:
    """Half as fast as is likely as well as five times: it is as unsure through the contact as it is off."""
    t, surprise, told = np.arange(0.0, 20.0, 1 / 12), [], []
    for seed in range(20):
        rng = np.random.default_rng(100 + seed)
        drift = np.cumsum(walk / np.sqrt(12) * rng.normal(size=(len(t), 1, 3)), axis=0)
        found = zero.estimate_zero(
            zero.ZeroParams(),
            t,
            pushes(t - 6.0) + drift + 0.05 * rng.normal(size=drift.shape),
            np.array([0.05]),
        )
        touched = (t > 10.5) & (t < 12.5)
        if not found.free[touched].any():
            surprise.append((((found.level - drift) / found.sd[..., None])[touched] ** 2).mean())
            told.append(found.drift[0])
    assert len(told) > 12
    assert np.median(told) == pytest.approx(walk, rel=0.3)
    assert 0.3 < np.mean(surprise) < 2.0


def test_a_sensor_that_is_hardly_ever_free_walks_as_is_likely() -> None:
    t, rng = np.arange(0.0, 8.0, 1 / 12), np.random.default_rng(3)
    size = np.clip(np.minimum(t - 0.7, 7.3 - t) / 0.2, 0.0, 1.0) * (1 + 0.4 * np.sin(2 * t))
    held = size[:, None, None] * np.array([0.4, -0.2, 2.0])
    found = zero.estimate_zero(
        zero.ZeroParams(), t, held + 0.05 * rng.normal(size=held.shape), np.array([0.05])
    )
    assert found.drift[0] == pytest.approx(0.03, rel=0.35)


def test_a_zero_that_moves_further_than_it_walks_is_less_sure_between() -> None:
    t, rng = np.arange(0.0, 12.0, 1 / 12), np.random.default_rng(0)
    still, moved = (
        zero.estimate_zero(
            zero.ZeroParams(),
            t,
            pushes(t)
            + np.where(t > 5.5, by, 0.0)[:, None, None]
            + 0.05 * rng.normal(size=(len(t), 1, 3)),
            np.array([0.05]),
        )
        for by in (0.0, 0.15)
    )
    assert moved.jump.max() < 4, "not beyond doubt"
    assert moved.sd[66, 0] > 1.5 * still.sd[66, 0]


def test_a_zero_that_jumps_within_a_contact_is_told() -> None:
    t, rng = np.arange(0.0, 12.0, 1 / 12), np.random.default_rng(0)
    read = (
        pushes(t)
        + np.where(t > 5.5, 0.4, 0.0)[:, None, None]
        + 0.05 * rng.normal(size=(len(t), 1, 3))
    )
    found = zero.estimate_zero(zero.ZeroParams(least=0.8), t, read, np.array([0.05]))
    assert found.jump[(t > 4.5) & (t < 6.5)].min() > 4


def test_without_noise_it_passes_through_the_samples_as_a_cubic_does() -> None:
    t, at = np.arange(0.0, 5.0, 1 / 12), np.arange(1.0, 4.0, 0.01)
    y = np.stack([np.sin(2 * t), np.cos(3 * t), t * 0], axis=-1)[:, None]
    found = interpolation.interpolate(t, y, np.array([1e-4]), at)
    np.testing.assert_allclose(found.values[:, 0], CubicSpline(t, y[:, 0])(at), atol=2e-3)


def test_between_slow_samples_it_is_as_sure_as_it_says() -> None:
    fine, surprise = np.arange(0.0, 20.0, 0.01), []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        rate = np.cumsum(
            3.0 * np.sqrt(0.01) * rng.normal(size=(len(fine), 1, 3)), axis=0
        )  # a rate that wanders at random
        signal = np.cumsum(0.01 * rate, axis=0)
        k = np.arange(0, len(fine), 8)
        keep = rng.random(len(k)) > 0.1
        read = np.where(
            keep[:, None, None], signal[k] + 0.05 * rng.normal(size=(len(k), 1, 3)), np.nan
        )
        found = interpolation.interpolate(fine[k], read, np.array([0.05]), fine[8:-8])
        surprise.append((((found.values - signal[8:-8]) / found.sd[..., None]) ** 2).mean())
    assert 0.7 < np.mean(surprise) < 1.4


def test_noise_is_read_from_the_samples_while_forces_come_and_go() -> None:
    t, rng = np.arange(0.0, 30.0, 1 / 12), np.random.default_rng(1)
    y = 3 * np.sin(t)[:, None, None] * np.ones((1, 2, 3)) + np.array([0.03, 0.1])[
        :, None
    ] * rng.normal(size=(len(t), 2, 3))
    np.testing.assert_allclose(interpolation.reading_noise(t, y), [0.03, 0.1], rtol=0.25)


def test_a_grasp_is_from_touch_to_release_and_a_flicker_none() -> None:
    t = np.arange(0.0, 12.0, 0.01)
    size = np.linalg.norm(pushes(t), axis=2) + np.where((t > 9) & (t < 9.1), 2.0, 0.0)[:, None]
    (found,) = contact.find_grasps(contact.ContactParams(), t, size)
    assert (found.onset, found.end) == pytest.approx((4.05, 6.95), abs=0.03)


def test_a_sensor_whose_zero_jumped_does_not_go_on_holding_and_one_that_is_dead_lets_the_other_tell() -> (
    None
):
    t = np.arange(0.0, 12.0, 0.01)
    size = np.linalg.norm(pushes(t), axis=2)
    jumped = np.hstack([size + 0.5 * (t > 5.0)[:, None], size])
    for sizes in (jumped, jumped[:, ::-1]):
        (found,) = contact.find_grasps(contact.ContactParams(), t, sizes, 0)
        assert (found.onset, found.end) == pytest.approx((4.04, 6.98), abs=0.03)
    (found,) = contact.find_grasps(contact.ContactParams(), t, np.hstack([size, 0 * size]), 0)
    assert (found.onset, found.end) == pytest.approx((4.05, 6.95), abs=0.03)


def held(heading: float, n: int = 200) -> tuple[Tips, Array]:
    """Two tips that hold 0.3 kg between them; the second's heading is told wrong by `heading` rad. Also the true forces."""
    rng, t = np.random.default_rng(4), 0.02 * np.arange(n)
    forces = np.tile(np.array([[3.0, 1.0, 1.4], [-3.0, -1.0, 1.5]]), (n, 1, 1))
    true = np.tile(quat.normalize(rng.normal(size=(2, 4))), (n, 1, 1))
    told = true.copy()
    told[:, 1] = quat.multiply(quat.about(2, -heading), true[:, 1])
    inward = quat.conjugate(true)
    acc = quat.rotate(inward, np.array([0.0, 0.0, 9.80665])) + 0.02 * rng.normal(size=(n, 2, 3))
    read = quat.rotate(inward, forces) + 0.03 * rng.normal(size=(n, 2, 3))
    return Tips(t, told, read, acc, 0.01 * rng.normal(size=(n, 2, 3))), forces


@pytest.mark.parametrize("heading_deg", [-20.0, 6.0, 20.0])
def test_balance_of_the_forces_tells_how_the_tips_head_against_each_other(
    heading_deg: float,
) -> None:
    tips, forces = held(heading_deg * DEG)
    found = tip_orientation.correct_orientations(TipParams(tip_sd=15.0), tips)
    net = (
        quat.rotate(quat.multiply(quat.exp(found.turn), tips.q_GF), tips.force)
        .sum(axis=1)[100:]
        .mean(axis=0)
    )
    np.testing.assert_allclose(net, forces[0].sum(axis=0), atol=0.1)
    between = found.turn[100:, 1, 2].mean() - found.turn[100:, 0, 2].mean()
    assert between == pytest.approx(heading_deg * DEG, abs=2 * DEG)
    assert np.median(found.unbalanced) < 1.0
    tips.acc[150] = np.nan  # an instant at which no inertial sensor answered
    assert np.isnan(
        tip_orientation.correct_orientations(TipParams(tip_sd=15.0), tips).unbalanced
    ).nonzero()[0].tolist() == [150]


def test_how_the_tips_stand_against_each_other_is_as_sure_as_a_cuff_holds_its_sensors() -> None:
    """Force sensors sit 1 deg askew on their cuffs, and accelerometers are off by 0.1 m/s^2."""
    surprise = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        heading = 4 * DEG * rng.normal()
        tips, _ = held(heading, n=300)
        askew = quat.exp(DEG * rng.normal(size=(2, 3)))
        read = Tips(
            tips.t,
            tips.q_GF,
            quat.rotate(quat.conjugate(askew), tips.force),
            tips.acc + 0.1 * rng.normal(size=(2, 3)),
            tips.gyr,
        )
        found = tip_orientation.correct_orientations(TipParams(), read)
        true = quat.multiply(
            quat.multiply(quat.about(2, np.array([0.0, heading])), tips.q_GF[-1]), askew
        )
        told = quat.multiply(quat.exp(found.turn[-1]), tips.q_GF[-1])
        off = np.diff(quat.log(quat.multiply(true, quat.conjugate(told))), axis=0)[0]
        C = found.covariance[-1]
        surprise.append(
            off @ np.linalg.solve(C[:3, :3] + C[3:, 3:] - C[:3, 3:] - C[3:, :3], off) / 3
        )
    assert 0.3 < np.mean(surprise) < 2.0


def test_slopes_of_what_tells_how_the_tips_turn_are_differences() -> None:
    """Gravity of either tip and what both see alike, (6.14); the balance of the forces, (6.13)."""
    tips, _ = held(0.0, 4)
    params, h = TipParams(), 1e-6
    rows = tip_orientation._measurements(params, tips, 1, np.zeros(12))
    assert [len(missed) for missed, _, _ in rows] == [3, 3, 3, 3, 2]
    ahead, behind = (
        [tip_orientation._measurements(params, tips, 1, sign * dx) for dx in h * np.eye(12)]
        for sign in (1.0, -1.0)
    )
    slopes = [
        np.stack([(b[k][0] - a[k][0]) / (2 * h) for a, b in zip(ahead, behind)], axis=1)
        for k in range(5)
    ]
    for k, ((_, H, _), slope) in enumerate(zip(rows, slopes)):
        np.testing.assert_allclose(
            H, slope, atol=0.01 if k == 4 else 1e-6
        )  # N: that the two verticals are not quite one is left out of (6.13)


def test_what_twists_a_fingertip_is_told_wherever_it_is_touched() -> None:
    """M = r x F + m n with a force that leans by up to 40 deg; of who pushes with less than half a newton nothing."""
    rng = np.random.default_rng(0)
    n = rng.normal(size=(40, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    aside = np.cross(n, rng.normal(size=(40, 3)))
    size = np.linspace(0.1, 6.0, 40)[:, None]
    F, m = (
        size
        * (n + 0.8 * aside / np.linalg.norm(aside, axis=1, keepdims=True) * rng.random((40, 1))),
        rng.normal(0.0, 5e-3, 40),
    )
    M = np.cross(3e-3 * rng.normal(size=(40, 3)), F) + m[:, None] * n
    found, sd = fingertip_torques.fingertip_twist(F, M, np.full((40, 3), 2e-4), n)
    told = size[:, 0] > 0.5
    np.testing.assert_allclose(found[told], m[told], atol=1e-12)
    assert np.isnan(found[~told]).all()
    assert (sd[told] >= 2e-4 - 1e-12).all()


def test_a_force_that_nobody_measures_does_not_balance() -> None:
    tips, _ = held(0.0)
    pushed = Tips(tips.t, tips.q_GF, tips.force * np.array([[0.7], [1.0]]), tips.acc, tips.gyr)
    assert np.median(tip_orientation.correct_orientations(TipParams(), pushed).unbalanced) > 4.0


def oscillation(rng: np.random.Generator, n: int = 400) -> tuple[Array, Array, Array]:
    t = 0.02 * np.arange(n)
    H = np.stack([np.sin(3 * t), np.cos(3 * t)], axis=-1)[:, None]
    return t, H @ np.array([2.0, -0.5]) + 0.1 * rng.normal(size=(n, 1)), H


def test_recursive_least_squares_without_forgetting_ends_where_the_batch_does() -> None:
    t, y, H = oscillation(np.random.default_rng(0))
    sd = np.full(len(t), 0.1)
    state, track, spread = identification.run_recursive(
        identification.initial_state(np.ones(2)), t, y, H, sd
    )
    fit = identification.fit_least_squares(y, H, sd)
    np.testing.assert_allclose(state.theta, fit.theta, atol=1e-6)
    np.testing.assert_allclose(track[-1], fit.theta, atol=1e-6)
    np.testing.assert_allclose(
        np.diag(state.P), np.diag(np.linalg.inv(np.einsum("nmi,nmj->ij", H, H) / 0.01)), rtol=1e-4
    )
    first, _, _ = identification.run_recursive(
        identification.initial_state(np.ones(2)), t[:150], y[:150], H[:150], sd[:150]
    )
    again, _, _ = identification.run_recursive(first, t[150:], y[150:], H[150:], sd[150:])
    np.testing.assert_array_equal(again.theta, state.theta)
    assert spread[-1].max() < spread[10].min()


def test_recursive_least_squares_that_forgets_follows_a_change() -> None:
    t = 0.02 * np.arange(1000)
    y = np.where(t < 10, 0.3, 0.5)[:, None] * 9.81
    H = np.full((1000, 1, 1), 9.81)
    _, track, _ = identification.run_recursive(
        identification.initial_state(np.ones(1)), t, y, H, np.full(1000, 0.2), memory=1.0
    )
    assert track[499, 0] == pytest.approx(0.3, abs=1e-4)
    assert track[-1, 0] == pytest.approx(0.5, abs=1e-3)


def test_a_running_estimate_is_told_once_it_is_half_known_and_is_never_surer_than_what_errs_alike() -> (
    None
):
    """5 N/m^-1 s^2 of mass 0.5 with a noise of 4 N a sample: known to half of 0.5 after three samples at the earliest."""
    t = 0.02 * np.arange(400)
    H = np.full((400, 1, 1), 9.81)
    y = 0.5 * H[:, :, 0] + np.random.default_rng(4).normal(0.0, 4.0, (400, 1))
    told = identification.track_first_parameter(
        t, y, H, 4.0, np.ones(1), 1e9, lambda value: np.full(len(value), 0.03)
    )
    known = np.flatnonzero(np.isfinite(told.value))
    assert known[0] >= 2
    assert told.value[-1] == pytest.approx(0.5, abs=0.06)
    assert told.sd[-1] == pytest.approx(np.hypot(4.0 / 9.81 / 20.0, 0.03), rel=0.15)
    assert np.nanmin(told.sd) >= 0.03


def pushing(share: float) -> tuple[float, float]:
    """Thumb and index push with 6 N against each other along x and carry 2 N each; the index lacks a share of its push; scales err by 2 %, zeros by 0.05 N."""
    force = np.zeros((50, 2, 3))
    force[:, 0], force[:, 1] = [6.0, 0.0, 2.0], [-6.0 * (1 - share), 0.0, 2.0]
    acc = np.tile([0.0, 0.0, 9.81], (50, 2, 1))
    turns = np.tile(np.eye(6) * 0.05**2, (50, 1, 1))
    return force_balance.residual_along_push(force, acc, turns, np.full((50, 2), 0.05), 0.02)


def test_what_a_third_finger_carries_is_left_along_the_push_and_turned_tips_do_not_hide_it() -> (
    None
):
    rest, sd = pushing(0.1)
    assert rest == pytest.approx(0.6)
    assert sd == pytest.approx(
        np.sqrt(0.12**2 + 0.108**2 + 2 * 0.05**2 + 2 * (2.0 * 0.05) ** 2), rel=1e-3
    )
    assert pushing(0.0)[0] == pytest.approx(0.0, abs=1e-9)


def test_parameters_are_as_sure_as_they_say_where_samples_err_alike() -> None:
    surprise = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        t, y, H = oscillation(rng)
        alike = np.convolve(rng.normal(size=len(t) + 30), np.ones(12) / np.sqrt(12), "same")[15:-15]
        fit = identification.fit_least_squares(y + 0.3 * alike[:, None], H, np.full(len(t), 0.1))
        surprise.append(((fit.theta - [2.0, -0.5]) ** 2 / fit.sd**2).mean())
    assert 0.4 < np.mean(surprise) < 1.8
