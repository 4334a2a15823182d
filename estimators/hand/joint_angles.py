"""Joint angles: intrinsic z-x'-y'' decomposition of a child segment's orientation on its parent.

In      q_pc (..., 4): takes vectors from child to parent
Out     angles (..., 3) rad: flexion about z, deviation about x', pronation about y''
Source  Salchow-Hoemmen 2019, (20)-(22); Valtin 2017, (3)-(5)
Limits  deviation of +-90 deg is singular (gimbal lock): flexion and pronation are then only known
        together
"""

import math

import numpy as np

from handscope.estimators.hand.anatomy import ANGLES as ANGLES
from handscope.estimators.hand.anatomy import (
    CHILDREN,
    DEVIATION,
    FLEXION,
    IS_DOF,
    LIMITS,
    PARENTS,
    PRONATION,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import rowwise
from handscope.estimators.numerics.typing import Array

_FREE: Array = IS_DOF.astype(float)  # as a kernel takes it


def decompose(q_pc: Array) -> Array:
    """Angles (..., 3) of rotations (..., 4)."""
    return _decompose(q_pc, quat.AXES)


def compose(angles: Array) -> Array:
    """Rotations q_pc (..., 4) of angles (..., 3): the inverse of `decompose`, written out."""
    return _compose(angles, quat.ROW)


def axes(angles: Array) -> Array:
    """Axes (..., 3, 3 angles), in the child's frame, about which each angle turns it at `angles`
    (..., 3): q(angles + da) = q(angles) exp(axes @ da)."""
    deviation, pronation = angles[..., DEVIATION], angles[..., PRONATION]
    cx, sx, cy, sy = np.cos(deviation), np.sin(deviation), np.cos(pronation), np.sin(pronation)
    found = np.zeros((*angles.shape, 3))
    found[..., FLEXION] = np.stack([-sy * cx, sx, cy * cx], axis=-1)
    found[..., DEVIATION] = np.stack([cy, np.zeros_like(cy), sy], axis=-1)
    found[..., 1, PRONATION] = 1.0
    return found


def of_segments(q_GS: Array) -> Array:
    """Angles of all joints (..., joints, 3) of segment orientations (..., segments, 4); NaN where
    either side is not known."""
    return decompose(quat.relative(q_GS[..., PARENTS, :], q_GS[..., CHILDREN, :]))


def constrain(angles: Array) -> Array:
    """Zero the angles that are no freedom of their joint and clip the others to the permitted
    range. Source: Salchow-Hoemmen 2019, 2.4.3."""
    return _constrain(angles, _FREE, LIMITS)


def mask_non_freedoms(angles: Array) -> Array:
    """NaN where a joint has no such freedom: what a Trajectory keeps."""
    return np.where(IS_DOF, angles, np.nan)


@rowwise("(q),(a)->(a)")
def _decompose(q: Array, row: Array, angles: Array) -> None:
    w, x, y, z = q[0], q[1], q[2], q[3]
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    angles[FLEXION] = math.atan2(2 * (w * z - x * y), ww - xx + yy - zz)  # (20)
    # (21), rounding may leave [-1, 1]
    angles[DEVIATION] = math.asin(min(max(2 * (w * x + y * z), -1.0), 1.0))
    angles[PRONATION] = math.atan2(2 * (w * y - x * z), ww - xx - yy + zz)  # (22)


@rowwise("(a),(q)->(q)")
def _compose(angles: Array, row: Array, q: Array) -> None:
    cz, cx, cy = (
        math.cos(0.5 * angles[FLEXION]),
        math.cos(0.5 * angles[DEVIATION]),
        math.cos(0.5 * angles[PRONATION]),
    )
    sz, sx, sy = (
        math.sin(0.5 * angles[FLEXION]),
        math.sin(0.5 * angles[DEVIATION]),
        math.sin(0.5 * angles[PRONATION]),
    )
    a, b, d, e = cz * cx, cz * sx, sz * sx, sz * cx  # q_z q_x = (a, b, d, e)
    q[0], q[1], q[2], q[3] = a * cy - d * sy, b * cy - e * sy, d * cy + a * sy, e * cy + b * sy


@rowwise("(a),(a),(a,b)->(a)")
def _constrain(angles: Array, free: Array, limits: Array, allowed: Array) -> None:
    for a in range(3):
        if free[a] == 0:
            allowed[a] = angles[a] * 0.0  # NaN stays NaN
        elif angles[a] < limits[a, 0]:
            allowed[a] = limits[a, 0]
        else:
            allowed[a] = limits[a, 1] if angles[a] > limits[a, 1] else angles[a]


# as other kernels call them
decompose_row, compose_row, constrain_row = (
    _decompose.row,
    _compose.row,
    _constrain.row,
)
