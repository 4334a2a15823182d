"""C3D: joint centres and fingertips as points, joint angles as points of kind ANGLES, events; what biomechanics laboratories exchange.

Source  C3D.org, "The C3D file format: a technical user guide", POINT:ANGLES and EVENT; written by ezc3d
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from handscope.app.exports.extras import require
from handscope.app.results.export_content import Content
from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import CHAINS, FINGER_JOINTS, FINGERS, JOINT
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

MOST_FRAMES = 2**16 - 1  # that a header can count


def write(content: Content) -> bytes:
    """The file: points in mm in the wrist frame WCS, angles in deg; a gap is a missing point."""
    ezc3d = require("ezc3d", "exports")
    names, points = _points(content)
    columns = content.angle_columns()
    angles = np.degrees([content.moved.angles[:, j, a] for _, j, a in columns])
    t, every = content.moved.t, -(-len(content.moved) // MOST_FRAMES)
    values = np.zeros((4, len(names) + len(columns), len(t)))
    values[:3, : len(names)] = points.transpose(2, 1, 0) * 1e3
    values[0, len(names) :] = angles
    values[:3] = np.where(np.isfinite(values[:3]).all(axis=0), values[:3], np.nan)
    file = ezc3d.c3d()
    rate = (len(t) - 1) / (t[-1] - t[0]) / every if len(t) > 1 else 1.0
    labels = [*names, *(name for name, _, _ in columns)]
    file["parameters"]["POINT"]["RATE"]["value"] = [float(rate)]
    file["parameters"]["POINT"]["LABELS"]["value"] = labels
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file.add_parameter("POINT", "ANGLES", labels[len(names) :])
    file.add_parameter("POINT", "ANGLE_UNITS", ["deg"])
    file["data"]["points"] = values[:, :, ::every]
    _add_events(file, content)
    for name, words in content.provenance.items():
        file.add_parameter("MANUFACTURER", name.upper()[:20], [words])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "export.c3d"
        file.write(str(path))
        return path.read_bytes()


def _points(content: Content) -> tuple[list[str], Array]:
    """Names of joints and tips, and their places (n, points, 3) in WCS, m."""
    q_pc = joint_angles.compose(np.nan_to_num(content.moved.angles))
    geometry, moved = content.geometry, content.moved
    far = forward_kinematics.joint_places(q_pc, geometry)
    roots = quat.rotate(q_pc[:, JOINT["wrist"], None], geometry.roots())
    names, places = ["wrist"], [np.zeros((len(moved), 3))]
    for f, finger in enumerate(FINGERS):
        if finger not in content.measured_fingers():
            continue
        unknown = np.asarray(np.isnan(moved.tips[:, f]).any(axis=1, keepdims=True))
        chain = [roots[:, f], *(far[:, f, k] for k in range(len(CHAINS[finger]) - 1))]
        for joint, place in zip(FINGER_JOINTS[finger], chain):
            names.append(joint)
            places.append(np.where(unknown, np.nan, place))
        names.append(f"{finger}_tip")
        places.append(moved.tips[:, f])
    return names, np.stack(places, axis=1)


def _add_events(file: Any, content: Content) -> None:
    events = sorted(content.recording.events, key=lambda e: e.onset)[:255]
    begin = float(content.moved.t[0])
    labels = [str(e.details.get("task_name") or e.trial_type) for e in events]
    times = np.array([[0.0, e.onset - begin] for e in events]).T.reshape(2, -1)
    file.add_parameter("EVENT", "USED", [len(events)])
    if events:
        file.add_parameter("EVENT", "LABELS", labels)
        file.add_parameter("EVENT", "CONTEXTS", ["General"] * len(events))
        file.add_parameter("EVENT", "TIMES", times)
