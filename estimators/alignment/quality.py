"""How good a calibration is for each joint, and why: in three grades, by the worse of the two
sensors that the joint lies between.

In      a Calibration, the segments whose sensors are at fault
Out     JointQuality by joint: grade, what decided it, where and how much
Source  grades ours: half the limits at which a pose is refused are good; 15 deg of misalignment is
        what careful mounting gives (5 to 10 deg, Salchow-Hoemmen 2019, 5) half as much again; a
        flexion axis is known by movements to 2 deg (good) or 5 deg (fair) of standard deviation
Limits  a pose that was not the one asked for is not seen: every angle is off by that, and all
        joints may be good; joints that were bent: finger_ekf/pose_error/bent_joints.py
"""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

import numpy as np

from handscope.estimators.data.calibration import Calibration, CalibrationSource
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, JOINTS

DEG = np.pi / 180
Grade = Literal["good", "fair", "poor", "none"]
GRADES: tuple[Grade, ...] = ("good", "fair", "poor", "none")
LIMITS = {  # up to here good, up to here fair
    "restless": (1.5 * DEG, 3.0 * DEG),  # rad/s, wander within the pose
    "tilted": (1.5 * DEG, 3.0 * DEG),  # rad, gravity within the pose
    "turned": (
        15.0 * DEG,
        30.0 * DEG,
    ),  # rad against the nominal mounting, where the pose alone determines it
    "fusion": (0.0, 1.0),  # 1: the device's own, of which nothing is known
    "axis": (2.0 * DEG, 5.0 * DEG),  # rad, sd of the flexion axis that movements tell
}


@dataclass(frozen=True)
class JointQuality:
    """Grade of a joint's calibration, with the sensor and the reason that decide it."""

    joint: str
    grade: Grade  # none: not measured
    reason: str = ""  # restless, tilted, turned, axis, fusion; fault, uncalibrated
    segment: str = ""  # whose sensor decided it
    value: float = 0.0  # rad or rad/s


def measured_fingers(calibration: Calibration) -> list[str]:
    """Fingers of which every segment has a sensor."""
    return [f for f in FINGERS if set(CHAINS[f]) <= set(calibration.q_BS)]


def of_joints(calibration: Calibration, faulty: Collection[str] = ()) -> list[JointQuality]:
    """Every joint of the hand."""
    return [
        _of_joint(calibration, faulty, joint.name, (joint.child, joint.parent)) for joint in JOINTS
    ]


def _of_joint(
    c: Calibration, faulty: Collection[str], joint: str, segments: tuple[str, str]
) -> JointQuality:
    if any(s not in c.q_BS for s in segments):
        return JointQuality(joint, "none")
    if c.source is CalibrationSource.NONE:
        return JointQuality(joint, "poor", "uncalibrated", segments[0])
    for segment in (s for s in segments if s in faulty):
        return JointQuality(joint, "poor", "fault", segment)
    judged = [(reason, value, s) for s in segments for reason, value in _values(c, s).items()]
    reason, value, segment = max(
        judged, key=lambda j: j[1] / LIMITS[j[0]][1], default=("restless", 0.0, segments[0])
    )
    good, fair = LIMITS[reason]
    grade: Grade = "good" if value <= good else "fair" if value <= fair else "poor"
    return JointQuality(joint, grade, "" if grade == "good" else reason, segment, value)


def _values(c: Calibration, segment: str) -> dict[str, float]:
    q = c.quality.get(segment)
    if q is None:
        return {}
    mounting = (
        {"axis": float(c.q_BS_sd[segment][0])}
        if segment in c.q_BS_sd
        else {"turned": q.misalignment}
    )
    whose = {"fusion": 1.0} if segment in c.q_ES else {}
    return {"restless": q.rate_wander, "tilted": q.tilt_change, **mounting, **whose}
