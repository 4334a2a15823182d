"""Unit dual quaternions: a rotation and a translation in one product.

Convention  Q_ab = [q_r, q_d] as one array (..., 8), real part first; takes points from frame b to
            frame a
Source      Salchow-Hoemmen 2019, 2.3, (7)-(16), after Leclercq et al. 2013
"""

import numpy as np

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import rowwise
from handscope.estimators.numerics.typing import Array

# of the length of a dual quaternion, where nothing that a compiled row takes has it
ROW = np.zeros(8)


def rotation(q_ab: Array) -> Array:
    """Pure rotation: (..., 4) -> (..., 8). (14)"""
    return np.concatenate([q_ab, np.zeros_like(q_ab)], axis=-1)


def link(q_ab: Array, p_b: Array) -> Array:
    """A rotation and behind it a translation by p_b (..., 3) in the turned frame, (14) times (15):
    (..., 8)."""
    return _link(q_ab, p_b, ROW)


def multiply(Q_ab: Array, Q_bc: Array) -> Array:
    """Chain two rigid motions: Q_ac (..., 8). (8)

    The paper prints the second dual term as q_Br q_Ad; the order must be q_Ad q_Br, quaternions do
    not commute.
    """
    return _multiply(Q_ab, Q_bc)


def apply(Q_ab: Array, p_b: Array) -> Array:
    """The operator L(p, Q): take points p_b (..., 3) to p_a (..., 3). (13)"""
    return quat.rotate(Q_ab[..., :4], p_b) + origin(Q_ab)


def origin(Q_ab: Array) -> Array:
    """Where b's origin lies in a, L(0, Q): (..., 8) -> (..., 3). (27)"""
    return _origin(Q_ab, quat.AXES)


@rowwise("(q),(v),(d)->(d)")
def _link(q: Array, p: Array, row: Array, Q: Array) -> None:
    x, y, z = 0.5 * p[0], 0.5 * p[1], 0.5 * p[2]
    Q[0], Q[1], Q[2], Q[3] = q[0], q[1], q[2], q[3]
    Q[4] = -q[1] * x - q[2] * y - q[3] * z
    Q[5] = q[0] * x + q[2] * z - q[3] * y
    Q[6] = q[0] * y - q[1] * z + q[3] * x
    Q[7] = q[0] * z + q[1] * y - q[2] * x


@rowwise("(d),(d)->(d)")
def _multiply(a: Array, b: Array, product: Array) -> None:
    product[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    product[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    product[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    product[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]
    product[4] = (
        a[0] * b[4]
        - a[1] * b[5]
        - a[2] * b[6]
        - a[3] * b[7]
        + a[4] * b[0]
        - a[5] * b[1]
        - a[6] * b[2]
        - a[7] * b[3]
    )
    product[5] = (
        a[0] * b[5]
        + a[1] * b[4]
        + a[2] * b[7]
        - a[3] * b[6]
        + a[4] * b[1]
        + a[5] * b[0]
        + a[6] * b[3]
        - a[7] * b[2]
    )
    product[6] = (
        a[0] * b[6]
        - a[1] * b[7]
        + a[2] * b[4]
        + a[3] * b[5]
        + a[4] * b[2]
        - a[5] * b[3]
        + a[6] * b[0]
        + a[7] * b[1]
    )
    product[7] = (
        a[0] * b[7]
        + a[1] * b[6]
        - a[2] * b[5]
        + a[3] * b[4]
        + a[4] * b[3]
        + a[5] * b[2]
        - a[6] * b[1]
        + a[7] * b[0]
    )


@rowwise("(d),(v)->(v)")
def _origin(Q: Array, row: Array, p: Array) -> None:
    p[0] = 2.0 * (-Q[4] * Q[1] + Q[5] * Q[0] - Q[6] * Q[3] + Q[7] * Q[2])
    p[1] = 2.0 * (-Q[4] * Q[2] + Q[5] * Q[3] + Q[6] * Q[0] - Q[7] * Q[1])
    p[2] = 2.0 * (-Q[4] * Q[3] - Q[5] * Q[2] + Q[6] * Q[1] + Q[7] * Q[0])


# for one row, as other kernels call them
link_row, multiply_row, origin_row = (
    _link.row,
    _multiply.row,
    _origin.row,
)
