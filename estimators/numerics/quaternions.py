"""Unit quaternions as arrays: Hamilton, scalar first, any leading shape.

Convention  q_ab = [w, x, y, z] takes vectors from frame b to frame a; letters cancel: q_ac =
            multiply(q_ab, q_bc)
Shapes      quaternions (..., 4), vectors (..., 3), broadcast against each other
Exactness   every function is compiled for one row and runs over the leading axes, so the result of
            a row never depends on its neighbours: a recording cut anywhere gives the same bits
            (tests/estimators/numerics/test_quaternions.py)
"""

import math
from typing import Any

import numpy as np

from handscope.estimators.numerics.jit import rowwise
from handscope.estimators.numerics.typing import Array

IDENTITY: Array = np.array([1.0, 0.0, 0.0, 0.0])
# of the length of what a compiled row gives, where nothing that it takes has it
ROW, AXES = (
    np.zeros(4),
    np.zeros(3),
)


def multiply(q_ab: Array, q_bc: Array) -> Array:
    """Chain two rotations: q_ac (..., 4). Source: Salchow-Hoemmen 2019, (4)."""
    return _multiply(q_ab, q_bc)


def conjugate(q_ab: Array) -> Array:
    """The inverse rotation: q_ba (..., 4)."""
    return _conjugate(q_ab)


def relative(q_ga: Array, q_gb: Array) -> Array:
    """Orientation of b seen from a: q_ab = conj(q_ga) q_gb (..., 4). Source: Salchow-Hoemmen 2019,
    (19); Valtin 2017, (1)."""
    return _relative(q_ga, q_gb)


def rotate(q_ab: Array, v_b: Array) -> Array:
    """Take vectors from b to a: v_a (..., 3)."""
    return _rotate(q_ab, v_b)


def normalize(q: Array) -> Array:
    """Scale to unit norm (..., 4)."""
    return _normalize(q)


def exp(rotvec: Array) -> Array:
    """Quaternion of a rotation vector in rad: (..., 3) -> (..., 4)."""
    return _exp(rotvec, ROW)


def log(q: Array) -> Array:
    """Rotation vector in rad of the shorter way round: (..., 4) -> (..., 3)."""
    return _log(q, AXES)


def angle(q: Array) -> Array:
    """Size of the rotation in rad, in [0, pi]: (..., 4) -> (...)."""
    return _angle(q)


def about(axis: int, theta: Any) -> Array:
    """Rotation by theta (...) rad about coordinate axis 0, 1 or 2: (..., 4)."""
    half = 0.5 * np.asarray(theta, dtype=float)
    q = np.zeros((*half.shape, 4))
    q[..., 0], q[..., 1 + axis] = np.cos(half), np.sin(half)
    return q


def turn_heading(q_GS: Array, theta: Any) -> Array:
    """Turn q_GS (..., 4) by theta (...) rad about the global vertical: about(2, theta) times q_GS,
    at half its cost."""
    return _turn_heading(q_GS, theta)


def twist(q: Array, axis: int) -> Array:
    """Angle in rad of the part of q that turns about its own coordinate axis: (..., 4) -> (...), in
    [-pi, pi).

    About axis 2 of a rotation between two earth frames this is the heading between them.
    """
    return wrapped(2 * np.arctan2(q[..., 1 + axis], q[..., 0]))


def wrapped(angle: Array) -> Array:
    """The same angles (...), rad, in [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


def slerp(q_0: Array, q_1: Array, weight: Array) -> Array:
    """Interpolate along the great circle: weight (...) 0 gives q_0 exactly, 1 gives q_1 up to sign
    and rounding."""
    step = log(relative(q_0, q_1))
    between = multiply(q_0, exp(step * weight[..., None]))
    return np.where((weight == 0)[..., None], q_0, between)


def mean(q: Array) -> Array:
    """Average over the first axis, sign-independent: (n, 4) -> (4,). Source: Markley et al. 2007, J
    Guid Control Dyn 30:1193, (13)."""
    values, vectors = np.linalg.eigh(q.T @ q)
    best: Array = vectors[:, np.argmax(values)]
    return best * (1.0 if best[0] >= 0 else -1.0)


def matrix(q_ab: Array) -> Array:
    """Rotation matrix R_ab (..., 3, 3), v_a = R_ab v_b."""
    R: Array = _matrix(q_ab, AXES)
    return R


def from_matrix(R_ab: Array) -> Array:
    """Quaternion of rotation matrices (..., 3, 3) -> (..., 4), scalar part not negative."""
    R = np.asarray(R_ab, dtype=float)
    flat = R.reshape(-1, 3, 3)
    # the symmetric matrix whose largest eigenvector is q: Bar-Itzhack 2000
    k = np.empty((len(flat), 4, 4))
    k[:, 0, 0] = np.trace(flat, axis1=1, axis2=2)
    off = np.stack(
        [
            flat[:, 2, 1] - flat[:, 1, 2],
            flat[:, 0, 2] - flat[:, 2, 0],
            flat[:, 1, 0] - flat[:, 0, 1],
        ],
        axis=-1,
    )
    k[:, 0, 1:], k[:, 1:, 0] = off, off
    k[:, 1:, 1:] = flat + flat.transpose(0, 2, 1) - k[:, 0, 0, None, None] * np.eye(3)
    q = np.linalg.eigh(k)[1][:, :, -1]
    return (q * np.where(q[:, :1] < 0, -1.0, 1.0)).reshape(*R.shape[:-2], 4)


def cross(a: Array, b: Array) -> Array:
    """Cross product a x b of vectors (..., 3): the same bits as numpy's, at a fraction of its
    cost for few rows."""
    return _cross(a, b)


def skew(v: Array) -> Array:
    """Cross-product matrix (..., 3, 3): skew(v) @ u = v x u."""
    zero = np.zeros(v.shape[:-1])
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    return np.stack([_stack(zero, -z, y), _stack(z, zero, -x), _stack(-y, x, zero)], axis=-2)


def _stack(*parts: Array) -> Array:
    """One array of components that each lie together in memory: arithmetic with strides is
    slower."""
    out = np.empty((len(parts), *np.broadcast(*parts).shape))
    for k, part in enumerate(parts):
        out[k] = part
    return out.transpose(*range(1, out.ndim), 0)


@rowwise("(q),(q)->(q)")
def _multiply(a: Array, b: Array, product: Array) -> None:
    product[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    product[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    product[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    product[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]


@rowwise("(v),(v)->(v)")
def _cross(a: Array, b: Array, product: Array) -> None:
    product[0] = a[1] * b[2] - a[2] * b[1]
    product[1] = a[2] * b[0] - a[0] * b[2]
    product[2] = a[0] * b[1] - a[1] * b[0]


@rowwise("(q)->(q)")
def _conjugate(q: Array, inverse: Array) -> None:
    inverse[0], inverse[1], inverse[2], inverse[3] = q[0], -q[1], -q[2], -q[3]


@rowwise("(q),(q)->(q)")
def _relative(a: Array, b: Array, seen: Array) -> None:
    seen[0] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    seen[1] = a[0] * b[1] - a[1] * b[0] - a[2] * b[3] + a[3] * b[2]
    seen[2] = a[0] * b[2] + a[1] * b[3] - a[2] * b[0] - a[3] * b[1]
    seen[3] = a[0] * b[3] - a[1] * b[2] + a[2] * b[1] - a[3] * b[0]


@rowwise("(q),(v)->(v)")
def _rotate(q: Array, v: Array, turned: Array) -> None:
    w, x, y, z = q[0], q[1], q[2], q[3]
    tx, ty, tz = 2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])
    turned[0], turned[1], turned[2] = (
        v[0] + w * tx + y * tz - z * ty,
        v[1] + w * ty + z * tx - x * tz,
        v[2] + w * tz + x * ty - y * tx,
    )


@rowwise("(q)->(q)")
def _normalize(q: Array, unit: Array) -> None:
    n = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    unit[0], unit[1], unit[2], unit[3] = q[0] / n, q[1] / n, q[2] / n, q[3] / n


@rowwise("(v),(q)->(q)")
def _exp(rotvec: Array, row: Array, q: Array) -> None:
    x, y, z = rotvec[0], rotvec[1], rotvec[2]
    angle = math.sqrt(x * x + y * y + z * z)
    half = 0.5 * angle
    # sin(h)/angle = 1/2 - angle^2/48: the second term is below rounding
    k = (math.sin(half) if angle >= 1e-8 else 0.5) / (angle if angle >= 1e-8 else 1.0)
    q[0], q[1], q[2], q[3] = math.cos(half), k * x, k * y, k * z


@rowwise("(q),(v)->(v)")
def _log(q: Array, row: Array, rotvec: Array) -> None:
    x, y, z = q[1], q[2], q[3]
    sign = -1.0 if q[0] < 0 else 1.0
    n = math.sqrt(x * x + y * y + z * z)
    k = sign * 2 * (math.atan2(n, sign * q[0]) if n >= 1e-10 else 1.0) / (n if n >= 1e-10 else 1.0)
    rotvec[0], rotvec[1], rotvec[2] = k * x, k * y, k * z


@rowwise("(q)->()")
def _angle(q: Array, size: Array) -> None:
    size[0] = 2 * math.atan2(math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), abs(q[0]))


@rowwise("(q),()->(q)")
def _turn_heading(q: Array, theta: float, turned: Array) -> None:
    c, s = math.cos(0.5 * theta), math.sin(0.5 * theta)
    turned[0], turned[1] = c * q[0] - s * q[3], c * q[1] - s * q[2]
    turned[2], turned[3] = c * q[2] + s * q[1], c * q[3] + s * q[0]


@rowwise("(q),(v)->(v,v)")
def _matrix(q: Array, row: Array, R: Array) -> None:
    w, x, y, z = q[0], q[1], q[2], q[3]
    xx, yy, zz, xy, xz, yz, wx, wy, wz = (
        x * x,
        y * y,
        z * z,
        x * y,
        x * z,
        y * z,
        w * x,
        w * y,
        w * z,
    )
    R[0, 0], R[0, 1], R[0, 2] = 1 - 2 * (yy + zz), 2 * (xy - wz), 2 * (xz + wy)
    R[1, 0], R[1, 1], R[1, 2] = 2 * (xy + wz), 1 - 2 * (xx + zz), 2 * (yz - wx)
    R[2, 0], R[2, 1], R[2, 2] = 2 * (xz - wy), 2 * (yz + wx), 1 - 2 * (xx + yy)


# for one row, as other kernels call them
multiply_row, conjugate_row, rotate_row, normalize_row = (
    _multiply.row,
    _conjugate.row,
    _rotate.row,
    _normalize.row,
)
relative_row, log_row = _relative.row, _log.row
exp_row, log_row, angle_row, matrix_row = _exp.row, _log.row, _angle.row, _matrix.row
