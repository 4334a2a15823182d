"""Gravity in the initial pose against a hand that lies flat, palm down: accelerometers that are all negated show there, and nowhere else by themselves, and joints that were bent.

In      a recording, calibrations from its initial poses
Out     that the thumb is the other hand's; questions: where most sensors read gravity upside down, which joints were bent. Of single sensors: alignment/mounting_checks.py
Limits  a pose that was held palm up looks like negated accelerometers, so that it is asked and flags nothing
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.alignment import initial_pose, mounting_checks
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import ACC, Recording
from handscope.estimators.fault_detection.finding import Message, Suspicion
from handscope.estimators.fault_detection.single_sensors.accelerometer_check import negated_in_pose
from handscope.estimators.finger_ekf.pose_error import bent_joints
from handscope.estimators.finger_ekf.sensor_to_segment import SensorToSegmentParams
from handscope.estimators.hand.anatomy import JOINT, JOINTS, side_sign
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.pipeline.process import whole_of
from handscope.estimators.pipeline.recording_calibration import initial_poses

BENT_IN_POSE = "person.bent_in_pose"  # code of the question about joints that were bent
LEAST = np.radians(10.0)  # of a bend that is told
RARE = 2e-3  # so seldom are joints of a pose that is merely missed told as bent (docs/decisions/0014-bent-joints.py)


def check_pose(recording: Recording, calibrations: Sequence[Calibration]) -> list[Suspicion]:
    """Ask whether accelerometers are negated, where most of them read gravity upside down in the first pose, and whether joints that were bent in a pose can be straightened."""
    poses = [c for c in calibrations if c.source.is_pose]
    ends = [*(c.t for c in poses[1:]), np.inf]
    bent = [s for c, end in zip(poses, ends) for s in bent_joint_questions(c, end)]
    return [*_other_hand(recording, poses), *_negated(recording, calibrations), *bent]


def _other_hand(recording: Recording, poses: Sequence[Calibration]) -> list[Suspicion]:
    """What the thumb shows in the first pose: that the other hand was measured."""
    if not poses:
        return []
    taken = initial_pose.pose_of(initial_poses(recording.events)[0])
    pose = initial_pose.calibrated_part(taken, poses[0])
    inertial = [b for b in whole_of(recording) if b.stream.inertial]
    if not mounting_checks.is_other_hands_thumb(inertial, recording.mounting, pose):
        return []
    every = tuple(dict.fromkeys(s for b in inertial for s in b.stream.sensors))
    message = Message("hand.other_thumb", {}, "warning")
    return [Suspicion(message, every, ((-np.inf, np.inf),), RARE)]


def bent_joint_questions(pose: Calibration, until: float = np.inf) -> list[Suspicion]:
    """The question about joints that a pose had bent, if any, which counts until the next one (s)."""
    bent = [b for b in bent_joints.find(SensorToSegmentParams(), pose) if abs(b.angle) > LEAST]
    if not bent:
        return []
    named = ", ".join(f"{b.joint} {np.degrees(b.angle):.0f}\N{DEGREE SIGN}" for b in bent)
    sensors = tuple(JOINTS[JOINT[b.joint]].child for b in bent)
    message = Message(BENT_IN_POSE, {"joints": named}, "info")
    return [Suspicion(message, sensors, ((pose.t, until),), RARE)]


def bent_joints_of(message: Message) -> list[tuple[str, str]]:
    """The joints that such a question names, each with its angle: ("ring_pip", "37°")."""
    pairs = (each.partition(" ") for each in str(message.values["joints"]).split(", "))
    return [(joint, angle) for joint, _, angle in pairs]


def _negated(recording: Recording, calibrations: Sequence[Calibration]) -> list[Suspicion]:
    if not calibrations or not calibrations[0].source.is_pose:
        return []
    span = (calibrations[0].t, calibrations[0].end)
    on_hand = initial_pose.segments_in_pose(
        initial_pose.pose_of(initial_poses(recording.events)[0])
    )
    nominal = initial_pose.nominal_mounting(on_hand, recording.mounting)
    dorsal, sensors, acc, up = side_sign(recording.hand) * np.array([1.0, 0.0, 0.0]), [], [], []
    for block in (b for b in whole_of(recording) if b.stream.inertial):
        still = block.between(*span).of(ACC)
        for k, name in enumerate(block.stream.sensors):
            known = still[np.isfinite(still[:, k]).all(axis=1), k]
            if name in on_hand and len(known):
                sensors.append(name)
                acc.append(known.mean(axis=0))
                q_HS = quat.multiply(on_hand[name], nominal[name])
                up.append(quat.rotate(quat.conjugate(q_HS), dorsal))
    found = negated_in_pose(tuple(sensors), np.array(acc), np.array(up), span) if sensors else []
    return [
        replace(s, message=replace(s.message, severity="info"))
        for s in found
        if s.message.code == "file.accelerometer_negated"
    ]
