"""Standard deviations of angles and tips for methods that give none themselves.

In      a method's name, its calibrations
Out     standard deviations of joint angles (rad) and of tips (m), for a whole trajectory
Source  m2 after an initial pose: fusion_errors.py. Else a table: docs/validation/table6.md on 20 simulated people: RMS error of the moved finger's angles and of its tip, mean over the eight experiments; a segment
        without an initial pose is as far off as method b, which has none; the thumb's CMC joint, which no constraint holds: RMS error of its largest and smallest
        angles by m2 in six assessment tasks of eight simulated people each (all other joints there: 1.8); the calibration's part: how far gravity tilted in the pose
Limits  the table: of a person like those simulated; errors of neighbouring joints count as independent, and the table's errors are taken as constant over a task
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.deviations import WITHIN_LIMITS, widen_faulty
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.hand.anatomy import (
    CHAINS,
    FINGERS,
    IS_DOF,
    JOINTS,
    SEGMENT,
    SEGMENTS,
    Joint,
)
from handscope.estimators.measures import fusion_errors
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array

DEG = np.pi / 180
ANGLE, ANGLE_UNPOSED = 1.84 * DEG, 6.99 * DEG  # m2 and b
CMC = 3.2 * DEG
TIP, TIP_UNPOSED = 7.0e-3, 20.7e-3  # m, the same
OWN, FROM_POSE = phrase("measure.sd_of_method"), phrase("measure.sd_from_pose")
UNSURE = np.uint8(Flag.UNCALIBRATED | Flag.HEADING_LOST)


@dataclass(frozen=True)
class Accuracy:
    """Defaults of a method, and what its calibration adds."""

    angle: float = ANGLE  # rad
    tip: float = TIP  # m
    source: str = phrase("measure.rms_of_method", method="m2")
    tilt: Mapping[str, float] = field(default_factory=dict)  # rad, by segment
    # poses from which errors are propagated; none: the table counts
    poses: tuple[Calibration, ...] = ()


DEFAULT = Accuracy()
METHODS = {
    "m1": Accuracy(1.89 * DEG, 7.0e-3, phrase("measure.rms_of_method", method="m1")),
    "m2": DEFAULT,
    "b": Accuracy(ANGLE_UNPOSED, TIP_UNPOSED, phrase("measure.rms_of_method", method="b")),
}


def accuracy_of(method: str, calibrations: Sequence[Calibration] = ()) -> Accuracy:
    """Accuracy of a method after these calibrations, of which the worst counts; that of m2 where the method has no table."""
    tilt = {
        s: max(c.quality[s].tilt_change for c in calibrations if s in c.quality)
        for c in calibrations
        for s in c.quality
    }
    has_model = method == "m2" and all(c.source.is_pose and "hand" in c.q_GS for c in calibrations)
    poses = tuple(calibrations) if has_model else ()
    return replace(METHODS.get(method, DEFAULT), tilt=tilt, poses=poses)


def with_sd(trajectory: Trajectory, accuracy: Accuracy) -> tuple[Trajectory, str]:
    """The trajectory with a standard deviation of every angle and tip, and its source; large where a sensor is at fault."""
    if trajectory.angles_sd is not None and trajectory.tips_sd is not None:
        widened = widen_faulty(trajectory.angles_sd, trajectory.flags)
        return replace(trajectory, angles_sd=widened), OWN
    if accuracy.poses and trajectory.angles_sd is None:
        return _propagate_sd(trajectory, accuracy.poses), FROM_POSE
    tilt = np.array([accuracy.tilt.get(s, 0.0) for s in SEGMENTS])
    unposed = ((trajectory.flags & Flag.UNCALIBRATED) != 0).any(axis=0)
    angles = np.array([_angle(accuracy, tilt, unposed, j) for j in JOINTS])
    tips = np.array([_tip(accuracy, unposed, [SEGMENT[s] for s in CHAINS[f]]) for f in FINGERS])
    n = len(trajectory)
    angles_sd = np.broadcast_to(angles[None, :, None], (n, len(JOINTS), 3))
    tips_sd = np.broadcast_to(tips[None, :, None], (n, len(FINGERS), 3))
    own_angles, own_tips = trajectory.angles_sd, trajectory.tips_sd
    return replace(
        trajectory,
        angles_sd=widen_faulty(angles_sd if own_angles is None else own_angles, trajectory.flags),
        tips_sd=tips_sd if own_tips is None else own_tips,
    ), accuracy.source


def _propagate_sd(trajectory: Trajectory, poses: Sequence[Calibration]) -> Trajectory:
    """With standard deviations propagated from each pose until the next; an angle's is at most its joint's range over sqrt(12)."""
    starts = [-np.inf, *(c.t for c in poses[1:])]
    pieces = [
        fusion_errors.deviations(trajectory.between(start, end), pose)
        for pose, start, end in zip(poses, starts, [*starts[1:], np.inf])
    ]
    angles_sd, tips_sd = (np.concatenate(values) for values in zip(*pieces))
    unsure = (trajectory.flags & UNSURE) != 0
    at_joint = unsure[:, [[SEGMENT[j.parent], SEGMENT[j.child]] for j in JOINTS]].any(axis=2)
    at_tip = unsure[:, [[SEGMENT[s] for s in CHAINS[f]] for f in FINGERS]].any(axis=2)
    angles_sd = np.maximum(angles_sd, ANGLE_UNPOSED * at_joint[..., None])
    tips_sd = np.maximum(tips_sd, TIP_UNPOSED / np.sqrt(3.0) * at_tip[..., None])
    widened = widen_faulty(
        np.where(IS_DOF, np.minimum(angles_sd, WITHIN_LIMITS), angles_sd), trajectory.flags
    )
    return replace(trajectory, angles_sd=widened, tips_sd=tips_sd)


def _angle(accuracy: Accuracy, tilt: Array, unposed: Array, joint: Joint) -> float:
    segments = [SEGMENT[joint.parent], SEGMENT[joint.child]]
    least = ANGLE_UNPOSED if unposed[segments].any() else CMC if joint.name == "thumb_cmc" else 0.0
    plain = max(accuracy.angle, least)
    return float(np.sqrt(plain**2 + (tilt[segments] ** 2).sum()))


def _tip(accuracy: Accuracy, unposed: Array, segments: list[int]) -> float:
    """Standard deviation of each coordinate: the RMS error of the place shared by three."""
    return float(
        (max(accuracy.tip, TIP_UNPOSED) if unposed[segments].any() else accuracy.tip) / np.sqrt(3.0)
    )
