"""Dual quaternions against a plain rotation matrix and translation."""

import numpy as np
from hypothesis import given

from handscope.estimators.numerics import dual_quaternions as dual
from handscope.estimators.numerics import quaternions as quat
from tests.estimators.numerics.test_quaternions import rotations


def _places(shape: tuple[int, ...], count: int) -> list[np.ndarray]:
    rng = np.random.default_rng(1)
    return [rng.uniform(-1, 1, (*shape, 3)) for _ in range(count)]


def _translation(p_a: np.ndarray) -> np.ndarray:
    """Translation by p (..., 3) as a dual quaternion: Salchow-Hoemmen 2019, (15)."""
    Q = np.zeros((*p_a.shape[:-1], 8))
    Q[..., 0], Q[..., 5:] = 1.0, 0.5 * p_a
    return Q


@given(rotations(3))
def test_a_chain_equals_matrices_and_translations(q: tuple[np.ndarray, ...]) -> None:
    p = _places(q[0].shape[:-1], 4)
    Q, R, origin = (
        _translation(p[0]),
        np.broadcast_to(np.eye(3), (*q[0].shape[:-1], 3, 3)),
        p[0],
    )
    for q_ab, p_b in zip(q, p[1:]):
        Q = dual.multiply(dual.multiply(Q, dual.rotation(q_ab)), _translation(p_b))
        R = R @ quat.matrix(q_ab)
        origin = origin + (R @ p_b[..., None])[..., 0]
    np.testing.assert_allclose(dual.origin(Q), origin, atol=1e-14)
    np.testing.assert_allclose(
        dual.apply(Q, p[1]), origin + (R @ p[1][..., None])[..., 0], atol=1e-14
    )


@given(rotations(3))
def test_rigid_motions_chain_associatively(q: tuple[np.ndarray, ...]) -> None:
    p = _places(q[0].shape[:-1], 3)
    A, B, C = (dual.multiply(dual.rotation(a), _translation(b)) for a, b in zip(q, p))
    np.testing.assert_allclose(
        dual.multiply(dual.multiply(A, B), C), dual.multiply(A, dual.multiply(B, C)), atol=1e-14
    )


@given(rotations(1))
def test_a_link_is_a_rotation_and_behind_it_a_translation(q: tuple[np.ndarray, ...]) -> None:
    p_b = _places(q[0].shape[:-1], 1)[0]
    np.testing.assert_allclose(
        dual.link(q[0], p_b), dual.multiply(dual.rotation(q[0]), _translation(p_b)), atol=1e-15
    )
    np.testing.assert_allclose(
        dual.origin(dual.link(q[0], p_b)), quat.rotate(q[0], p_b), atol=1e-15
    )


@given(rotations(1))
def test_the_product_keeps_the_unit_constraint(q: tuple[np.ndarray, ...]) -> None:
    p = _places(q[0].shape[:-1], 2)
    Q = dual.multiply(dual.multiply(_translation(p[0]), dual.rotation(q[0])), _translation(p[1]))
    real, imaginary = Q[..., :4], Q[..., 4:]
    np.testing.assert_allclose((real * imaginary).sum(axis=-1), 0.0, atol=1e-15)
    np.testing.assert_allclose((real * real).sum(axis=-1), 1.0, atol=1e-14)


def test_a_point_of_a_translated_frame_moves_by_the_translation() -> None:
    np.testing.assert_array_equal(
        dual.apply(_translation(np.array([1.0, 2.0, 3.0])), np.array([0.5, 0.0, 0.0])),
        [1.5, 2.0, 3.0],
    )
