"""Joint centres and fingertips as points, joint angles, events: C3D, as motion laboratories exchange it.

Points are in the wrist frame, mm. Angles are points, too, as the format has them: x, y, z are flexion, deviation, pronation in deg, and the parameter
POINT:ANGLES names them. What is not known has the residual -1.
"""

import io
import json
from typing import Any

import numpy as np
from c3d import Writer

from handscope.estimators.data.samples import Event
from handscope.estimators.hand import forward_kinematics as kinematics
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import FINGER_JOINTS, FINGERS, IS_DOF, JOINT, JOINTS
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.sessions.exports.measured import Exported, Measured
from handscope.sessions.exports.skeleton import even, rate
from handscope.sessions.files.silenced import without_warnings

MOST_EVENTS, LONGEST = 255, 127  # that a parameter can hold; letters of a word


def write(measured: Measured) -> Exported:
    """The file; samples at instants of one spacing."""
    moved, notices = even(measured.movement)
    labels, points, absent = [], [], []
    for label, values in _places(moved.angles, moved.tips, measured.geometry).items():
        if np.isfinite(values).all(axis=1).any():
            labels.append(label)
            points.append(1e3 * values)
        else:
            absent.append(label)
    if absent:
        notices.append(phrase("export.not_among_points", names=", ".join(absent)))
    angles = [j.name for j in JOINTS if np.isfinite(moved.angles[:, JOINT[j.name]]).any()]
    for name in angles:
        free = IS_DOF[JOINT[name]]
        points.append(np.degrees(np.where(free, moved.angles[:, JOINT[name]], 0.0)))
    labels += [f"{name}_angles" for name in angles]
    return Exported({"": _file(measured, labels, angles, moved.t, points)}, tuple(notices))


def _places(angles: Array, tips: Array, geometry: HandGeometry) -> dict[str, Array]:
    """Centres of joints and fingertips (n, 3) in the wrist frame, m; NaN where not known."""
    q_pc = joint_angles.compose(np.where(IS_DOF, angles, 0.0))
    ends = kinematics.joint_places(q_pc, geometry)
    q_wrist = np.where(np.isfinite(q_pc[:, JOINT["wrist"]]), q_pc[:, JOINT["wrist"]], quat.IDENTITY)
    known = np.asarray(np.isfinite(angles).any(axis=(1, 2)))
    found = {"wrist": np.where(known[:, None], 0.0, np.full((len(angles), 3), np.nan))}
    for f, finger in enumerate(FINGERS):
        root, middle, last = FINGER_JOINTS[finger]
        at_root = quat.rotate(q_wrist, np.broadcast_to(geometry.roots()[f], (len(angles), 3)))
        found[root] = np.where(np.isfinite(ends[:, f, :1, 0]), at_root, np.nan)
        found |= {middle: ends[:, f, 0], last: ends[:, f, 1], f"{finger}_tip": tips[:, f]}
    return found


def _file(
    measured: Measured, labels: list[str], angles: list[str], t: Array, points: list[Array]
) -> bytes:
    writer = Writer(point_rate=rate(t), point_units="mm", point_scale=-1.0)
    values = np.stack(points, axis=1) if points else np.zeros((len(t), 0, 3))  # (n, points, 3)
    known = np.isfinite(values).all(axis=-1, keepdims=True)
    frames = np.concatenate(
        [np.where(known, values, 0.0), np.where(known, 0.0, -1.0), np.zeros_like(values[..., :1])],
        axis=-1,
    )
    no_analogue = np.zeros((0, 1))
    for frame in frames:
        writer.add_frames([(frame, no_analogue)])
    writer.set_point_labels(labels)
    point = writer.point_group
    if angles:
        _words(
            point, "ANGLES", "joint angles: flexion, deviation, pronation", labels[-len(angles) :]
        )
        point.add_str("ANGLE_UNITS", "unit of the angles", "deg", 3)
    events = sorted(measured.recording.events, key=lambda e: e.onset)[: MOST_EVENTS // 2]
    _events(writer, [e for e in events if len(t) and e.end >= t[0]], float(t[0]) if len(t) else 0.0)
    about = writer.get_create("HANDSCOPE")
    for key, value in measured.origin.table().items():
        words = value if isinstance(value, str) else json.dumps(value, default=str)
        pieces = [words[k : k + LONGEST] for k in range(0, len(words), LONGEST)] or [""]
        _words(about, key.upper()[:LONGEST], "what the file rests on", pieces[:MOST_EVENTS])
    buffer = io.BytesIO()
    with without_warnings(UserWarning):  # "No analog data": there is none
        writer.write(buffer)
    return buffer.getvalue()


def _events(writer: Writer, events: list[Event], start: float) -> None:
    """Begin and end of every event; times in minutes and seconds from the first frame, as the format asks for."""
    named = [
        (str(e.details.get("task_name") or e.trial_type), side, moment - start)
        for e in events
        for side, moment in (("begin", e.onset), ("end", e.end))
    ]
    group = writer.get_create("EVENT")
    group.add("USED", "events", 2, "<H", len(named))
    if not named:
        return
    _words(group, "CONTEXTS", "", ["General"] * len(named))
    _words(group, "LABELS", "", [f"{name} {side}"[:LONGEST] for name, side, _ in named])
    times = np.array([[moment // 60, moment % 60] for *_, moment in named], np.float32)
    group.add("TIMES", "minutes, seconds", 4, "", times.tobytes(), 2, len(named))


def _words(group: Any, name: str, meaning: str, words: list[str]) -> None:
    """A parameter of several words."""
    ascii_words = [word.encode("ascii", "replace").decode() for word in words]
    text, width = Writer.pack_labels([word or " " for word in ascii_words])
    group.add_str(name, meaning, text, width, len(words))
