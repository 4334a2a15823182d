"""The hand before it is calibrated: how it is inclined, and how well that fits the initial pose."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from handscope.app.live.tracking import Tracking
from handscope.estimators.alignment import inclined_hand
from handscope.estimators.alignment.initial_pose import DEG, Pose
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.movements.task_performance import POSE_THUMB

THUMB = (POSE_THUMB[0] * DEG, POSE_THUMB[1] * DEG, POSE_THUMB[2] * DEG)
NOMINAL = Pose(0.0, 0.0, THUMB)
SMOOTH, JUDGED = 0.25, 1.0  # s of samples that a picture, and a judgement, is the mean of


def inclined_pose(
    tracking: Tracking, mounting: Mapping[str, Array], pose: Pose = NOMINAL
) -> tuple[Array, Array] | None:
    """Joint angles (joints, 3) and orientation (4,) as inclinations show them; None without the hand's sensor."""
    up = inclined_hand.up_directions(tracking.recent(SMOOTH), mounting)
    if "hand" not in up:
        return None
    angles = inclined_hand.inclined_angles(up, pose)
    return angles, inclined_hand.inclined_orientation(up["hand"], tracking.hand)


def fit_rows(
    tracking: Tracking, mounting: Mapping[str, Array], pose: Pose = NOMINAL
) -> list[dict[str, Any]]:
    """Fit of the palm and of every finger with sensors to a pose, for a page: deg."""
    up = inclined_hand.up_directions(tracking.recent(JUDGED), mounting)
    return [
        {
            "part": fit.part,
            "grade": fit.grade,
            "direction": fit.direction,
            "deg": 5 * round(float(np.degrees(fit.angle)) / 5),
        }
        for fit in inclined_hand.fits(up, pose, tracking.hand)
    ]
