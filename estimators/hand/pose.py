"""How the hand stands: from rotations of its joints, or orientations of its segments, to angles,
segments and fingertips in one pass.

In      rotations q_pc (n, joints, 4) as sensors tell them, or orientations (n, segments, 4); NaN
        where not known; a sized hand
Out     angles, the joints' rotations with what they cannot do taken away, orientations of the
        segments on the hand, fingertips in WCS
Source  Salchow-Hoemmen 2019, (19)-(27), 2.4.3
"""

import math
from dataclasses import dataclass

import numpy as np

from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import CHILDREN, IS_DOF, JOINT, LIMITS, PARENTS, SEGMENT
from handscope.estimators.hand.forward_kinematics import (
    CHAIN_JOINTS,
    CHAIN_SEGMENTS,
    chain_row,
    places_row,
)
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import inlined, rowwise
from handscope.estimators.numerics.small_matrices import put
from handscope.estimators.numerics.typing import Array

# anatomy as kernels take it
_PARENTS, _CHILDREN, _FREE = PARENTS.astype(float), CHILDREN.astype(float), IS_DOF.astype(float)
_CHAIN_JOINTS, _CHAIN_SEGMENTS = CHAIN_JOINTS.astype(float), CHAIN_SEGMENTS.astype(float)
_WRIST, _FOREARM, _HAND = JOINT["wrist"], SEGMENT["forearm"], SEGMENT["hand"]


@dataclass(frozen=True)
class Pose:
    """Joint angles (rad), rotations, segment orientations and tips (m) of the hand."""

    angles: Array  # (n, joints, 3) rad, of every joint about all three axes
    freedoms: Array  # (n, joints, 3) rad, the same, NaN where the joint has no such freedom
    q_pc: Array  # (n, joints, 4) of those angles
    # (n, segments, 4) as the joints put them on the hand; where the chain to it is not known, as
    # told
    q_GS: Array
    tips: Array  # (n, 5, 3) m, in WCS


def joint_rotations(q_GB: Array) -> Array:
    """Rotations of the joints (n, joints, 4) between orientations of segments (n, segments, 4)."""
    return _joint_rotations(_PARENTS, _CHILDREN, q_GB)


def pose_hand(q_pc: Array, q_GB: Array, geometry: HandGeometry, constraints: bool) -> Pose:
    """The hand of joint rotations (n, joints, 4), oriented by q_GB (n, segments, 4); `constraints`: forbidden angles are removed."""
    anatomy = _FREE, LIMITS, _CHAIN_JOINTS, _CHAIN_SEGMENTS
    return Pose(
        *_pose_hand(
            float(constraints), *anatomy, geometry.roots(), geometry.chain_offsets(), q_pc, q_GB
        )
    )


@rowwise("(j),(j),(s,q)->(j,q)")
def _joint_rotations(parents: Array, children: Array, q_GB: Array, q_pc: Array) -> None:
    for j in range(parents.shape[0]):
        quat.relative_row(q_GB[int(parents[j])], q_GB[int(children[j])], q_pc[j])  # (19)


@inlined
def _copy_known(q: Array, to: Array) -> None:
    for a in range(4):
        if not math.isnan(q[a]):
            to[a] = q[a]


@rowwise("(),(j,a),(j,a,b),(f,k),(f,k),(f,v),(f,k,v),(j,q),(s,q)->(j,a),(j,a),(j,q),(s,q),(f,v)")
def _pose_hand(
    constraints: float, free: Array, limits: Array, joints: Array, segments: Array, roots: Array, offsets: Array, q_measured: Array, q_GB: Array,
    angles: Array, freedoms: Array, q_pc: Array, q_GS: Array, tips: Array,
) -> None:  # fmt: skip
    q_wrist, inverse, q_finger, chained, places = (
        np.empty(4),
        np.empty(4),
        np.empty((3, 4)),
        np.empty((3, 4)),
        np.empty((3, 3)),
    )
    for j in range(q_measured.shape[0]):
        joint_angles.decompose_row(q_measured[j], angles[j], angles[j])
        if constraints > 0:
            joint_angles.constrain_row(angles[j], free[j], limits[j], angles[j])
        joint_angles.compose_row(angles[j], q_pc[j], q_pc[j])
        for a in range(3):
            freedoms[j, a] = angles[j, a] if free[j, a] > 0 else math.nan
    put(q_GB, q_GS)
    for a in range(4):  # an unknown wrist counts as neutral
        q_wrist[a] = q_pc[_WRIST, a] if math.isfinite(q_pc[_WRIST, 0]) else (1.0 if a == 0 else 0.0)
    quat.conjugate_row(q_pc[_WRIST], inverse)
    quat.multiply_row(q_GB[_HAND], inverse, chained[0])
    _copy_known(chained[0], q_GS[_FOREARM])
    for f in range(joints.shape[0]):
        for k in range(joints.shape[1]):
            for a in range(4):
                q_finger[k, a] = q_pc[int(joints[f, k]), a]
        chain_row(q_GB[_HAND], q_finger, chained)
        places_row(q_wrist, q_finger, roots[f], offsets[f], places)
        for k in range(joints.shape[1]):
            _copy_known(chained[k], q_GS[int(segments[f, k])])
        for a in range(3):
            tips[f, a] = places[joints.shape[1] - 1, a]
