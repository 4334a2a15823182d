"""Standard deviations of joint angles and fingertips from the covariances of the joints' rotations.

In      angles and rotations q_pc of all joints, covariances P (n, 6 chains, 9, 9) of the errors of
        their rotations, q_true = q exp(d); a sized hand
Out     standard deviations of angles (n, joints, 3) and of tips along the axes of WCS (n, 5, 3)
Source  derivatives of Salchow-Hoemmen 2019, (20)-(22) and (23)-(27); lengths: hand/length_covariance.py
"""

import math

import numpy as np

from handscope.estimators.finger_ekf.measurements import angle_jacobian_row
from handscope.estimators.hand.anatomy import JOINT
from handscope.estimators.hand.forward_kinematics import CHAIN_JOINTS
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import inlined, rowwise
from handscope.estimators.numerics.small_matrices import variance_of
from handscope.estimators.numerics.typing import Array

# (6 chains, 3) as kernels take them
JOINTS_OF: Array = np.vstack([CHAIN_JOINTS, np.full(3, JOINT["wrist"])]).astype(float)


def of_hand(
    angles: Array, q_pc: Array, P: Array, geometry: HandGeometry, of_lengths: Array
) -> tuple[Array, Array, Array]:
    """Standard deviations of all joint angles (also of forbidden ones) and of the tips, from fingers, wrist where measured, and lengths with covariance `of_lengths` (5, 6, 6); and the largest variance (n, 6 chains, 3 joints) of a rotation about any axis."""
    angles_sd, tips_sd, largest = _of_hand(
        JOINTS_OF, geometry.roots(), geometry.chain_offsets(), of_lengths, angles, q_pc, P
    )
    return angles_sd, tips_sd, largest


@inlined
def tip_row(q_WH: Array, q_pc: Array, root: Array, offsets: Array, J: Array, bones: Array) -> None:
    """A chain's bones (4, 3) in WCS, from wrist to tip, and the derivative J (3, 12) of the tip by the errors of its joints and the wrist.

    An error d of a frame, in that frame, moves the tip by -[arm]x R d.
    """
    R, arm, q, q_next = np.empty((4, 3, 3)), np.zeros(3), q_WH.copy(), np.empty(4)
    quat.matrix_row(q, arm, R[3])
    quat.rotate_row(q, root, bones[0])
    for j in range(3):
        quat.multiply_row(q, q_pc[j], q_next)
        for a in range(4):
            q[a] = q_next[a]
        quat.matrix_row(q, arm, R[j])
        quat.rotate_row(q, offsets[j], bones[j + 1])
    for k in range(
        3, -1, -1
    ):  # from the tip back; the frame that turns a bone is the joint's at its beginning
        j = k - 1 if k > 0 else 3
        for a in range(3):
            arm[a] += bones[k, a]
        for b in range(3):
            x, y, z = R[j, 0, b], R[j, 1, b], R[j, 2, b]
            J[0, 3 * j + b], J[1, 3 * j + b], J[2, 3 * j + b] = (
                y * arm[2] - z * arm[1],
                z * arm[0] - x * arm[2],
                x * arm[1] - y * arm[0],
            )


@rowwise("(c,k),(f,v),(f,k,v),(f,l,l),(j,a),(j,q),(c,e,e)->(j,a),(f,v),(c,k)")
def _of_hand(
    joints: Array, roots: Array, offsets: Array, of_lengths: Array, angles: Array, q_pc: Array, P: Array,
    angles_sd: Array, tips_sd: Array, largest: Array,
) -> None:  # fmt: skip
    C, J_tip, bones, q, places = (
        np.zeros((12, 12)),
        np.empty((3, 12)),
        np.empty((4, 3)),
        np.empty((4, 4)),
        np.empty((4, 3)),
    )
    J, own, C_own, of_root, by_length = (
        np.empty((3, 3)),
        np.empty(3),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty(6),
    )
    for a in range(4):  # an unknown wrist counts as neutral, as in forward kinematics
        q[3, a] = q_pc[0, a] if math.isfinite(q_pc[0, 0]) else (1.0 if a == 0 else 0.0)
    for c in range(joints.shape[0] - 1, -1, -1):  # the wrist's, the last, first
        for i in range(9):
            for k in range(9):
                C[i, k] = P[c, i, k]
        for j in range(3 if c < roots.shape[0] else 1):
            joint = int(joints[c, j])
            for a in range(3):
                own[a] = angles[joint, a]
                for k in range(3):
                    C_own[a, k] = C[3 * j + a, 3 * j + k]
            angle_jacobian_row(own, own, J)
            for a in range(3):
                angles_sd[joint, a] = math.sqrt(max(variance_of(J[a], C_own), 0.0))
        for j in range(3):
            largest[c, j] = max(C[3 * j, 3 * j], C[3 * j + 1, 3 * j + 1], C[3 * j + 2, 3 * j + 2])
            for a in range(4):
                q[j, a] = q_pc[int(joints[c, j]), a]
        if c == roots.shape[0]:
            for i in range(3):
                for k in range(3):
                    C[9 + i, 9 + k] = C[i, k] if math.isfinite(q_pc[0, 0]) else 0.0
            continue
        for a in range(3):
            places[3, a] = roots[c, a]
            for j in range(3):
                places[j, a] = offsets[c, j, a]
        tip_row(q[3], q, places[3], places, J_tip, bones)
        quat.matrix_row(q[3], own, of_root)
        for a in range(3):
            for k in range(3):
                by_length[k], by_length[3 + k] = of_root[a, k], bones[1 + k, a]
            tips_sd[c, a] = math.sqrt(
                variance_of(by_length, of_lengths[c]) + max(variance_of(J_tip[a], C), 0.0)
            )
