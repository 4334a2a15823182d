"""A window that slides: what left it is remembered, lengths become known while it goes along."""

from dataclasses import replace

import numpy as np

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.self_calibration import normal_equations
from handscope.estimators.self_calibration.problem import Noise, Readings, parameter_columns
from handscope.estimators.self_calibration.sliding_window import (
    estimator as sliding_window_estimator,
)
from handscope.estimators.self_calibration.sliding_window.estimator import Window, WindowResult
from tests.estimators.self_calibration.fingers import HINGED, cold, lengths, readings, recorded

STRAIGHT = 10.0  # rad: nothing is known of a pose
NOISE = Noise(acc=0.02, hinge=0.3)


def part(read: Readings, start: int, stop: int) -> Readings:
    return Readings(
        read.dt,
        read.gyr[start:stop],
        read.acc[start:stop],
        read.gyr_doubt[start:stop],
        read.acc_doubt[start:stop],
    )


def begun(samples: int) -> tuple[Window, Readings]:
    """Somewhere in the movement, orientations known to 10 deg and off by some, arms off by some mm."""
    made, read = recorded(0, 8.0), readings(recorded(0, 8.0))
    _, guess = cold(made)
    turned = quat.multiply(
        guess.q_GS[200:201],
        quat.exp(np.radians([[3.0, -2, 1], [-2, 3, 2], [1, 1, -3], [2, -1, 2]])),
    )
    here = replace(guess, q_GS=turned, far=guess.far + 0.003, near=guess.near - 0.002)
    rest = part(read, 200, len(read))
    sd = np.full((4, 3), np.radians(10.0))
    return sliding_window_estimator.start_window(
        HINGED, NOISE, part(rest, 0, samples), here, sd, turned[0], False, made.hand, made.mounting
    ), rest


def gone(most: int, until: int, by: int = 10) -> WindowResult:
    window, rest = begun(by)
    slid = sliding_window_estimator.solve_window(window, most, 3, STRAIGHT)
    for k in range(by, until - by + 1, by):
        slid = sliding_window_estimator.solve_window(
            sliding_window_estimator.extend_window(slid.window, part(rest, k, k + by)),
            most,
            1,
            STRAIGHT,
        )
    return slid


def test_lengths_become_known() -> None:
    """Phalanges of 30 mm: artificial_finger."""
    slid = gone(50, 550)
    np.testing.assert_allclose(lengths(slid.window.at), [0.03, 0.03], atol=1.5e-3)
    assert len(slid.window.at.q_GS) == 50


def test_what_left_is_remembered() -> None:
    """A window of 30 samples finds the arms that one finds which keeps all, and is as sure of them; of that in which it was linearised earlier, nearly."""
    short, whole = gone(30, 120), gone(1000, 120)
    c = parameter_columns(HINGED)
    sd = [np.sqrt(np.diag(s.factor.covariance)) for s in (short, whole)]
    for of, found, expected in (
        (c.far, short.window.at.far, whole.window.at.far),
        (c.near, short.window.at.near, whole.window.at.near),
        (c.bias_acc, short.window.at.bias_acc, whole.window.at.bias_acc),
    ):
        assert (np.abs(found - expected).ravel() < sd[1][of]).all()
        assert 0.8 < np.median(sd[0][of] / sd[1][of]) < 1.1
        assert (sd[0][of] > 0.5 * sd[1][of]).all()


def test_a_samples_covariance_is_that_of_the_whole_inverse() -> None:
    window, _ = begun(8)
    slid = sliding_window_estimator.solve_window(window, 1000, 1, STRAIGHT)
    n, _, e, _ = slid.factor.L.shape
    P = slid.factor.Y.shape[2]
    root = np.zeros((n * e, n * e))
    for t in range(n):
        for ahead in range(min(normal_equations.SPAN, n - t)):
            root[(t + ahead) * e : (t + ahead + 1) * e, t * e : (t + 1) * e] = slid.factor.L[
                t, ahead
            ]
    Y = slid.factor.Y.reshape(n * e, P)
    whole = np.block(
        [[root @ root.T, root @ Y], [Y.T @ root.T, np.linalg.inv(slid.factor.covariance) + Y.T @ Y]]
    )
    scale = 1 / np.sqrt(np.diag(whole))
    inverse = np.linalg.inv(whole * np.outer(scale, scale)) * np.outer(scale, scale)
    kept = np.r_[(n - 3) * e : (n - 2) * e, n * e : n * e + P]
    expected = inverse[np.ix_(kept, kept)]
    sd = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        sliding_window_estimator.covariance(slid.factor, 3) / np.outer(sd, sd),
        expected / np.outer(sd, sd),
        atol=1e-4,
    )
