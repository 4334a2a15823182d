"""Points on a fingertip's skin: where it touches what it holds, and the mark on the palm that it is brought to.

In      joint angles or a trajectory, a sized hand, the fingertip's width and thickness
Out     places (n, 3) of a contact point in the wrist frame WCS, m
Source  Salchow-Hoemmen 2019, 3.2.1 and Fig. 10; widths and thicknesses: ours, an adult's to the
        millimetre - the paper measured its subjects', so truth and estimate know the same; how far
        the skin reaches beyond the bone: the geometry's tip tissue. The distal palmar crease lies
        6.8 to 10.3 mm from the MCP joints, nearer to the wrist: Bugbee & Botte 1993, Clin Orthop
        296:122, 53 hands (the index finger's, the proximal one, 9.1 mm and more); how far the skin
        lies below them: ours
Limits  the paper's hand is a left one, palm down: its `left` is the ulnar side, its `right` the
        radial one, on either hand here
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import (
    CHAINS,
    FINGER_JOINTS,
    FINGERS,
    IS_DOF,
    JOINT,
    SEGMENT,
    side_sign,
)
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

PALM_DEPTH = 0.017  # m, skin of the palm below the centre of an MCP joint: a hand of 28 mm less 11 above the centre
CREASE_BEHIND = 0.0085  # m, the middle of what the joints have


@dataclass(frozen=True)
class FingertipSize:
    """Outer size of the last phalanx, m."""

    width: float
    thickness: float


FINGERTIPS: Mapping[str, FingertipSize] = {
    "thumb": FingertipSize(0.021, 0.017),
    "index": FingertipSize(0.017, 0.014),
    "middle": FingertipSize(0.017, 0.014),
    "ring": FingertipSize(0.016, 0.013),
    "little": FingertipSize(0.014, 0.012),
}


def contact_points(
    angles: Array, geometry: HandGeometry, finger: str, point: str, fingertip: FingertipSize
) -> Array:
    """Places (n, 3) in WCS from joint angles (n, joints, 3); an angle that is no freedom of its
    joint counts as zero."""
    return contact_points_each(angles, geometry, [(finger, point, fingertip)])[0]


def contact_points_each(
    angles: Array, geometry: HandGeometry, points: Sequence[tuple[str, str, FingertipSize]]
) -> list[Array]:
    """The same of several points, each by its finger, name and fingertip; the hand is posed once."""
    q_pc = joint_angles.compose(np.where(IS_DOF, angles, 0.0))
    tips = forward_kinematics.tips(q_pc, geometry)
    return [
        tips[..., FINGERS.index(finger), :]
        + quat.rotate(_q_distal(q_pc, finger), offset(geometry, finger, point, fingertip))
        for finger, point, fingertip in points
    ]


def _q_distal(q_pc: Array, finger: str) -> Array:
    """From a finger's distal phalanx to WCS (n, 4)."""
    q = q_pc[..., JOINT["wrist"], :]
    # an unknown wrist counts as neutral, as in forward kinematics
    q = np.where(np.isnan(q), quat.IDENTITY, q)
    for joint in FINGER_JOINTS[finger]:
        q = quat.multiply(q, q_pc[..., JOINT[joint], :])
    return q


def contact_points_of(
    trajectory: Trajectory,
    geometry: HandGeometry,
    finger: str,
    point: str,
    fingertip: FingertipSize,
) -> Array:
    """The same of a trajectory, from its tips and segment orientations: with all that a method
    without joint constraints leaves in them."""
    q_GW = trajectory.q_GS[:, SEGMENT["forearm"]]
    # without a forearm sensor WCS moves with the hand
    q_GW = np.where(np.isnan(q_GW), trajectory.q_GS[:, SEGMENT["hand"]], q_GW)
    q_WD = quat.relative(q_GW, trajectory.q_GS[:, SEGMENT[CHAINS[finger][-1]]])
    return np.asarray(
        trajectory.tips[:, FINGERS.index(finger)]
        + quat.rotate(q_WD, offset(geometry, finger, point, fingertip))
    )


def pulp_offset(
    geometry: HandGeometry, finger: str, towards: Array, fingertip: FingertipSize
) -> tuple[Array, Array]:
    """From the end of the distal bone to an ellipsoid's farthest point (3,) in a direction (3,), unit length, both in the distal phalanx' frame; its derivative (3, 3) by the direction."""
    half = 0.5 * np.array([fingertip.thickness, 2 * geometry.tip_tissue[finger], fingertip.width])
    size = float(np.linalg.norm(half * towards))
    point = half**2 * towards / size
    return point, np.diag(half**2) / size - np.outer(point, point) / size


def palm_mark(geometry: HandGeometry) -> Array:
    """From a finger's MCP joint to the mark (3,), in the hand's frame: on the palm's crease, in line with the finger."""
    return side_sign(geometry.hand) * np.array([-PALM_DEPTH, -CREASE_BEHIND, 0.0])


def offset(geometry: HandGeometry, finger: str, point: str, fingertip: FingertipSize) -> Array:
    """From the end of the distal bone to the contact point (3,), in the distal phalanx' frame."""
    dorsal_distal_ulnar = {
        "left": (0.0, 0.0, 0.5 * fingertip.width),
        "right": (0.0, 0.0, -0.5 * fingertip.width),
        "bottom": (-0.5 * fingertip.thickness, 0.0, 0.0),
        "distal": (0.0, geometry.tip_tissue[finger], 0.0),
    }[point]
    return side_sign(geometry.hand) * np.array(dorsal_distal_ulnar)
