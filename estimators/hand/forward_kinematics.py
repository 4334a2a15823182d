"""Fingertips and segment orientations from joint rotations, by unit dual quaternions along wrist -
hand - proximal - middle - distal.

In      q_pc (..., joints, 4) of anatomy.JOINTS, a sized hand
Out     tips (..., 5, 3) in WCS, m; or segment orientations on the hand
Source  Salchow-Hoemmen 2019, (23)-(27)
"""

import numpy as np

from handscope.estimators.hand.anatomy import (
    CHAINS,
    FINGER_JOINTS,
    FINGERS,
    JOINT,
    SEGMENT,
    SEGMENTS,
)
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import dual_quaternions as dual
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import rowwise
from handscope.estimators.numerics.typing import Array

# (5 fingers, 3 joints)
CHAIN_JOINTS = np.array([[JOINT[name] for name in FINGER_JOINTS[finger]] for finger in FINGERS])
# (5 fingers, 3 segments)
CHAIN_SEGMENTS = np.array([[SEGMENT[name] for name in CHAINS[finger]] for finger in FINGERS])


def tips(q_pc: Array, geometry: HandGeometry) -> Array:
    """Ends of the distal bones (..., 5, 3) in the wrist frame; NaN where a joint of the chain is
    not known."""
    return joint_places(q_pc, geometry)[..., -1, :]


def joint_places(q_pc: Array, geometry: HandGeometry) -> Array:
    """Distal ends of all chain segments (..., 5 fingers, 3 segments, 3) in the wrist frame, m; the
    last are the tips."""
    q_wrist = q_pc[..., JOINT["wrist"], :]
    # an unknown wrist counts as neutral
    q_wrist = np.where(np.isfinite(q_wrist), q_wrist, quat.IDENTITY)
    return _places(
        q_wrist[..., None, :],
        q_pc[..., CHAIN_JOINTS, :],
        geometry.roots(),
        geometry.chain_offsets(),
    )


def segments_on(q_GH: Array, q_pc: Array) -> Array:
    """Orientations of all segments (..., segments, 4) from the hand's (..., 4) and the joints'
    rotations."""
    q = np.empty((*q_pc.shape[:-2], len(SEGMENTS), 4))
    q[..., SEGMENT["hand"], :] = q_GH
    q[..., SEGMENT["forearm"], :] = quat.multiply(
        q_GH, quat.conjugate(q_pc[..., JOINT["wrist"], :])
    )
    q[..., CHAIN_SEGMENTS, :] = _chain(q_GH[..., None, :], q_pc[..., CHAIN_JOINTS, :])
    return q


@rowwise("(q),(j,q),(v),(j,v)->(j,v)")
def _places(q_wrist: Array, q_pc: Array, root: Array, offsets: Array, places: Array) -> None:
    Q, link, both = np.empty(8), np.empty(8), np.empty(8)
    dual.link_row(q_wrist, root, Q, Q)  # (25), WCS to hand
    for j in range(q_pc.shape[0]):
        dual.link_row(q_pc[j], offsets[j], link, link)
        dual.multiply_row(Q, link, both)  # (23), (24)
        for a in range(8):
            Q[a] = both[a]
        dual.origin_row(Q, places[j], places[j])


@rowwise("(q),(j,q)->(j,q)")
def _chain(q_GH: Array, q_pc: Array, q: Array) -> None:
    quat.multiply_row(q_GH, q_pc[0], q[0])
    for j in range(1, q_pc.shape[0]):
        quat.multiply_row(q[j - 1], q_pc[j], q[j])


chain_row, places_row = _chain.row, _places.row  # as other kernels call them
