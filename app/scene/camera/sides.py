"""The sides from which the hand is seen, and a camera that lets it fill two thirds of the picture.

A side is a direction from the hand to the camera in anatomical components; the camera keeps z up, so that dragging turns the scene as before.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from handscope.app.scene import view
from handscope.app.scene.mesh import bones
from handscope.estimators.hand.anatomy import JOINT, Hand, side_sign
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

Side = Literal["own", "front", "back", "thumb", "little", "palm"]
SIDES: tuple[Side, ...] = get_args(Side)
TOWARDS: Mapping[Side, tuple[float, float, float]] = {  # dorsal, distal, ulnar
    "own": (0.85, -0.53, 0.0),  # as the patient sees the hand
    "front": (0.45, 1.0, -0.25),
    "back": (1.0, -0.22, 0.0),
    "thumb": (0.38, 0.10, -1.0),
    "little": (0.38, 0.10, 1.0),
    "palm": (-1.0, 0.22, 0.0),
}
FILLED = 2 / 3  # of the picture's width or height
RAISED = 0.06  # of its height, the hand over the middle: cuff and buttons are below it
STEEPEST = np.radians(78.0)  # elevation; beyond that the picture would turn about its middle
BENT = np.radians(5.0)  # of the wrist
FLESH = 0.09  # scene units round the bones


@dataclass(frozen=True)
class Camera:
    """Where a camera is and what it looks at, scene units, z up."""

    position: Array  # (3,)
    look_at: Array  # (3,)


def side_of(curve: str) -> Side:
    """The side that shows a task's movement, by its live curve (protocols.CURVES): from the thumb's side for flexion, pinch and tapping, the back for
    spreading, the palm for the thumb's opposition, the front for turns of the forearm."""
    if curve == "palm_turn":
        return "front"
    if curve.startswith("thumb_cmc"):
        return "palm"
    return "back" if curve.endswith("_deviation") else "thumb"


def direction(side: Side, hand: Hand, q_DH: Array) -> Array:
    """Unit vector (3,) from the hand towards the camera in the scene, of a hand turned as q_DH (4,)."""
    v = quat.rotate(q_DH, side_sign(hand) * np.array(TOWARDS[side]))
    return _not_too_steep(v / np.linalg.norm(v))


def frame(towards: Array, points: Array, fov: float, aspect: float) -> Camera:
    """The camera in the direction `towards` (3,) in which points (n, 3) fill FILLED of a picture, RAISED over its middle.

    `fov` is the vertical field of view (rad), `aspect` the picture's width by its height.
    """
    right = np.cross([0.0, 0.0, 1.0], towards)
    axes = np.array([right, np.cross(towards, right), towards])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    seen = points @ axes.T
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    across, up, near = (seen - middle).T
    tangent = FILLED * np.tan(0.5 * fov)
    distance = np.max(
        np.maximum((np.abs(across) + FLESH) / (tangent * aspect), (np.abs(up) + FLESH) / tangent)
        + near
    )
    middle[1] -= RAISED * 2 * distance * np.tan(0.5 * fov)
    look_at = middle @ axes
    return Camera(look_at + distance * axes[2], look_at)


def outline(postures: Sequence[Array], geometry: HandGeometry, q_DH: Array) -> Array:
    """Wrist, finger joints and tips (n, 3) of a hand in these postures, joint angles (joints, 3), in the scene."""
    return np.concatenate([_outline(a, geometry, q_DH) for a in postures])


def _outline(angles: Array, geometry: HandGeometry, q_DH: Array) -> Array:
    """The same of one posture; a bent wrist turns the hand, since the forearm rests."""
    if np.any(np.abs(angles[JOINT["wrist"]]) > BENT):
        q_DH = view.forearm_level(angles, geometry.hand)
    _, places = bones.chain(angles, geometry)
    every = [np.zeros((1, 3)), places.reshape(-1, 3), bones.tips(angles, geometry)]
    return quat.rotate(q_DH, np.concatenate(every) * view.units_per_metre(geometry))


def between(start: Camera, stop: Camera, share: float) -> Camera:
    """The camera on the way from one to another, round what it looks at."""
    look_at = start.look_at + share * (stop.look_at - start.look_at)
    a, b = (_round(c.position - c.look_at) for c in (start, stop))
    turn = float(quat.wrapped(b[0] - a[0]))
    heading, elevation, distance = (
        a[0] + share * turn,
        a[1] + share * (b[1] - a[1]),
        a[2] + share * (b[2] - a[2]),
    )
    level = distance * np.cos(elevation)
    offset = np.array(
        [level * np.sin(heading), level * np.cos(heading), distance * np.sin(elevation)]
    )
    return Camera(look_at + offset, look_at)


def _round(v: Array) -> Array:
    """Heading, elevation (rad) and length of a vector (3,)."""
    return np.array(
        [np.arctan2(v[0], v[1]), np.arctan2(v[2], np.hypot(v[0], v[1])), np.linalg.norm(v)]
    )


def _not_too_steep(v: Array) -> Array:
    """The unit vector, at most STEEPEST above or below the level."""
    heading, elevation, _ = _round(v)
    if np.hypot(v[0], v[1]) < 0.05:
        heading = np.pi if v[2] > 0 else 0.0  # fingers that point away stay upright in the picture
    elevation = np.clip(elevation, -STEEPEST, STEEPEST)
    level = np.cos(elevation)
    return np.array([level * np.sin(heading), level * np.cos(heading), np.sin(elevation)])
