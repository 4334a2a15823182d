"""The hand as a tree of bones, for formats that animate one: each turns by its joint's angles about its proximal end.

Frames  docs/conventions.md; the root is the forearm, its origin the wrist's centre: places in it are in WCS
"""

from dataclasses import dataclass

import numpy as np

from handscope.app.results.export_content import Content, hold_known
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import CHAINS, FINGER_JOINTS, FINGERS, JOINT, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

UPRIGHT = np.array(
    [np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0]
)  # from z up to y up, as animators have it


@dataclass(frozen=True)
class Bone:
    """One segment: where its proximal joint is in its parent's frame, and which joint turns it there."""

    name: str
    parent: str
    offset: Array  # (3,) m
    joint: int  # of JOINTS


def bones(geometry: HandGeometry) -> list[Bone]:
    """The hand on the forearm, then the fingers from the palm outwards: parents before children."""
    found = [Bone("hand", "forearm", np.zeros(3), JOINT["wrist"])]
    for f, finger in enumerate(FINGERS):
        parent, offset = "hand", geometry.roots()[f]
        for k, (segment, joint) in enumerate(zip(CHAINS[finger], FINGER_JOINTS[finger])):
            found.append(Bone(segment, parent, offset, JOINT[joint]))
            parent, offset = segment, geometry.chain_offsets()[f, k]
    return found


def tip_offsets(geometry: HandGeometry) -> dict[str, tuple[str, Array]]:
    """By tip (`index_tip`): the distal segment and where the tip is in its frame (3,), m."""
    return {
        f"{finger}_tip": (CHAINS[finger][-1], geometry.chain_offsets()[f, -1])
        for f, finger in enumerate(FINGERS)
    }


def known_angles(content: Content) -> Array:
    """Angles (n, joints, 3) rad without gaps: what is not known keeps its last value, what was never measured is straight."""
    return hold_known(content.moved.angles)


def root_orientation(moved: Trajectory, angles: Array) -> Array:
    """Orientation of the forearm (n, 4) in the global frame, z up; from the hand's where the forearm has no sensor."""
    q_wrist = joint_angles.compose(angles[:, JOINT["wrist"]])
    from_hand = quat.multiply(moved.q_GS[:, SEGMENT["hand"]], quat.conjugate(q_wrist))
    known = hold_known(from_hand)
    size = np.linalg.norm(known, axis=1, keepdims=True)
    return np.where(size > 0, known / np.where(size > 0, size, 1.0), quat.IDENTITY)
