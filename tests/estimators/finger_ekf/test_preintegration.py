"""What sensors turn by between two updates of a chain's filter: derivatives of rotations and
sums."""

from collections.abc import Callable

import numpy as np
import pytest
from filterpy.kalman import predict

from handscope.estimators.finger_ekf import preintegration
from handscope.estimators.finger_ekf.kernel_params import KernelParams
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from tests.estimators.interpreted import interpreted


def _derivative(f: Callable[[Array], Array], size: int, step: float = 1e-6) -> Array:
    """Central differences: the last axis is that of the argument."""
    return np.stack([(f(e) - f(-e)) / (2 * step) for e in step * np.eye(size)], axis=-1)


def _ended(q_pc: Array, delta_q: Array) -> Array:
    """Rotations between sensors (..., 3, 4) once those have turned by (..., 4, 4)."""
    return quat.multiply(
        quat.multiply(quat.conjugate(delta_q[..., :3, :]), q_pc), delta_q[..., 1:, :]
    )


def _window(rng: np.random.Generator) -> tuple[Array, Array, Array, Array]:
    """Ten samples of fast and unequal turning of one chain's sensors with their biases in them:
    q_pc, turns, bias, times."""
    return (
        quat.normalize(rng.normal(size=(3, 4))),
        rng.normal(scale=0.1, size=(10, 4, 3)),
        rng.normal(scale=0.05, size=(4, 3)),
        rng.uniform(0.002, 0.02, (10, 4)),
    )


def _preintegrated(turns: Array, bias: Array, times: Array) -> tuple[Array, Array]:
    """What the sensors turned by over the window (4, 4), and its change by the biases (4, 3, 3)."""
    nothing = np.tile(quat.IDENTITY, (4, 1)), np.zeros((4, 3, 3)), np.zeros(4), np.zeros(4)
    after, J_bias, timed, _ = preintegration.preintegrate(
        turns, times, np.zeros((10, 4)), bias, *nothing
    )
    np.testing.assert_allclose(timed, times.sum(axis=0))
    return after[-1], J_bias


def _propagated(
    delta_q: Array,
    J_bias: Array,
    rotation_variance: Array,
    q_pc: Array,
    P: Array,
    mounting_walk: float = 0.0,
) -> tuple[Array, Array]:
    """Joints and covariance at the end of a window of 0.2 s, without any noise of the sensors; `mounting_walk` rad/sqrt(s)."""
    nothing = KernelParams(False, *np.zeros(7), False, *np.zeros(13))._replace(
        mounting_walk=mounting_walk
    )
    q_new, P_new = np.empty(q_pc.shape), np.empty(P.shape)
    interpreted(preintegration.propagate_row)(
        nothing, 0.2, delta_q.copy(), J_bias.copy(), rotation_variance, q_pc, P, q_new, P_new
    )
    return q_new, P_new


def test_the_covariance_goes_along_by_the_derivative_of_the_two_sided_update(
    rng: np.random.Generator,
) -> None:
    """21 errors put in before, 9 read off behind; what is correlated with all 21 then shows their
    transition F."""
    q_pc, turns, bias, times = _window(rng)
    delta_q, J_bias = _preintegrated(turns, bias, times)
    P = np.zeros((43, 43))
    P[:21, 21:42] = P[21:42, :21] = np.eye(21)
    q_new, P_new = _propagated(delta_q, J_bias, np.zeros(4), q_pc, P)

    def ended(errors: Array) -> Array:
        q = quat.multiply(q_pc, quat.exp(errors[:9].reshape(3, 3)))
        return quat.log(
            quat.relative(
                q_new, _ended(q, _preintegrated(turns, bias + errors[9:].reshape(4, 3), times)[0])
            )
        ).ravel()

    np.testing.assert_allclose(P_new[:9, 21:42], _derivative(ended, 21), atol=1e-7)
    np.testing.assert_allclose(q_new, _ended(q_pc, delta_q), atol=1e-14)


@pytest.mark.parametrize("sensor", range(4))
def test_what_a_sensor_may_have_missed_enters_as_the_derivative_says(
    sensor: int, rng: np.random.Generator
) -> None:
    q_pc, turns, bias, times = _window(rng)
    delta_q, J_bias = _preintegrated(turns, bias, times)
    rotation_variance = np.where(np.arange(4) == sensor, 1.0, 0.0)
    q_new, P_new = _propagated(delta_q, J_bias, rotation_variance, q_pc, np.zeros((43, 43)))

    def ended(error: Array) -> Array:
        wrong = delta_q.copy()
        wrong[sensor] = quat.multiply(delta_q[sensor], quat.exp(error))
        return quat.log(quat.relative(q_new, _ended(q_pc, wrong))).ravel()

    G = _derivative(ended, 3)
    np.testing.assert_allclose(P_new[:9, :9], G @ G.T, atol=1e-7)


def test_a_mounting_walks_about_the_axes_that_a_hinge_does_not_bend_about(
    rng: np.random.Generator,
) -> None:
    q_pc, turns, bias, times = _window(rng)
    window = _preintegrated(turns, bias, times)
    P = _random_covariance(rng, 43)
    (_, still), (_, walked) = (
        _propagated(*window, np.zeros(4), q_pc, P, mounting_walk) for mounting_walk in (0.0, 0.01)
    )
    added = np.diag(np.tile([0.01**2 * 0.2, 0.01**2 * 0.2, 0.0], 4))
    np.testing.assert_allclose((walked - still)[21:33, 21:33], added, atol=1e-12)
    assert not (walked - still)[:21].any()
    assert not (walked - still)[33:].any()


def _random_covariance(rng: np.random.Generator, size: int) -> Array:
    L = rng.normal(size=(size, size))
    return np.asarray(L @ L.T + 0.1 * np.eye(size))


def test_the_time_update_of_resting_sensors_is_filterpys(rng: np.random.Generator) -> None:
    """Sensors that do not turn: each joint's error goes on by its two sensors' biases."""
    span, P, F = 0.2, _random_covariance(rng, 43), np.eye(43)
    delta_q, J = np.tile(quat.IDENTITY, (4, 1)), np.tile(-span * np.eye(3), (4, 1, 1))
    q_pc, variances, G = (
        np.tile(quat.IDENTITY, (3, 1)),
        rng.uniform(0.1, 1.0, 4),
        np.zeros((43, 12)),
    )
    for j in range(3):
        rows = slice(3 * j, 3 * j + 3)
        F[rows, 9 + 3 * j : 12 + 3 * j], F[rows, 12 + 3 * j : 15 + 3 * j] = -J[j], J[j + 1]
        G[rows, 3 * j : 3 * j + 3], G[rows, 3 * j + 3 : 3 * j + 6] = -np.eye(3), np.eye(3)
    q_new, ours = _propagated(delta_q, J, variances, q_pc, P)
    Q = G @ np.diag(np.repeat(variances, 3)) @ G.T
    np.testing.assert_allclose(ours, predict(np.zeros(43), P, F, Q)[1], rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(q_new, q_pc, rtol=1e-10, atol=1e-10)
