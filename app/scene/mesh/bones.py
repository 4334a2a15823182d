"""The bones that carry the skin: one for every segment, and one half way in every joint, so that a bent joint keeps its roundness.

In      joint angles (joints, 3) rad, a sized hand
Out     how far each bone is turned from the pose in which the skin was bound, and where its joint is, in the hand's frame from the wrist
Source  the half-way bone: Mohr & Gleicher 2003, ACM Trans Graphics 22:562 (joints added to halve the loss of volume of linear blending)
"""

import numpy as np

from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import CHAINS, FINGER_JOINTS, FINGERS, JOINT, JOINTS
from handscope.estimators.hand.forward_kinematics import CHAIN_JOINTS
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

BONES = (
    "hand",
    "forearm",
    "wrist_half",
    *(f"{joint}_half" for finger in FINGERS for joint in FINGER_JOINTS[finger]),
    *(segment for finger in FINGERS for segment in CHAINS[finger]),
)
BONE = {name: k for k, name in enumerate(BONES)}

_BOUND_DEG = {  # flexion, deviation, pronation while the skin is bound: fingers fanned and the thumb off the palm, so that no surfaces touch
    "index_mcp": (12.0, -7.0, 0.0),
    "middle_mcp": (12.0, 0.0, 0.0),
    "ring_mcp": (12.0, 6.0, 0.0),
    "little_mcp": (12.0, 14.0, 0.0),
    "thumb_cmc": (22.0, -32.0, 60.0),
}
# (joints, 3)
BOUND: Array = np.radians([_BOUND_DEG.get(joint.name, (0.0, 0.0, 0.0)) for joint in JOINTS])


def chain(angles: Array, geometry: HandGeometry) -> tuple[Array, Array]:
    """Orientations (..., 5 fingers, 3 segments, 4) of the finger segments on the hand, and places (..., 5, 3, 3) of their proximal joints, m."""
    q_joint = joint_angles.compose(angles[..., CHAIN_JOINTS, :])
    fingers = q_joint.shape[:-2]
    offsets, place = geometry.chain_offsets(), np.broadcast_to(geometry.roots(), (*fingers, 3))
    q, orientations, places = np.broadcast_to(quat.IDENTITY, (*fingers, 4)), [], []
    for k in range(3):
        places.append(place)
        q = quat.multiply(q, q_joint[..., k, :])
        orientations.append(q)
        place = place + quat.rotate(q, offsets[:, k])
    return np.stack(orientations, axis=-2), np.stack(places, axis=-2)


def tips(angles: Array, geometry: HandGeometry) -> Array:
    """Where the fingers end (..., 5, 3) in the hand's frame, m, of angles (..., joints, 3), all known."""
    q, places = chain(angles, geometry)
    return np.asarray(places[..., 2, :] + quat.rotate(q[..., 2, :], geometry.chain_offsets()[:, 2]))


def rest(geometry: HandGeometry) -> Array:
    """Where the bones' joints are while the skin is bound (bones, 3), m."""
    _, places = chain(BOUND, geometry)
    return _bone_places(places)


def pose(angles: Array, geometry: HandGeometry) -> tuple[Array, Array]:
    """How far each bone is turned from the bound pose (..., bones, 4), and where its joint is (..., bones, 3), m, from angles (..., joints, 3), all known."""
    q, places = chain(angles, geometry)
    turned = quat.multiply(q, quat.conjugate(_BOUND_CHAIN))  # (..., 5, 3, 4)
    several = turned.shape[:-3]
    parents = np.concatenate(
        [np.broadcast_to(quat.IDENTITY, (*several, 5, 1, 4)), turned[..., :2, :]], axis=-2
    )
    halves = quat.slerp(parents, turned, np.full((*several, 5, 3), 0.5))
    q_forearm = quat.conjugate(joint_angles.compose(angles[..., JOINT["wrist"], :]))
    identity = np.broadcast_to(quat.IDENTITY, q_forearm.shape)
    arm = np.stack(
        [identity, q_forearm, quat.slerp(identity, q_forearm, np.full(several, 0.5))], axis=-2
    )
    rotations = np.concatenate(
        [arm, halves.reshape(*several, -1, 4), turned.reshape(*several, -1, 4)], axis=-2
    )
    return rotations, _bone_places(places)


def _bone_places(places: Array) -> Array:
    """Places (..., bones, 3) m of all bones from those of the finger joints (..., 5, 3, 3): hand, forearm and wrist are at 0."""
    flat = places.reshape(*places.shape[:-3], -1, 3)
    return np.concatenate([np.zeros((*flat.shape[:-2], 3, 3)), flat, flat], axis=-2)


def _bound_chain() -> Array:
    """Orientations (5, 3, 4) of the finger segments on the hand in the bound pose."""
    q = joint_angles.compose(BOUND[CHAIN_JOINTS])
    first = q[:, 0]
    second = quat.multiply(first, q[:, 1])
    return np.stack([first, second, quat.multiply(second, q[:, 2])], axis=1)


# (5, 3, 4) orientations of the finger segments on the hand while the skin is bound
_BOUND_CHAIN = _bound_chain()
