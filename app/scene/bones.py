"""The bones that carry the skin: one for every segment, and one half way in every joint, so that a bent joint keeps its roundness.

In      joint angles (joints, 3) rad, a sized hand
Out     how far each bone is turned from the pose in which the skin was bound, and where its joint is, in the hand's frame from the wrist
Source  the half-way bone: Mohr & Gleicher 2003, ACM Trans Graphics 22:562 (joints added to halve the loss of volume of linear blending)
"""

import numpy as np

from estimators import joint_angles
from estimators import quaternions as quat
from estimators.forward_kinematics import CHAIN_JOINTS
from estimators.hand_anatomy import CHAINS, FINGER_JOINTS, FINGERS, JOINT, JOINTS
from estimators.hand_geometry import HandGeometry
from estimators.quaternions import Array

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
BOUND: Array = np.radians([_BOUND_DEG.get(joint.name, (0.0, 0.0, 0.0)) for joint in JOINTS])  # (joints, 3)


def chain(angles: Array, geometry: HandGeometry) -> tuple[Array, Array]:
    """Orientations (5 fingers, 3 segments, 4) of the finger segments on the hand, and places (5, 3, 3) of their proximal joints, m."""
    q_joint = joint_angles.compose(angles[CHAIN_JOINTS])
    offsets, place = geometry.chain_offsets(), geometry.roots()
    q, orientations, places = np.broadcast_to(quat.IDENTITY, (5, 4)), [], []
    for k in range(3):
        places.append(place)
        q = quat.multiply(q, q_joint[:, k])
        orientations.append(q)
        place = place + quat.rotate(q, offsets[:, k])
    return np.stack(orientations, axis=1), np.stack(places, axis=1)


def rest(geometry: HandGeometry) -> Array:
    """Where the bones' joints are while the skin is bound (bones, 3), m."""
    _, places = chain(BOUND, geometry)
    return _laid_out(np.zeros((3, 3)), places)


def pose(angles: Array, geometry: HandGeometry) -> tuple[Array, Array]:
    """How far each bone is turned from the bound pose (bones, 4), and where its joint is (bones, 3), m. Angles must be known."""
    q, places = chain(angles, geometry)
    turned = quat.multiply(q, quat.conjugate(_BOUND_CHAIN))  # (5, 3, 4)
    parents = np.concatenate([np.broadcast_to(quat.IDENTITY, (5, 1, 4)), turned[:, :2]], axis=1)
    halves = quat.slerp(parents, turned, np.full((5, 3), 0.5))
    back = quat.conjugate(joint_angles.compose(angles[JOINT["wrist"]]))
    arm = np.stack([quat.IDENTITY, back, quat.slerp(quat.IDENTITY, back, np.array(0.5))])
    rotations = np.concatenate([arm, halves.reshape(-1, 4), turned.reshape(-1, 4)])
    return rotations, _laid_out(np.zeros((3, 3)), places)


def _laid_out(arm: Array, places: Array) -> Array:
    flat = places.reshape(-1, 3)
    return np.concatenate([arm, flat, flat])


def _bound_chain() -> Array:
    q = joint_angles.compose(BOUND[CHAIN_JOINTS])
    first = q[:, 0]
    second = quat.multiply(first, q[:, 1])
    return np.stack([first, second, quat.multiply(second, q[:, 2])], axis=1)


_BOUND_CHAIN = _bound_chain()  # (5, 3, 4) orientations of the finger segments on the hand while the skin is bound
