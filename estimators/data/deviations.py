"""Standard deviations of angles that rest on a sensor at fault.

In      standard deviations of all joints' angles, the segments' flags
Out     the same, where a segment of the joint is faulty no smaller than if nothing but the joint's limits were known
Source  standard deviation of a uniform distribution between the limits: range / sqrt(12)
Limits  a tip's is left as it is: its grade says that it rests on a faulty segment
"""

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.trajectory import Flag
from handscope.estimators.hand.anatomy import JOINTS, LIMITS, SEGMENT
from handscope.estimators.numerics.typing import Array

WITHIN_LIMITS = np.ptp(LIMITS, axis=-1) / np.sqrt(12.0)  # (joints, 3) rad


def widen_faulty(angles_sd: Array, flags: NDArray[np.uint8]) -> Array:
    """Standard deviations (n, joints, 3) rad, widened in samples where a joint's segment is faulty by its flags (n, segments)."""
    faulty = (flags & (Flag.FAULTY | Flag.DOUBTFUL)) != 0
    if not faulty.any():
        return angles_sd
    sides = np.array([[SEGMENT[j.parent], SEGMENT[j.child]] for j in JOINTS])
    wrong = faulty[:, sides].any(axis=2)[..., None]
    return np.asarray(np.where(wrong, np.maximum(angles_sd, WITHIN_LIMITS), angles_sd))
