"""From which side the hand is seen: the frame in which it is drawn, and the camera.

The scene's frame D has z up, y away from the viewer and x to the right. The hand hangs with its wrist at the origin and is turned as it really is,
except that the global heading, which is arbitrary, is replaced: as measured at one moment, the fingers pointed away from the viewer.
"""

import numpy as np

from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import JOINT, Hand, side_sign
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

PALM = 0.834  # every hand is drawn with a palm this long, an adult's in decimetres: a child's hand fills the view alike
CAMERA = np.array([0.0, -3.28, 4.44])
LOOK_AT = np.array([0.0, 0.33, 0.19])
FIELD_OF_VIEW = np.radians(28.0)
NARROW = 0.23  # tangent of half the horizontal field of view that a spread hand needs
NARROW_PAIR = 0.44  # the same for two hands beside each other
NEAR, FAR = 0.2, 20.0
GROUND = -1.35
TRAIL = 40  # pieces of line that show where the hand has been
_THICKNESS = 0.16  # from the hand's middle plane to its back, scene units
_UPRIGHT = 0.35  # fingers that point up or down give no heading: horizontal part of their direction below which the hand's back gives it


def units_per_metre(geometry: HandGeometry) -> float:
    """How large the hand is drawn: every hand fills the view alike."""
    return PALM / geometry.palm_length


def field_of_view(aspect: float, narrow: float = NARROW) -> float:
    """The vertical field of view, rad, in which what needs `narrow` fits a window `aspect` times as wide as high."""
    return float(max(FIELD_OF_VIEW, 2 * np.arctan(narrow / max(aspect, 0.1))))


def palm_down(hand: Hand) -> Array:
    """Orientation (4,) of a hand with the palm down and the fingers along y, seen in D or, with that heading, in G."""
    sign = side_sign(hand)
    return quat.from_matrix(np.array([[0.0, 0.0, -1.0], [0.0, sign, 0.0], [sign, 0.0, 0.0]]))


def forearm_level(angles: Array, hand: Hand) -> Array:
    """Orientation q_DH (4,) of a hand with joint angles (joints, 3) whose forearm lies level, palm down, and points away from the viewer."""
    return quat.multiply(palm_down(hand), joint_angles.compose(angles[JOINT["wrist"]]))


def back_of_hand(geometry: HandGeometry) -> Array:
    """Where the hand's sensor sits (3,) in the hand's frame, scene units from the wrist."""
    middle = 0.5 * np.array(geometry.joint_positions["middle_mcp"]) * units_per_metre(geometry)
    return np.asarray(middle + side_sign(geometry.hand) * np.array([_THICKNESS, 0.0, 0.0]))


def trail(places: Array) -> Array:
    """Places (n, 3) along a path as TRAIL pieces of line (TRAIL, 2, 3), evenly spaced in time."""
    at = np.linspace(0, len(places) - 1, TRAIL + 1)
    points = np.column_stack([np.interp(at, np.arange(len(places)), c) for c in places.T]).astype(
        np.float32
    )
    return np.stack([points[:-1], points[1:]], axis=1)


def heading_removed(q_GH: Array, hand: Hand) -> Array:
    """The rotation q_DG (4,) about the vertical that makes the fingers of a hand q_GH (4,) point away from the viewer."""
    ahead = _ahead(q_GH, hand)
    return quat.about(2, np.arctan2(ahead[0], ahead[1]))


def _ahead(q_GH: Array, hand: Hand) -> Array:
    """The horizontal direction (3,) in which a person with this hand looks: along the fingers, or for upright fingers by the hand's back."""
    sign = side_sign(hand)
    distal, dorsal = (
        quat.rotate(q_GH, np.array([0.0, sign, 0.0])),
        quat.rotate(q_GH, np.array([sign, 0.0, 0.0])),
    )
    if np.hypot(distal[0], distal[1]) > _UPRIGHT:
        return distal
    return -dorsal if distal[2] > 0 else dorsal
