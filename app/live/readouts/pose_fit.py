"""What a station knows of the hand before it is calibrated: how it is inclined, and how well that fits the initial pose."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from handscope.app.live.tracking import Tracking
from handscope.estimators.alignment import inclined_hand
from handscope.estimators.alignment.initial_pose import DEG, Pose
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.movements.task_performance import POSE_THUMB

THUMB = (POSE_THUMB[0] * DEG, POSE_THUMB[1] * DEG, POSE_THUMB[2] * DEG)
WANTED = Pose(0.0, 0.0, THUMB)
SMOOTH, JUDGED = 0.25, 1.0  # s of samples that a picture, and a judgement, is the mean of


def inclined_pose(tracking: Tracking, mounting: Mapping[str, Array]) -> tuple[Array, Array] | None:
    """Joint angles (joints, 3) and orientation (4,) as inclinations show them; None without the hand's sensor."""
    up = inclined_hand.up_directions(tracking.recent(SMOOTH), mounting)
    if "hand" not in up:
        return None
    angles = inclined_hand.inclined_angles(up, WANTED)
    return angles, inclined_hand.inclined_orientation(up["hand"], tracking.hand)


def neutral_angles() -> Array:
    """Joint angles (joints, 3) of the pose itself."""
    return inclined_hand.inclined_angles({}, WANTED)


def fit_rows(tracking: Tracking, mounting: Mapping[str, Array]) -> list[dict[str, Any]]:
    """Fit of the palm and of every finger with sensors, for a page: deg."""
    return rows_of(inclined_hand.up_directions(tracking.recent(JUDGED), mounting), tracking.hand)


def rows_of(up: Mapping[str, Array], hand: Hand) -> list[dict[str, Any]]:
    """The same from upward directions by segment."""
    return [
        {
            "part": fit.part,
            "grade": fit.grade,
            "direction": fit.direction,
            "deg": 5 * round(float(np.degrees(fit.angle)) / 5),
        }
        for fit in inclined_hand.fits(up, WANTED, hand)
    ]
