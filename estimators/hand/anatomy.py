"""Names of the hand's segments and joints, what each joint may do, and how frames lie on the left
and the right hand.

Segment frames follow Salchow-Hoemmen 2019, 2.2.2 (after ISB, Wu 2005), origin at the segment's
distal joint centre:

    left   x dorsal   y distal    z ulnar
    right  x palmar   y proximal  z radial

so a vector with the anatomical components (dorsal, distal, ulnar) reads `side_sign(hand) * (dorsal,
distal, ulnar)` in either hand, rotations have the same components on both, and flexion, ulnar
deviation and pronation are positive on both.
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.hand.sides import HANDS as HANDS
from handscope.estimators.hand.sides import Hand as Hand
from handscope.estimators.numerics.typing import Array

FINGERS = ("thumb", "index", "middle", "ring", "little")
PHALANGES = dict.fromkeys(FINGERS, ("proximal", "middle", "distal")) | {
    "thumb": ("metacarpal", "proximal", "distal")
}
CHAINS = {
    finger: tuple(f"{finger}_{phalanx}" for phalanx in PHALANGES[finger]) for finger in FINGERS
}
SEGMENTS = ("forearm", "hand", *(segment for finger in FINGERS for segment in CHAINS[finger]))
SEGMENT = {name: k for k, name in enumerate(SEGMENTS)}

FLEXION, DEVIATION, PRONATION = 0, 1, 2
ANGLES = ("flexion", "deviation", "pronation")


@dataclass(frozen=True)
class Joint:
    """A joint between two segments; `limits` holds the permitted range in degrees of each angle it
    may take."""

    name: str
    parent: str
    child: str
    limits: dict[int, tuple[float, float]]
    source: str

    @property
    def dofs(self) -> tuple[int, ...]:
        return tuple(sorted(self.limits))


_WRIST = "AAOS 80/70 flexion, 20/30 deviation (Norkin App. A) with 20 deg tolerance"
_MCP = "eatonhand 90 flexion, 0-45 hyperextension; spread 32 ring-little (Chatzioglou 2024) with 20 deg tolerance"
_CMC = "ours: wide around palmar and radial abduction of 53-71 deg (Barakat 2013) and opposition about the long axis to 90"
_PAPER = "Salchow-Hoemmen 2019, 2.4.3"

JOINTS: tuple[Joint, ...] = (
    Joint("wrist", "forearm", "hand", {FLEXION: (-90, 100), DEVIATION: (-40, 50)}, _WRIST),
    Joint(
        "thumb_cmc",
        "hand",
        "thumb_metacarpal",
        {FLEXION: (-90, 90), DEVIATION: (-100, 60), PRONATION: (-120, 120)},
        _CMC,
    ),
    Joint(
        "thumb_mcp",
        "thumb_metacarpal",
        "thumb_proximal",
        {FLEXION: (-35, 90)},
        "43-70 flexion, 0-15 extension (Barakat 2013) with 20 deg tolerance",
    ),
    Joint("thumb_ip", "thumb_proximal", "thumb_distal", {FLEXION: (-20, 100)}, _PAPER),
    *(
        joint
        for f in FINGERS[1:]
        for joint in (
            Joint(
                f"{f}_mcp",
                "hand",
                f"{f}_proximal",
                {FLEXION: (-65, 110), DEVIATION: (-52, 52)},
                _MCP,
            ),
            Joint(f"{f}_pip", f"{f}_proximal", f"{f}_middle", {FLEXION: (-20, 120)}, _PAPER),
            Joint(f"{f}_dip", f"{f}_middle", f"{f}_distal", {FLEXION: (-20, 100)}, _PAPER),
        )
    ),
)
JOINT = {joint.name: k for k, joint in enumerate(JOINTS)}
# joints that bend about one axis alone, or hardly sideways: of the fingers all, of the thumb all but the first
HINGES = tuple(joint.name for joint in JOINTS if joint.name not in ("wrist", "thumb_cmc"))
PARENTS = np.array([SEGMENT[joint.parent] for joint in JOINTS])
CHILDREN = np.array([SEGMENT[joint.child] for joint in JOINTS])
IS_DOF = np.array([[a in joint.limits for a in range(3)] for joint in JOINTS])
# (joints, 3 angles, 2) rad
LIMITS: Array = np.radians(
    [[joint.limits.get(a, (0.0, 0.0)) for a in range(3)] for joint in JOINTS]
)
FINGER_JOINTS = {
    finger: tuple(joint.name for joint in JOINTS if joint.child in CHAINS[finger])
    for finger in FINGERS
}
DOF_NAMES = tuple(f"{joint.name}_{ANGLES[a]}" for joint in JOINTS for a in joint.dofs)


def side_sign(hand: Hand) -> float:
    """+1 on the left hand, -1 on the right: turns (dorsal, distal, ulnar) into frame components."""
    return 1.0 if hand == "left" else -1.0
