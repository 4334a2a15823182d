"""Joint angles from the 21 landmarks that hand trackers for cameras give: a reference to compare with, not a measurement by Handscope.

In      places of 21 landmarks in a right-handed frame of any orientation and scale, NaN where the hand was not seen; which hand it is
Out     flexion and deviation of the fingers' MCP, flexion of PIP, DIP, thumb MCP and IP; no orientations, no tips, no wrist, no thumb CMC
Source  landmark numbers: MediaPipe Hands (Zhang et al. 2020, arXiv:2006.10214, Figure 2); angles: z-x'-y'' of a bone on its parent (conventions.md)
Limits  depth is guessed by a network: see LIMITS. A bone's direction does not determine its rotation about itself, so the thumb's angles are those between its
        bones, without sign. Zero is the straight line of landmarks, not the pose of a calibration: expect a constant offset of some degrees
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import (
    DEVIATION,
    FINGERS,
    FLEXION,
    JOINT,
    JOINTS,
    SEGMENTS,
    Hand,
    side_sign,
)
from handscope.estimators.numerics.typing import Array

COUNT = 21
WRIST, INDEX_ROOT, MIDDLE_ROOT, LITTLE_ROOT = 0, 5, 9, 17
FIRST = {finger: 1 + 4 * k for k, finger in enumerate(FINGERS)}  # a finger's four follow each other
BENT = np.radians(30.0)  # of a PIP from which on the side to which it bends is looked at; ours
LIMITS = (
    "camera landmarks are a coarse reference: their angles have a standard deviation of 5 to 10 deg and more where fingers hide each other; "
    "wrist, thumb CMC and fingertips are not compared, the thumb's MCP and IP without sign"
)


@dataclass(frozen=True)
class Landmarks:
    """What a camera's hand tracker saw."""

    t: Array  # (n,) s
    places: Array  # (n, 21, 3) right-handed, any scale; NaN where no hand was seen
    hand: Hand | None = None  # where the file says it


def trajectory_of(landmarks: Landmarks, hand: Hand) -> Trajectory:
    """The angles that landmarks tell; InputError where the fingers bend backwards, as those of the other hand or of a mirrored picture do."""
    p, n = landmarks.places, len(landmarks.t)
    angles = np.full((n, len(JOINTS), 3), np.nan)
    R_GH = _palm(p, hand)
    for finger in FINGERS[1:]:
        _bend_finger(p, finger, side_sign(hand), R_GH, angles)
    thumb = _bones(p, "thumb")
    for name, (a, b) in {"thumb_mcp": thumb[:2], "thumb_ip": thumb[1:]}.items():
        angles[:, JOINT[name], FLEXION] = np.arccos(np.clip((a * b).sum(axis=-1), -1.0, 1.0))
    _require_forward(angles, hand)
    q_GS, tips = np.full((n, len(SEGMENTS), 4), np.nan), np.full((n, len(FINGERS), 3), np.nan)
    return Trajectory(hand, landmarks.t, angles, q_GS, tips, np.zeros((n, len(SEGMENTS)), np.uint8))


def _palm(p: Array, hand: Hand) -> Array:
    """The hand's frame (n, 3, 3): distal from the wrist to the middle finger's MCP, ulnar from the index finger's to the little finger's."""
    distal = _unit(p[:, MIDDLE_ROOT] - p[:, WRIST])
    across = p[:, LITTLE_ROOT] - p[:, INDEX_ROOT]
    ulnar = _unit(across - (across * distal).sum(axis=-1, keepdims=True) * distal)
    y, z = side_sign(hand) * distal, side_sign(hand) * ulnar
    return np.stack([np.cross(y, z), y, z], axis=-1)


def _bend_finger(p: Array, finger: str, sign: float, R_GH: Array, angles: Array) -> None:
    """Write a finger's angles: each bone as it lies in the frame of the bone before."""
    R = R_GH
    for name, bone in zip(("mcp", "pip", "dip"), _bones(p, finger)):
        y = sign * bone
        in_parent = np.einsum("nji,nj->ni", R, y)
        joint = JOINT[f"{finger}_{name}"]
        angles[:, joint, FLEXION] = np.arctan2(-in_parent[:, 0], in_parent[:, 1])
        if name == "mcp":
            angles[:, joint, DEVIATION] = np.arcsin(np.clip(in_parent[:, 2], -1.0, 1.0))
        x = _unit(np.cross(y, R[:, :, 2]))  # no turn about the bone: x stays across the parent's z
        R = np.stack([x, y, np.cross(x, y)], axis=-1)


def _bones(p: Array, finger: str) -> list[Array]:
    """Directions (n, 3) of a finger's three bones, distal."""
    first = FIRST[finger]
    return [_unit(p[:, first + k + 1] - p[:, first + k]) for k in range(3)]


def _unit(v: Array) -> Array:
    """Vectors of length one; NaN where there is none."""
    size = np.linalg.norm(v, axis=-1, keepdims=True)
    return v / np.where(size > 0, size, np.nan)


def _require_forward(angles: Array, hand: Hand) -> None:
    pips = angles[:, [JOINT[f"{finger}_pip"] for finger in FINGERS[1:]], FLEXION]
    bent = pips[np.abs(pips) > BENT]
    if len(bent) and (bent < 0).mean() > 0.5:
        raise InputError("processing.landmarks_of_other_hand", hand=hand)
