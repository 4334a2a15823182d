"""The printed sheet: where its markers lie, and where a hand laid on it in the pose has its landmarks.

In      the paper's name; a sized hand
Out     corners of the markers and landmarks in the sheet's frame, m: origin in the middle of the
        paper, x to the right, y towards the fingertips, z out of the paper towards the viewer
Source  markers: AprilTag 36h11 (Wang & Olson 2016, IROS, 4193)
Limits  the palm lies flat on the paper, so that a left hand's thumb is on the right
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import (
    DEVIATION,
    FINGER_JOINTS,
    FINGERS,
    HANDS,
    JOINT,
    JOINTS,
    Hand,
    side_sign,
)
from handscope.estimators.hand.forward_kinematics import joint_places
from handscope.estimators.hand.geometry import MCP_DISTAL, MCP_ULNAR, HandGeometry
from handscope.estimators.numerics.typing import Array

PAPERS = {"a4": (0.210, 0.297), "letter": (0.2159, 0.2794)}  # m, width and height
MARKER = 0.018  # m, side of a marker's black square
MARGIN = 0.008  # m, between a marker and the edge of the paper: printers leave 5 mm white
FINGER_EDGE = 0.0115  # m, from a finger's middle to white paper beside a marker
ROWS = 5  # of markers in each of the two columns
IDS = 16  # numbers of markers for each paper and hand
RULER = 0.100  # m, of the ruler that shows the printer's scale
THUMB_DEVIATION = np.radians(-45.0)  # of the drawn thumb, as in the wizard's pose
WRIST_HEIGHT = 0.27  # of the paper's height, from its lower edge to the wrist
FOREARM = 0.45  # of the hand's length, from the wrist to where the forearm's edges are marked
WRIST_BREADTH, FOREARM_BREADTH = 0.70, 0.75  # of the hand's breadth, for the drawing alone

FINGER_LANDMARKS = {f: (*FINGER_JOINTS[f], f"{f}_tip") for f in FINGERS}
ARM_LANDMARKS = ("wrist_radial", "wrist_ulnar", "forearm_radial", "forearm_ulnar")
LANDMARKS = (*(name for f in FINGERS for name in FINGER_LANDMARKS[f]), *ARM_LANDMARKS)


@dataclass(frozen=True)
class Sheet:
    """A sheet of paper for one hand."""

    paper: str
    hand: Hand

    @property
    def first_id(self) -> int:
        """Number of the first of its markers; no two kinds of sheet share one."""
        return IDS * (2 * list(PAPERS).index(self.paper) + HANDS.index(self.hand))

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the paper, m."""
        return PAPERS[self.paper]

    def markers(self) -> dict[int, Array]:
        """Corners (4, 3) of every marker by its number: upper left, upper right, lower right, lower
        left as it is printed."""
        width, height = self.size
        x, y = width / 2 - MARGIN - MARKER / 2, height / 2 - MARGIN - MARKER / 2
        middles = [(side * x, up) for side in (-1, 1) for up in np.linspace(y, -y, ROWS)]
        square = MARKER / 2 * np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
        return {self.first_id + k: square + [u, v, 0.0] for k, (u, v) in enumerate(middles)}

    def free_markers(self, geometry: HandGeometry) -> dict[int, Array]:
        """Those that the hand in the pose does not cover."""
        covered = np.array(list(self.landmarks(geometry).values()))
        near = MARKER / 2 + FINGER_EDGE
        return {
            k: corners
            for k, corners in self.markers().items()
            if np.linalg.norm(_between(covered) - corners.mean(axis=0)[:2], axis=1).min() > near
        }

    def landmarks(self, geometry: HandGeometry) -> dict[str, Array]:
        """Where the landmarks (2,) of a hand in the pose are on the sheet, m."""
        on_sheet = self._place_on_sheet(_hand_landmarks(geometry))
        return dict(zip(LANDMARKS, on_sheet))

    def _place_on_sheet(self, dorsal_distal_ulnar: Array) -> Array:
        """Anatomical places (n, 3) from the wrist as they lie on the sheet (n, 2), moved sideways
        so that both edges are as far from the hand."""
        across = -1.0 if self.hand == "left" else 1.0  # of ulnar on the sheet's x
        x = across * dorsal_distal_ulnar[:, 2]
        x = x - (x.max() + x.min()) / 2
        y = dorsal_distal_ulnar[:, 1] + (WRIST_HEIGHT - 0.5) * self.size[1]
        return np.stack([x, y], axis=-1)


def sheet_of(marker: int) -> Sheet | None:
    """The sheet that a marker of this number is printed on; None: none of ours."""
    kind, slot = divmod(marker, IDS)
    if not (0 <= kind < 2 * len(PAPERS) and slot < 2 * ROWS):
        return None
    return Sheet(list(PAPERS)[kind // 2], HANDS[kind % 2])


def pose_angles() -> Array:
    """Joint angles (joints, 3) of the pose that is drawn, rad."""
    angles = np.zeros((len(JOINTS), 3))
    angles[JOINT["thumb_cmc"], DEVIATION] = THUMB_DEVIATION
    return angles


def _hand_landmarks(geometry: HandGeometry) -> Array:
    """Dorsal, distal and ulnar components (n, 3) from the wrist's centre, in the order of
    LANDMARKS."""
    sign = side_sign(geometry.hand)
    ends = sign * joint_places(joint_angles.compose(pose_angles()), geometry)
    roots = sign * geometry.roots()
    found = []
    for k, finger in enumerate(FINGERS):
        along = ends[k, -1] - ends[k, -2]
        outer = ends[k, -1] + geometry.tip_tissue[finger] * along / np.linalg.norm(along)
        found += [roots[k], *ends[k, :-1], outer]
    length = geometry.palm_length / MCP_DISTAL["middle"]
    breadth = (roots[4][2] - roots[1][2]) / (MCP_ULNAR["little"] - MCP_ULNAR["index"])
    for back, broad in ((0.0, WRIST_BREADTH), (FOREARM * length, FOREARM_BREADTH)):
        found += [np.array([0.0, -back, side * broad * breadth / 2]) for side in (-1, 1)]
    return np.array(found)


def _between(points: Array) -> Array:
    """Points and what lies half way to the next of their chain."""
    return np.concatenate([points, (points[1:] + points[:-1]) / 2])
