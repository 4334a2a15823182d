"""The hand as far as gravity alone shows it: each segment's inclination, before any calibration, and how well that fits a pose.

In      a moment of samples of all inertial streams, nominal mounting
Out     joint angles and the hand's orientation with the fingers ahead; InclinationFit by finger
Source  inclination from a resting accelerometer; the grades are the limits of quality.LIMITS["turned"]
Limits  turns about the vertical are not seen: no spreading, no heading, no flexion of a finger whose flexion axis stands upright; a movement's own
        acceleration counts as gravity; a sensor that sits turned shows as a bent segment
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from handscope.estimators.alignment import quality
from handscope.estimators.alignment.initial_pose import Pose, nominal_mounting, segments_in_pose
from handscope.estimators.data.samples import ACC, Block
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import (
    CHAINS,
    DEVIATION,
    FINGER_JOINTS,
    FINGERS,
    FLEXION,
    JOINT,
    JOINTS,
    LIMITS,
    SEGMENTS,
    Hand,
    side_sign,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

LEAST_FORCE = 1.0  # m/s^2: less shows no direction
SEEN = 0.5  # share of gravity across the flexion axis, below which flexion is not seen
UPRIGHT = 0.35  # horizontal part of the fingers' direction, below which it gives no heading
WHOLE = "hand"  # of InclinationFit.part: the palm, against the level

Grade = Literal["good", "fair", "poor"]
Direction = Literal["bent", "lifted", "turned"]


@dataclass(frozen=True)
class InclinationFit:
    """How far a finger, or the palm, is inclined otherwise than the pose has it."""

    part: str  # a finger, or WHOLE
    angle: float  # rad, of its worst segment
    direction: Direction  # bent and lifted: about the flexion axis
    grade: Grade


def up_directions(blocks: Sequence[Block], mounting: Mapping[str, Array]) -> dict[str, Array]:
    """The mean upward direction (3,) of these samples in each segment's frame."""
    found = {}
    for block in (b for b in blocks if b.stream.inertial and len(b.t)):
        acc, nominal = block.of(ACC), nominal_mounting(block.stream.sensors, mounting)
        for k, name in enumerate(block.stream.sensors):
            samples = acc[np.isfinite(acc[:, k]).all(axis=1), k]
            mean = samples.mean(axis=0) if len(samples) else np.zeros(3)
            if name in SEGMENTS and (size := np.linalg.norm(mean)) > LEAST_FORCE:
                found[name] = quat.rotate(nominal[name], mean / size)
    return found


def pose_angles(pose: Pose) -> Array:
    """Joint angles (joints, 3) rad of a pose."""
    angles = np.zeros((len(JOINTS), 3))
    for joint, known in {**pose.measured, "thumb_cmc": pose.thumb_cmc}.items():
        angles[JOINT[joint]] = known
    return angles


def inclined_angles(up: Mapping[str, Array], pose: Pose) -> Array:
    """Joint angles (joints, 3) rad: flexion as the inclinations show it, everything else as in the pose."""
    angles = pose_angles(pose)
    for finger in FINGERS if "hand" in up else ():
        above = up["hand"]
        for joint, segment in zip(FINGER_JOINTS[finger], CHAINS[finger]):
            row = angles[JOINT[joint]]
            if segment in up:
                q_rest = joint_angles.compose(np.array([0.0, *row[DEVIATION:]]))
                seen = _flexion(above, quat.rotate(q_rest, up[segment]))
                row[FLEXION] = row[FLEXION] if seen is None else seen
                row[FLEXION] = np.clip(row[FLEXION], *LIMITS[JOINT[joint], FLEXION])
            above = quat.rotate(quat.conjugate(joint_angles.compose(row)), above)
    return angles


def inclined_orientation(up: Array, hand: Hand) -> Array:
    """Orientation q_GH (4,) of a hand with its upward direction `up` (3,), the fingers along the global y axis."""
    distal, dorsal = side_sign(hand) * np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    ahead = distal - (distal @ up) * up
    lacking = max(0.0, 1.0 - np.linalg.norm(ahead) / UPRIGHT)
    ahead = ahead - lacking * np.sign(distal @ up) * (dorsal - (dorsal @ up) * up)
    y = ahead / np.linalg.norm(ahead)
    return quat.from_matrix(np.array([np.cross(y, up), y, up]))


def fits(up: Mapping[str, Array], pose: Pose, hand: Hand) -> list[InclinationFit]:
    """How well the palm and each finger with sensors are inclined as the pose has it; empty without the hand's sensor."""
    if "hand" not in up:
        return []
    on_hand = segments_in_pose(pose)
    dorsal = side_sign(hand) * np.array([1.0, 0.0, 0.0])
    found = [_fit(WHOLE, [(_angle(up["hand"], dorsal), "turned")])]
    for finger in FINGERS:
        seen = [
            _misfit(up["hand"], quat.rotate(on_hand[s], up[s])) for s in CHAINS[finger] if s in up
        ]
        found += [_fit(finger, seen)] if seen else []
    return found


def _fit(part: str, seen: Sequence[tuple[float, Direction]]) -> InclinationFit:
    angle, direction = max(seen)
    good, fair = quality.LIMITS["turned"]
    grade: Grade = "good" if angle <= good else "fair" if angle <= fair else "poor"
    return InclinationFit(part, angle, direction, grade)


def _misfit(hand: Array, segment: Array) -> tuple[float, Direction]:
    """Angle between the hand's upward direction and a segment's laid on the hand, and what it is."""
    angle, flexion = _angle(hand, segment), _flexion(hand, segment)
    if flexion is None or abs(flexion) < 0.7 * angle:
        return angle, "turned"
    return angle, "bent" if flexion > 0 else "lifted"


def _flexion(parent: Array, child: Array) -> float | None:
    """The turn about z (rad) of a child's frame whose upward direction is `child` on a parent's whose is `parent`; None where gravity does not
    show it."""
    if min(np.hypot(*parent[:2]), np.hypot(*child[:2])) < SEEN:
        return None
    turn = np.arctan2(parent[1], parent[0]) - np.arctan2(child[1], child[0])
    return float(quat.wrapped(turn))


def _angle(a: Array, b: Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
