"""The filter's derivatives against differences, its time update against a body that truly moves so."""

import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise, van_loan_discretization
from filterpy.kalman import predict, update

from handscope.estimators.magnet.tracker import state as mf
from handscope.estimators.magnet.tracker.inertial_updates import (
    Standstill,
    common_acceleration_update,
    gravity_update,
)
from handscope.estimators.magnet.tracker.latency import (
    ESTIMATED,
    MOTION,
    VELOCITY_MEMORY,
    Kinematics,
    copy_kinematics,
    predict_kinematics,
    smooth_velocity,
    start_kinematics,
    state_delayed,
)
from handscope.estimators.magnet.tracker.measurement_model import predict_delayed_reading
from handscope.estimators.magnet.tracker.options import MagnetParams, noise_model
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation import magnet as sim
from tests.estimators.interpreted import interpreted

RNG = np.random.default_rng(7)
VARIANCE = 0.04  # of one reading
NOISE = noise_model(MagnetParams(gyr_reading="instant"))


_sample = interpreted(mf.inertial_sample)
_predict_reading = interpreted(predict_delayed_reading)
_delayed = interpreted(state_delayed)
_smooth_velocity = interpreted(smooth_velocity)
_inject = interpreted(mf.inject_error)
_scalar_update = interpreted(mf.scalar_update)


def _propagate(x: Array, before: Array, now: Array, dt: float, F: Array) -> Array:
    """Readings (12,) at both ends."""
    ends = _sample(before), _sample(now)
    interval = mf.InertialInterval(*ends, dt, 1.0)
    return np.asarray(interpreted(mf.propagate_state)(NOISE, x, interval, F))


def _predict(kinematics: Kinematics, now: Array, dt: float) -> None:
    interpreted(predict_kinematics)(kinematics, _sample(now), dt)


def _propagate_covariance(
    s: mf.NoiseModel, P: Array, F: Array, dt: float, w_b: float, field: float
) -> None:
    interpreted(mf.propagate_covariance)(s, P, F, dt, mf.Movement(w_b, 0.0, 0.0, field, 1.0))


def _updated_errors(
    s: mf.NoiseModel, x: Array, P: Array, now: Array, base: bool, target: bool, dt: float
) -> Array:
    dx, sample = np.zeros(len(P)), _sample(now)
    if base or target:
        still = Standstill(base, target)
        interpreted(gravity_update)(s, x, P, dx, sample, still, False, dt)
    else:
        interpreted(common_acceleration_update)(s, x, P, dx, sample, dt)
    return np.asarray(_inject(x, dx))


def _state() -> Array:
    """Of a trunk with two magnetometers."""
    x = 0.1 * RNG.normal(size=57)
    x[mf.STATE.moment : mf.STATE.moment + 6] = [0.1, -0.2, 0.25, 0.01, 0.03, 0.0]
    x[mf.STATE.gradients : mf.STATE.residuals + 6] *= 1e-5
    x[mf.STATE.residuals + 6 :] = [0.0, 0.0, 0.0, -0.1, -0.1, 0.0, 0.07]
    x[0:3] = [-0.05, 0.1, 0.2]
    x[mf.STATE.B_g : mf.STATE.B_g + 3] = [1e-6, 18e-6, -46e-6]
    for at in (mf.STATE.q_bt, mf.STATE.q_gb):
        x[at : at + 4] = quat.normalize(RNG.normal(size=4))
    return x


def _moving(magnetometers: int) -> Kinematics:
    """Rates, their changes, and forces of ten times the size."""
    kinematics = start_kinematics(magnetometers)._replace(latency_mode=ESTIMATED)
    kinematics.motion[:] = RNG.normal(size=kinematics.motion.shape)
    kinematics.motion[[MOTION.f_b, MOTION.f_t]] *= 10
    return kinematics


def _difference(x: Array, other: Array) -> Array:
    """The error (55,) that takes x to the other state."""
    plain = other - x
    turns = (
        quat.log(quat.relative(x[a : a + 4], other[a : a + 4]))
        for a in (mf.STATE.q_bt, mf.STATE.q_gb)
    )
    th, thg = turns
    return np.concatenate(
        [plain[0:6], th, plain[mf.STATE.B_g : mf.STATE.B_g + 9], thg, plain[mf.STATE.gyr_bias_b :]]
    )


def test_slopes_of_the_time_update_are_differences() -> None:
    before, now, dt, h = RNG.normal(size=12), RNG.normal(size=12), 1 / 60, 1e-5
    before[[3, 4, 5, 9, 10, 11]] *= 10
    now[[3, 4, 5, 9, 10, 11]] *= 10
    x, F, other = _state(), np.zeros((30, 30)), np.zeros((30, 30))
    _propagate(x, before, now, dt, F)
    for k in range(30):
        dx = np.zeros(55)
        dx[k] = h
        ahead = _propagate(_inject(x, dx), before, now, dt, other)
        behind = _propagate(_inject(x, -dx), before, now, dt, other)
        # a force in the middle of the sample and a turn over half of it are told to first order in dt
        np.testing.assert_allclose(F[:, k], _difference(behind, ahead)[:30] / (2 * h), atol=4e-3)


def test_slopes_of_a_magnetometer_are_differences() -> None:
    """Of one that is 62 ms late and read 8 ms ago, while trunk and hand turn and speed up."""
    x, H, none, kinematics = (
        _state(),
        np.zeros((3, 55)),
        np.zeros((3, 55)),
        _moving(2),
    )
    x[-1], kinematics.age[:] = 0.062, [0.0, 0.008]
    kinematics.motion[MOTION.v_bt] = x[3:6]
    _predict_reading(x, kinematics, 1, H)
    assert np.linalg.norm(H[:, mf.ERROR.moment : mf.ERROR.moment + 3]) > 1e-6
    biases = [
        k
        for first in (
            mf.ERROR.gyr_bias_t,
            mf.ERROR.acc_bias_t,
            mf.ERROR.gyr_bias_b,
            mf.ERROR.acc_bias_b,
        )
        for k in range(first, first + 3)
    ]  # left out: over 70 ms they move nothing
    for k in np.setdiff1d(range(55), biases):
        dx = np.zeros(55)
        dx[k] = h = (
            1e-9
            if mf.ERROR.B_g <= k < mf.ERROR.gyr_bias_t
            or mf.ERROR.residuals <= k < mf.ERROR.residuals + 6
            else 1e-5
        )
        ahead, behind = (_predict_reading(_inject(x, d), kinematics, 1, none) for d in (dx, -dx))
        # rates that change make turns that do not commute: told to first order in the change
        np.testing.assert_allclose(
            H[:, k], (ahead - behind) / (2 * h), rtol=1e-4, atol=4e-6 if k == 54 else 1e-9
        )


def _gravity(x: Array) -> tuple[Array, Array]:
    """What accelerometers of base and target read at rest."""
    g_b = quat.rotate(
        quat.conjugate(x[mf.STATE.q_gb : mf.STATE.q_gb + 4]), np.array([0.0, 0.0, NOISE.gravity])
    )
    return g_b + x[mf.STATE.acc_bias_b : mf.STATE.acc_bias_b + 3], quat.rotate(
        quat.conjugate(x[mf.STATE.q_bt : mf.STATE.q_bt + 4]), g_b
    ) + x[mf.STATE.acc_bias_t : mf.STATE.acc_bias_t + 3]


@pytest.mark.parametrize("which", ["base", "target", "common"])
def test_slopes_of_the_accelerometers_are_differences(which: str) -> None:
    """(5.16) of base and target, (5.17). Errors of which little is expected go by slope times what is missed: two readings tell the slope."""
    x, dt, sure, h = _state(), 1 / 60, 1e-4, 1e-5
    x[mf.STATE.acc_bias_t : mf.STATE.acc_bias_t + 3] *= 0.1
    x[mf.STATE.acc_bias_b : mf.STATE.acc_bias_b + 3] *= 0.1
    rest = np.concatenate(
        [
            x[mf.STATE.gyr_bias_b : mf.STATE.gyr_bias_b + 3],
            _gravity(x)[0],
            x[mf.STATE.gyr_bias_t : mf.STATE.gyr_bias_t + 3],
            _gravity(x)[1],
        ]
    )
    common = rest[3:6] * 1.2  # both are pushed alike: neither reads gravity
    if which == "common":
        rest[3:6], rest[9:12] = common, _carried(x, common)
    at = 3 if which == "base" else 9
    predicted = {
        "base": lambda s: _gravity(s)[0],
        "target": lambda s: _gravity(s)[1],
        "common": lambda s: _carried(s, common),
    }[which]
    sd = NOISE.acc_moving + 0.1 * np.linalg.norm(common) if which == "common" else NOISE.acc_still
    weight = sd**2 * NOISE.acc_correlation_time / dt / sure**2
    for axis in range(3):
        pushed = rest.copy()
        pushed[at + axis] += 0.05
        here, there = (
            _difference(
                x,
                _updated_errors(
                    NOISE, x, sure**2 * np.eye(55), now, which == "base", which == "target", dt
                ),
            )
            for now in (rest, pushed)
        )
        numeric = [
            (predicted(_inject(x, dx)) - predicted(_inject(x, -dx)))[axis] / (2 * h)
            for dx in h * np.eye(55)
        ]
        np.testing.assert_allclose(weight * (there - here) / 0.05, numeric, atol=2e-3)


def _carried(x: Array, f_b: Array) -> Array:
    """What the target's accelerometer reads of the specific force that the base's reads as f_b (3,)."""
    return (
        quat.rotate(
            quat.conjugate(x[mf.STATE.q_bt : mf.STATE.q_bt + 4]),
            f_b - x[mf.STATE.acc_bias_b : mf.STATE.acc_bias_b + 3],
        )
        + x[mf.STATE.acc_bias_t : mf.STATE.acc_bias_t + 3]
    )


def test_the_covariance_is_carried_as_one_matrix() -> None:
    """Against F P F' + Q of all 55 errors at once, without the noise of trunk and hand."""
    still = NOISE._replace(
        gyr=0.0,
        gyr_moving=0.0,
        acc=0.0,
        acc_slow=0.0,
        field_walk=0.0,
        gyr_walk=0.0,
        acc_walk=0.0,
        acc_turned=0.0,
    )
    A = RNG.normal(size=(55, 55))
    P, F, turned = A @ A.T, np.eye(30) + 0.1 * RNG.normal(size=(30, 30)), 0.05
    share = np.ones(55)
    share[mf.ERROR.residuals : mf.ERROR.residuals + 6] = np.exp(
        -turned / NOISE.mag_correlation_angle
    )
    share[mf.ERROR.gradients : mf.ERROR.gradients + 5] = np.exp(-1 / 60 / mf.GRADIENT_TIME)
    renewed = np.where(share < 1.0, NOISE.mag_residual, 0.0)
    renewed[mf.ERROR.gradients : mf.ERROR.gradients + 5] = NOISE.gradient
    whole = np.diag(share)
    whole[:30, :30] = F
    expected = whole @ P @ whole.T + np.diag(renewed**2 * (1 - share**2))
    expected[mf.ERROR.B_g, mf.ERROR.B_g] += 2.0**2 * (1 - F[mf.ERROR.B_g, mf.ERROR.B_g] ** 2)
    _propagate_covariance(still, P, F, 1 / 60, 60 * turned, 2.0)
    np.testing.assert_allclose(P, expected, rtol=1e-12, atol=1e-12)


def test_a_turn_in_one_go_makes_of_gravity_what_scales_and_axes_do() -> None:
    """Half a radian moves half of gravity along the axes: 0.3 % of that."""
    P = np.zeros((49, 49))
    _propagate_covariance(NOISE._replace(acc_walk=0.0), P, np.eye(30), 1.0, 0.5, 0.0)
    assert np.sqrt(P[mf.ERROR.acc_bias_b, mf.ERROR.acc_bias_b]) == pytest.approx(
        MagnetParams().acc_share * GRAVITY * 0.5, rel=1e-9
    )


@pytest.mark.parametrize("name", sim.CONDITIONS)
def test_a_movement_without_errors_is_followed_by_the_time_update_alone(name: str) -> None:
    """Trunk and hand turn at once: (5.22) as printed, without the trunk's turning, would be off by decimetres after these five seconds. And led back."""
    m = sim.simulate_condition(name, np.random.default_rng(3), seconds=8.0, rate=240.0)
    samples = np.concatenate(
        [m.w, quat.rotate(quat.conjugate(m.q), m.a + [0, 0, 9.80665])], axis=-1
    ).reshape(len(m.t), 12)
    x, F, k = _state(), np.zeros((30, 30)), 3 * 240
    x[: mf.STATE.moment] = 0.0
    x[0:3], x[mf.STATE.q_bt : mf.STATE.q_bt + 4], x[mf.STATE.q_gb : mf.STATE.q_gb + 4] = (
        m.p_bt[k],
        m.q_bt[k],
        m.q[k, 0],
    )
    R = quat.conjugate(m.q[k, 0])
    x[3:6] = (
        quat.rotate(R, ((m.p[k + 1] - m.p[k - 1]) @ np.eye(3))[1] - (m.p[k + 1] - m.p[k - 1])[0])
        * 120.0
    )
    speed = quat.rotate(
        quat.conjugate(m.q[:, 0]), np.gradient(m.p[:, 0], 1 / 240, axis=0, edge_order=2)
    )
    x[mf.STATE.v_b : mf.STATE.v_b + 3] = speed[k]
    for i in range(k + 1, len(m.t)):
        x = _propagate(x, samples[i - 1], samples[i], 1 / 240, F)
    assert np.linalg.norm(x[mf.STATE.v_b : mf.STATE.v_b + 3] - speed[-1]) < 2e-3
    assert np.linalg.norm(x[0:3] - m.p_bt[-1]) < 2e-3
    assert (
        np.degrees(quat.angle(quat.relative(x[mf.STATE.q_bt : mf.STATE.q_bt + 4], m.q_bt[-1])))
        < 0.05
    )
    kinematics, x[-1] = start_kinematics(2), 0.1
    for i in range(-240, 0):
        _predict(kinematics, samples[i], 1 / 240 if i > -240 else 0.0)
    then, k = _delayed(x, kinematics.motion), -1 - 24
    assert np.linalg.norm(then[0:3] - m.p_bt[k]) < 6e-3
    assert (
        np.degrees(quat.angle(quat.relative(then[mf.STATE.q_bt : mf.STATE.q_bt + 4], m.q_bt[k])))
        < 0.5
    )
    assert (
        np.degrees(
            quat.angle(
                quat.relative(
                    quat.relative(
                        x[mf.STATE.q_gb : mf.STATE.q_gb + 4],
                        then[mf.STATE.q_gb : mf.STATE.q_gb + 4],
                    ),
                    quat.relative(m.q[-1, 0], m.q[k, 0]),
                )
            )
        )
        < 0.5
    )


def test_the_velocity_that_slopes_take_turns_with_the_trunk_and_is_not_that_of_a_lost_hand() -> (
    None
):
    x, kinematics, v, dt = _state(), start_kinematics(2), RNG.normal(size=3), 1 / 60
    x[mf.STATE.gyr_bias_b : mf.STATE.gyr_bias_b + 3], kinematics.motion[MOTION.w_b] = (
        0.0,
        [0.0, 0.0, 3.0],
    )
    deviation = kinematics.motion[MOTION.v_bt] - v
    for known, share in ((0.04, np.exp(-dt / VELOCITY_MEMORY)), (0.2, 0.0)):
        smoothed = copy_kinematics(kinematics)
        _smooth_velocity(smoothed, x, np.eye(55) * known**2, v, dt)
        np.testing.assert_allclose(
            smoothed.motion[MOTION.v_bt] - x[3:6],
            share * quat.rotate(quat.about(2, -3.0 * dt), deviation),
            atol=1e-12,
        )


def _random_covariance(rng: np.random.Generator, size: int) -> Array:
    L = rng.normal(size=(size, size))
    return np.asarray(L @ L.T + 0.1 * np.eye(size))


def test_a_scalar_measurement_is_filterpys(rng: np.random.Generator) -> None:
    P, H, dx = _random_covariance(rng, 12), rng.normal(size=12), rng.normal(size=12)
    mean, covariance = update(dx, P, np.array([0.3]), np.array([[VARIANCE]]), H[None])
    _scalar_update(P, dx, H, 0.3, VARIANCE)
    np.testing.assert_allclose(dx, mean, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(P, covariance, rtol=1e-10, atol=1e-10)


def test_the_time_update_is_filterpys(rng: np.random.Generator) -> None:
    """Nothing turns, so constant errors keep their correlations, and no bias walks by a turn."""
    dt, size = 0.01, mf.OWN + 6
    P, F = _random_covariance(rng, size), np.eye(size)
    F[: mf.OWN, : mf.OWN] += 0.1 * rng.normal(size=(mf.OWN, mf.OWN))
    own, Q = np.ascontiguousarray(F[: mf.OWN, : mf.OWN]), np.zeros((size, size))
    _propagate_covariance(NOISE, Q, own, dt, 0.0, 0.0)
    ours = P.copy()
    _propagate_covariance(NOISE, ours, own, dt, 0.0, 0.0)
    np.testing.assert_allclose(ours, predict(np.zeros(size), P, F, Q)[1], rtol=1e-10, atol=1e-10)
    free = np.eye(mf.OWN)
    Q[:] = 0.0
    _propagate_covariance(NOISE, Q, free, dt, 0.0, 0.0)
    density = 2 * (NOISE.acc**2 + NOISE.acc_slow**2)
    walk = [mf.ERROR.p_bt, mf.ERROR.v_bt]
    np.testing.assert_allclose(
        Q[np.ix_(walk, walk)], Q_continuous_white_noise(2, dt, density), rtol=1e-10, atol=1e-10
    )
    G = np.array([[0.0], [np.sqrt(density)]])
    np.testing.assert_allclose(
        Q[np.ix_(walk, walk)],
        van_loan_discretization(np.array([[0.0, 1.0], [0.0, 0.0]]), G, dt)[1],
        rtol=1e-10,
        atol=1e-10,
    )
