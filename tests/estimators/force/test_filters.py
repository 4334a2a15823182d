"""The filters and smoothers of forces against filterpy on the same linear problems."""

import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise
from filterpy.kalman import predict, rts_smoother, update
from filterpy.stats import log_likelihood

from handscope.estimators.force import interpolation, zero
from handscope.estimators.numerics.typing import Array

NOISE = 0.04  # variance of one reading


@pytest.fixture
def readings(rng: np.random.Generator) -> tuple[Array, Array]:
    """60 readings (n, 3) at uneven times (n,)."""
    return np.cumsum(rng.uniform(0.02, 0.1, 60)), rng.normal(size=(60, 3))


def test_the_zero_of_a_force_sensor_and_its_smoother(readings: tuple[Array, Array]) -> None:
    t, y = readings
    used, drift = np.arange(len(t)) % 4 != 2, 0.3
    level, variance = zero._smooth_zero(t, y, used, NOISE, drift)
    R, Qs = np.array([[NOISE]]), [np.array([[drift * h]]) for h in np.diff(t)]
    x, P = np.zeros((len(t), 1, 3)), np.zeros((len(t), 1, 1))
    for axis in range(3):
        mean, covariance = np.zeros(1), np.array([[1e4]])
        for k in range(len(t)):
            if k:
                mean, covariance = predict(mean, covariance, np.eye(1), Qs[k - 1])
            seen = y[k, [axis]] if used[k] else None
            mean, covariance = update(mean, covariance, seen, R, np.eye(1))
            x[k, 0, axis], P[k] = mean[0], covariance
    x, P, _, _ = rts_smoother(x, P, [np.eye(1)] * len(t), Qs)
    np.testing.assert_allclose(level, x[:, 0], rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(variance, P[:, 0, 0], rtol=1e-10, atol=1e-10)


def test_the_likelihood_of_a_zero_that_walks(readings: tuple[Array, Array]) -> None:
    t, y = readings
    walks, ours, counts = np.array([0.1, 1.0]), [], np.full(len(t), 2.0)
    for walk in walks:
        x, P, total = y[0], np.array([[NOISE / 2]]), 0.0
        for k in range(1, len(t)):
            P = P + walk * (t[k] - t[k - 1])
            for axis in range(3):
                one = log_likelihood(y[k, [axis]], x[[axis]], P, np.eye(1), NOISE / 2)
                total += one + 0.5 * np.log(2 * np.pi)
            x, P = x + P[0, 0] / (P[0, 0] + NOISE / 2) * (y[k] - x), P * NOISE / 2 / (P + NOISE / 2)
        ours.append(total)
    np.testing.assert_allclose(
        zero._log_likelihood(t, y, counts, NOISE, walks), np.array(ours), rtol=1e-10, atol=1e-10
    )


def test_the_cubic_between_forces_and_its_smoother(readings: tuple[Array, Array]) -> None:
    t, y = readings
    # the prior variance of a rate, 1e4, leaves six digits fewer
    rate_walk = np.linspace(0.5, 2.0, len(t) - 1)
    x, P, joint = interpolation._smooth(t, y, NOISE, rate_walk)
    Fs = [np.array([[1.0, h], [0.0, 1.0]]) for h in np.diff(t)]
    Qs = [Q_continuous_white_noise(2, h, q) for h, q in zip(np.diff(t), rate_walk)]
    for axis in range(3):
        mean, covariance = np.array([y[0, axis], 0.0]), np.diag([NOISE, 1e4])
        means, covariances = [mean], [covariance]
        for k in range(1, len(t)):
            mean, covariance = predict(mean, covariance, Fs[k - 1], Qs[k - 1])
            R, H = np.array([[NOISE]]), np.array([[1.0, 0.0]])
            mean, covariance = update(mean, covariance, y[k, [axis]], R, H)
            means.append(mean)
            covariances.append(covariance)
        smoothed, both, gains, _ = rts_smoother(np.array(means), np.array(covariances), Fs, Qs)
        np.testing.assert_allclose(x[:, axis], smoothed, rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(P, both, rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(joint, gains[:-1] @ both[1:], rtol=1e-8, atol=1e-9)
