"""The kernels of one row against the arithmetic of arrays."""

import numpy as np
import pytest

from handscope.estimators.numerics import kernels
from handscope.estimators.numerics import quaternions as quat
from tests.estimators.interpreted import interpreted

RNG = np.random.default_rng(5)
Q = quat.normalize(RNG.normal(size=4))
V = RNG.normal(size=3)
A, B = RNG.normal(size=(2, 3, 3))


def test_rotation_matrix_and_skew_are_those_of_arrays() -> None:
    np.testing.assert_array_equal(interpreted(kernels.rotation_matrix)(Q), quat.matrix(Q))
    np.testing.assert_array_equal(interpreted(kernels.skew)(V), quat.skew(V))


def test_products_are_those_of_linear_algebra() -> None:
    np.testing.assert_allclose(interpreted(kernels.multiply_vector)(A, V), A @ V, rtol=1e-14)
    np.testing.assert_allclose(interpreted(kernels.multiply_transposed)(A, V), A.T @ V, rtol=1e-14)
    np.testing.assert_allclose(interpreted(kernels.multiply_matrices)(A, B), A @ B, rtol=1e-13)
    np.testing.assert_array_equal(interpreted(kernels.transpose)(A), A.T)


@pytest.mark.parametrize("size", [0.0, 1e-9, 0.7])
def test_rotate_by_is_the_exponential_on_either_side(size: float) -> None:
    right, left = quat.multiply(Q, quat.exp(size * V)), quat.multiply(quat.exp(size * V), Q)
    np.testing.assert_allclose(
        interpreted(kernels.rotate_by)(Q, size * V, False), right, atol=1e-15
    )
    np.testing.assert_allclose(interpreted(kernels.rotate_by)(Q, size * V, True), left, atol=1e-15)


@pytest.mark.parametrize("size", [0.0, 1e-4, 2e-3, 0.7])
def test_right_jacobian_is_the_derivative_of_the_exponential(size: float) -> None:
    v, J, h = size * V, np.empty((3, 3)), 1e-6
    interpreted(kernels.right_jacobian_row)(v, J)
    numeric = [
        quat.log(quat.relative(quat.exp(v - h * e), quat.exp(v + h * e))) / (2 * h)
        for e in np.eye(3)
    ]
    np.testing.assert_allclose(J, np.transpose(numeric), atol=1e-8)
