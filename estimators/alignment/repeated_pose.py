"""The same pose taken several times with the hand lifted between: its mean, and how well a person takes it.

In      Calibrations of one row of poses
Out     the last one with the mean mounting of all; `pose_sd` from how the poses scatter
Source  variance of a mean; what all poses have in common (a finger that never is straight) does not
        scatter: COMMON_SD, size ours
Limits  gravity shows flexion alone: what the poses differ by about the vertical cannot be seen, so
        deviations count as of one pose, and so does the thumb, whose axes do not lie level
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.alignment import functional_calibration
from handscope.estimators.alignment.initial_pose import Pose
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import FINGER_JOINTS, FLEXION, JOINT, JOINTS
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

COMMON_SD = np.radians(1.0)  # of what every pose of a person misses alike
NOT_LIFTED = phrase("calibration.hand_not_lifted")
LEAST_JOINTS = 3  # whose flexion must be seen to tell how poses scatter
LARGEST_SD = np.radians(5.0)  # poses that scatter more were not the same
SAME = np.radians(0.15)  # poses that scatter less are one: no hand comes back so exactly
FINGERS = [name for f, joints in FINGER_JOINTS.items() if f != "thumb" for name in joints]


@dataclass(frozen=True)
class TakenPose:
    """A pose with the calibration that it gave by itself."""

    pose: Pose
    calibration: Calibration


def extend_row(row: Sequence[TakenPose], taken: TakenPose) -> list[TakenPose]:
    """The row with a pose that repeats the one before; a new row where its event does not say so, or says that joints were flexed otherwise."""
    repeats = taken.pose.repetition > 1 and bool(row)
    same = repeats and _known_flexions(row[-1].pose) == _known_flexions(taken.pose)
    return [*row, taken] if same else [taken]


def average(row: Sequence[Calibration]) -> Calibration:
    """The last calibration of a row with the mounting that all of its poses give; of one pose itself."""
    last = row[-1]
    if len(row) == 1:
        return last
    common = [s for s in last.q_BS if all(s in c.q_BS for c in row)]
    mean = {s: quat.mean(np.array([c.q_BS[s] for c in row])) for s in common}
    mounted = [functional_calibration.apply_mounting(c, mean) for c in row]
    scatter = _scatter([_flexions(c) for c in mounted])
    if scatter is None:
        return last
    if scatter < SAME:
        return replace(last, warnings=(*last.warnings, NOT_LIFTED))
    if scatter > LARGEST_SD:
        warning = phrase("calibration.poses_differ", deg=np.degrees(scatter))
        return replace(last, warnings=(*last.warnings, warning))
    sd = _pose_sd(scatter, len(row))
    for joint, known in last.pose_sd.items():  # of what was measured in the last pose
        flexion, deviation, pronation = np.where(np.isnan(known), sd[joint], known)
        sd[joint] = float(flexion), float(deviation), float(pronation)
    return replace(mounted[-1], pose_sd=sd)


def _known_flexions(pose: Pose) -> dict[str, float]:
    """Joints that are not straight in the pose as its event describes it, rad."""
    return {j: angles[FLEXION] for j, angles in pose.measured.items() if angles[FLEXION]}


def _flexions(calibration: Calibration) -> Array:
    """Of the fingers' joints (n,) as gravity shows them with this mounting, rad; NaN where not known."""
    on = {
        s: quat.multiply(q, quat.conjugate(calibration.q_BS[s]))
        for s, q in calibration.q_GS.items()
    }
    found = np.full(len(FINGERS), np.nan)
    for k, name in enumerate(FINGERS):
        joint = JOINTS[JOINT[name]]
        if joint.parent in on and joint.child in on:
            q_pc = quat.relative(on[joint.parent], on[joint.child])
            found[k] = joint_angles.decompose(q_pc)[0]
    return found


def _scatter(flexions: Sequence[Array]) -> float | None:
    """Standard deviation of one pose's flexion, all joints together; None where too few are seen."""
    seen = np.array(flexions)
    seen = seen[:, np.isfinite(seen).all(axis=0)]
    if seen.shape[1] < LEAST_JOINTS:
        return None
    return float(np.sqrt(seen.var(axis=0, ddof=1).mean()))


def _pose_sd(scatter: float, count: int) -> dict[str, tuple[float, float, float]]:
    """By joint, rad: flexion of fingers as of a mean, everything else as of one pose."""
    once = float(np.hypot(scatter, COMMON_SD))
    mean = float(np.hypot(scatter / np.sqrt(count), COMMON_SD))
    return {j.name: (mean if j.name in FINGERS else once, once, once) for j in JOINTS}
