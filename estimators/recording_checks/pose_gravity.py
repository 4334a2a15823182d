"""Gravity in the initial pose against a hand that lies palm down: accelerometers that are all negated show there, and nowhere else by themselves.

In      a recording, calibrations from its initial poses
Out     a question, where most sensors read gravity upside down; of single sensors: alignment/mounting_checks.py
Limits  a pose that was held palm up looks the same, so that it is asked and flags nothing
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.alignment import initial_pose
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import ACC, Recording
from handscope.estimators.fault_detection.finding import Suspicion
from handscope.estimators.fault_detection.single_sensors.accelerometer_check import negated_in_pose
from handscope.estimators.hand.anatomy import side_sign
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.pipeline.process import whole_of
from handscope.estimators.pipeline.recording_calibration import initial_poses


def check_pose(recording: Recording, calibrations: Sequence[Calibration]) -> list[Suspicion]:
    """Ask whether accelerometers are negated, where most of them read gravity upside down in the first pose."""
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
