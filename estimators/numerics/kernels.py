"""Rotations and 3 x 3 matrices of one row, as compiled kernels call them; what they give is new.

Convention  as of quaternions.py: q_ab (4,) takes vectors from b to a, rotation vectors in rad
"""

import math

import numpy as np

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.small_matrices import product
from handscope.estimators.numerics.typing import Array


@inlined
def rotation_matrix(q: Array) -> Array:
    """R (3, 3) of q (4,)."""
    R = np.empty((3, 3))
    quat.matrix_row(q, q, R)
    return R


@inlined
def rotate_by(q: Array, rotvec: Array, left: bool) -> Array:
    """q exp(rotvec), or exp(rotvec) q where `left`, of unit length."""
    angle = math.sqrt(rotvec[0] * rotvec[0] + rotvec[1] * rotvec[1] + rotvec[2] * rotvec[2])
    k = math.sin(0.5 * angle) / angle if angle > 1e-8 else 0.5
    a0, a1, a2, a3 = q[0], q[1], q[2], q[3]
    b0, b1, b2, b3 = math.cos(0.5 * angle), k * rotvec[0], k * rotvec[1], k * rotvec[2]
    s = -1.0 if left else 1.0  # the other order changes the sign of the cross product
    out = np.empty(4)
    out[0] = a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3
    out[1] = a0 * b1 + a1 * b0 + s * (a2 * b3 - a3 * b2)
    out[2] = a0 * b2 + a2 * b0 + s * (a3 * b1 - a1 * b3)
    out[3] = a0 * b3 + a3 * b0 + s * (a1 * b2 - a2 * b1)
    n = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2 + out[3] ** 2)
    for i in range(4):
        out[i] /= n
    return out


@inlined
def right_jacobian_row(v: Array, J: Array) -> None:
    """Fill J (3, 3) of v (3,): exp(v + dv) = exp(v) exp(J dv). Source: Sola et al. 2018, (143)."""
    x, y, z = v[0], v[1], v[2]
    sq = x * x + y * y + z * z
    angle = math.sqrt(sq)
    a = 0.5 - sq / 24 if sq < 1e-6 else (1 - math.cos(angle)) / sq
    b = 1 / 6 - sq / 120 if sq < 1e-6 else (angle - math.sin(angle)) / (sq * angle)
    J[0, 0], J[0, 1], J[0, 2] = 1 - b * (y * y + z * z), a * z + b * x * y, b * x * z - a * y
    J[1, 0], J[1, 1], J[1, 2] = b * x * y - a * z, 1 - b * (x * x + z * z), a * x + b * y * z
    J[2, 0], J[2, 1], J[2, 2] = a * y + b * x * z, b * y * z - a * x, 1 - b * (x * x + y * y)


@inlined
def skew(v: Array) -> Array:
    """[v]x (3, 3)."""
    S = np.zeros((3, 3))
    S[0, 1], S[0, 2], S[1, 0] = -v[2], v[1], v[2]
    S[1, 2], S[2, 0], S[2, 1] = -v[0], -v[1], v[0]
    return S


@inlined
def multiply_vector(A: Array, v: Array) -> Array:
    """A v (3,)."""
    out = np.empty(3)
    for i in range(3):
        out[i] = A[i, 0] * v[0] + A[i, 1] * v[1] + A[i, 2] * v[2]
    return out


@inlined
def multiply_transposed(A: Array, v: Array) -> Array:
    """A' v (3,)."""
    out = np.empty(3)
    for i in range(3):
        out[i] = A[0, i] * v[0] + A[1, i] * v[1] + A[2, i] * v[2]
    return out


@inlined
def multiply_matrices(A: Array, B: Array) -> Array:
    """A B (3, 3)."""
    out = np.empty((3, 3))
    product(A, B, out)
    return out


@inlined
def transpose(A: Array) -> Array:
    """A' (3, 3)."""
    out = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            out[i, j] = A[j, i]
    return out
