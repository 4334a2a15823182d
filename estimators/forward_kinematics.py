"""Fingertips and segment orientations from joint rotations, by unit dual quaternions along wrist - hand - proximal - middle - distal.

In      q_pc (..., joints, 4) of hand_anatomy.JOINTS, a sized hand
Out     tips (..., 5, 3) in WCS, m; or segment orientations on the hand
Source  Salchow-Hoemmen 2019, (23)-(27)
"""

import numpy as np

from estimators import dual_quaternions as dual
from estimators import quaternions as quat
from estimators.hand_anatomy import CHAINS, FINGER_JOINTS, FINGERS, JOINT, SEGMENT, SEGMENTS
from estimators.hand_geometry import HandGeometry
from estimators.quaternions import Array

CHAIN_JOINTS = np.array([[JOINT[name] for name in FINGER_JOINTS[finger]] for finger in FINGERS])  # (5 fingers, 3 joints)
CHAIN_SEGMENTS = np.array([[SEGMENT[name] for name in CHAINS[finger]] for finger in FINGERS])  # (5 fingers, 3 segments)


def tips(q_pc: Array, geometry: HandGeometry) -> Array:
    """Ends of the distal bones (..., 5, 3) in the wrist frame; NaN where a joint of the chain is not known."""
    return dual.origin(_chain(q_pc, geometry)[-1])


def joint_places(q_pc: Array, geometry: HandGeometry) -> Array:
    """Distal ends of all chain segments (..., 5 fingers, 3 segments, 3) in the wrist frame, m; the last are the tips."""
    return np.stack([dual.origin(Q) for Q in _chain(q_pc, geometry)], axis=-2)


def segments_on(q_GH: Array, q_pc: Array) -> Array:
    """Orientations of all segments (..., segments, 4) from the hand's (..., 4) and the joints' rotations."""
    q = np.empty((*q_pc.shape[:-2], len(SEGMENTS), 4))
    q[..., SEGMENT["hand"], :] = q_GH
    q[..., SEGMENT["forearm"], :] = quat.multiply(q_GH, quat.conjugate(q_pc[..., JOINT["wrist"], :]))
    parent = q_GH[..., None, :]
    for k in range(3):
        parent = quat.multiply(parent, q_pc[..., CHAIN_JOINTS[:, k], :])
        q[..., CHAIN_SEGMENTS[:, k], :] = parent
    return q


def _chain(q_pc: Array, geometry: HandGeometry) -> list[Array]:
    """Dual quaternions from WCS to each segment of the chains, (..., 5, 8) for proximal, middle, distal."""
    wrist = (
        np.nan_to_num(q_pc[..., JOINT["wrist"], :], nan=0.0) + np.isnan(q_pc[..., JOINT["wrist"], :1]) * quat.IDENTITY
    )  # unknown wrist counts as neutral
    Q = dual.link(wrist[..., None, :], geometry.roots())  # (25), WCS to hand
    offsets, places = geometry.chain_offsets(), []
    for k in range(3):
        Q = dual.multiply(Q, dual.link(q_pc[..., CHAIN_JOINTS[:, k], :], offsets[:, k]))  # (23), (24)
        places.append(Q)
    return places
