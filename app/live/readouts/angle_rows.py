"""Joint angles as pages show them, live and in a replay."""

from math import isfinite
from typing import Any

import numpy as np

from handscope.estimators.hand.anatomy import ANGLES, JOINTS
from handscope.estimators.numerics.typing import Array

FREEDOMS = [(joint.name, ANGLES[a]) for joint in JOINTS for a in joint.dofs]
# their indices in a row's angles
MOVING = tuple(np.array([(j, a) for j, joint in enumerate(JOINTS) for a in joint.dofs]).T)


def angle_rows(angles: Array) -> list[dict[str, Any]]:
    """The known angles of one instant, from (joints, 3) rad, in tenths of a degree."""
    row = np.degrees(angles[MOVING]).tolist()
    return [
        {"joint": joint, "angle": angle, "deg": round(deg, 1)}
        for (joint, angle), deg in zip(FREEDOMS, row)
        if isfinite(deg)
    ]
