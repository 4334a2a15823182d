"""How sure a hand's filters are of its angles and tips: standard deviations from the covariances of the joints' rotations.

In      angles and rotations q_pc of all joints, covariances P (n, 6 chains, 9, 9) of the errors of their rotations, q_true = q exp(d); a sized hand
Out     standard deviations of angles (n, joints, 3) and of tips along the axes of WCS (n, 5, 3)
Source  derivatives of Salchow-Hoemmen 2019, (20)-(22) and (23)-(27)
Limits  lengths err each for itself, all by one share of themselves
"""

import math

import numpy as np

from estimators import quaternions as quat
from estimators.compiled import inlined, rowwise
from estimators.ekf_updates import angle_jacobian_row
from estimators.forward_kinematics import CHAIN_JOINTS
from estimators.hand_anatomy import JOINT
from estimators.hand_geometry import HandGeometry
from estimators.quaternions import Array
from estimators.small_matrices import block, variance_of

WRIST = JOINT["wrist"]


def of_angles(angles: Array, P: Array) -> Array:
    """Standard deviations of all joints' angles; finite for those that are no freedom, too."""
    found = np.empty(angles.shape)
    for j in range(3):
        own = P[:, :5, 3 * j : 3 * j + 3, 3 * j : 3 * j + 3]
        found[:, CHAIN_JOINTS[:, j]] = _angles_sd(angles[:, CHAIN_JOINTS[:, j]], own)
    found[:, WRIST] = _angles_sd(angles[:, WRIST], P[:, 5, :3, :3])
    return found


def of_tips(q_pc: Array, P: Array, geometry: HandGeometry, length_sd: float) -> Array:
    """Standard deviations of the tips: of the fingers' rotations, of the wrist's where it is measured, and of lengths, which err by the share `length_sd`."""
    measured = np.isfinite(q_pc[:, WRIST, :1])
    q_WH = np.where(measured, q_pc[:, WRIST], quat.IDENTITY)  # an unknown wrist counts as neutral, as in forward kinematics
    P_wrist = np.where(measured[..., None], P[:, 5, :3, :3], 0.0)
    lengths = geometry.roots(), geometry.chain_offsets(), length_sd
    return _tips_sd(q_WH[:, None], P_wrist[:, None], q_pc[:, CHAIN_JOINTS], P[:, :5], *lengths)


@inlined
def tip_row(q_WH: Array, q_pc: Array, root: Array, offsets: Array, J: Array, bones: Array) -> None:
    """A chain's bones (4, 3) in WCS, from the wrist to the tip, and how the tip changes with the errors of its joints' rotations and the wrist's, J (3, 12).

    What turns a frame by d in itself moves the tip by -[arm]x R d.
    """
    R, arm, q, turned = np.empty((4, 3, 3)), np.zeros(3), q_WH.copy(), np.empty(4)
    quat.matrix_row(q, arm, R[3])
    quat.rotate_row(q, root, bones[0])
    for j in range(3):
        quat.multiply_row(q, q_pc[j], turned)
        for a in range(4):
            q[a] = turned[a]
        quat.matrix_row(q, arm, R[j])
        quat.rotate_row(q, offsets[j], bones[j + 1])
    for k in range(3, -1, -1):  # from the tip back; the frame that turns a bone is the joint's at its beginning
        j = k - 1 if k > 0 else 3
        for a in range(3):
            arm[a] += bones[k, a]
        for b in range(3):
            x, y, z = R[j, 0, b], R[j, 1, b], R[j, 2, b]
            J[0, 3 * j + b], J[1, 3 * j + b], J[2, 3 * j + b] = y * arm[2] - z * arm[1], z * arm[0] - x * arm[2], x * arm[1] - y * arm[0]


@rowwise("(a),(a,a)->(a)")
def _angles_sd(angles: Array, P: Array, sd: Array) -> None:
    J, C = np.empty((3, 3)), P.copy()
    angle_jacobian_row(angles.copy(), angles, J)
    for a in range(3):
        sd[a] = math.sqrt(max(variance_of(J[a], C), 0.0))


@rowwise("(q),(v,v),(j,q),(e,e),(v),(j,v),()->(v)")
def _tips_sd(q_WH: Array, P_wrist: Array, q_pc: Array, P: Array, root: Array, offsets: Array, length_sd: float, sd: Array) -> None:
    J, bones, C = np.empty((3, 12)), np.empty((4, 3)), np.zeros((12, 12))
    block(1.0, P, 0, 0, C)
    block(1.0, P_wrist, 9, 9, C)
    tip_row(q_WH.copy(), q_pc.copy(), root.copy(), offsets.copy(), J, bones)
    for a in range(3):
        of_lengths = bones[0, a] ** 2 + bones[1, a] ** 2 + bones[2, a] ** 2 + bones[3, a] ** 2
        sd[a] = math.sqrt(length_sd * length_sd * of_lengths + max(variance_of(J[a], C), 0.0))
