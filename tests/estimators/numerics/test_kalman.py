"""The measurement step that kernels share, against the textbook's."""

import numpy as np
import pytest
from filterpy.kalman import update
from filterpy.stats import NESS

from handscope.estimators.numerics import kalman, small_matrices
from handscope.estimators.numerics.typing import Array
from tests.estimators.interpreted import interpreted


def _covariance(rng: np.random.Generator, size: int) -> Array:
    L = rng.normal(size=(size, size))
    return np.asarray(L @ L.T + 0.1 * np.eye(size))


def test_a_correction_is_the_textbook_s_and_keeps_the_covariance_symmetric_to_the_last_bit(
    rng: np.random.Generator,
) -> None:
    before, H, noise, innovation, change = (
        _covariance(rng, 7),
        rng.normal(size=(4, 7)),
        _covariance(rng, 4),
        rng.normal(size=4),
        np.empty(7),
    )
    after = before.copy()
    interpreted(kalman.correct)(after, innovation, H, noise, change)
    K = before @ H.T @ np.linalg.inv(H @ before @ H.T + noise)
    np.testing.assert_allclose(change, K @ innovation, atol=1e-12)
    np.testing.assert_allclose(after, (np.eye(7) - K @ H) @ before, atol=1e-11)
    np.testing.assert_array_equal(after, after.T)


def test_rows_of_zeros_tell_nothing(rng: np.random.Generator) -> None:
    before, change = _covariance(rng, 5), np.empty(5)
    H = np.zeros((3, 5))
    H[1] = rng.normal(size=5)
    alone, all_rows, change_alone = before.copy(), before.copy(), np.empty(5)
    interpreted(kalman.correct)(alone, np.array([0.3]), H[1:2].copy(), np.eye(1), change_alone)
    interpreted(kalman.correct)(all_rows, np.array([0.0, 0.3, 0.0]), H, np.eye(3), change)
    np.testing.assert_array_equal(all_rows, alone)
    np.testing.assert_array_equal(change, change_alone)


def test_a_matrix_of_fewer_columns_sees_the_first_of_a_covariance(rng: np.random.Generator) -> None:
    A, P, found = rng.normal(size=(3, 4)), _covariance(rng, 6), np.empty((3, 3))
    interpreted(small_matrices.spread)(A, P, found)
    np.testing.assert_allclose(found, A @ P[:4, :4] @ A.T, atol=1e-12)


def test_a_correction_and_its_normalised_innovation_are_those_of_filterpy(
    rng: np.random.Generator,
) -> None:
    P, H, R, innovation, dx = (
        _covariance(rng, 12),
        rng.normal(size=(5, 12)),
        _covariance(rng, 5),
        rng.normal(size=5),
        np.empty(12),
    )
    mean, covariance, _, _, S, _ = update(np.zeros(12), P, innovation, R, H, return_all=True)
    ours = P.copy()
    nis = interpreted(kalman.correct)(ours, innovation, H, R, dx)
    np.testing.assert_allclose(dx, mean, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(ours, covariance, rtol=1e-10, atol=1e-10)
    (expected,) = NESS(innovation[None], np.zeros((1, 5)), S[None])
    assert nis == pytest.approx(expected, rel=1e-10)
