"""MCAP with ROS 2 messages: joint states, transforms of all segments, places of the fingertips.

Source  ROS 2 common_interfaces: sensor_msgs/JointState, tf2_msgs/TFMessage, geometry_msgs/PoseArray
"""

import io
from datetime import datetime
from typing import Any

import numpy as np

from handscope.app.exports.extras import require
from handscope.app.results.export_content import Content
from handscope.estimators.hand.anatomy import FINGERS, SEGMENT
from handscope.sessions.tables_io.trajectory_table import measured_segments

_LINE = "=" * 80
_HEADER = f"""{_LINE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_LINE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_POSE = f"""{_LINE}
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
"""
JOINT_STATE = f"""std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{_HEADER}"""
TRANSFORMS = f"""geometry_msgs/TransformStamped[] transforms
{_LINE}
MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
{_LINE}
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
{_LINE}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{_POSE}{_HEADER}"""
POSES = f"""std_msgs/Header header
geometry_msgs/Pose[] poses
{_LINE}
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
{_LINE}
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
{_POSE}{_HEADER}"""


def write(content: Content) -> bytes:
    """The file: /joint_states (rad), /tf (orientations of segments in the global frame), /fingertips (m, in the wrist frame; thumb first)."""
    writer_type = require("mcap_ros2.writer", "exports").Writer
    file = io.BytesIO()
    with writer_type(file) as writer:
        joints = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        transforms = writer.register_msgdef("tf2_msgs/msg/TFMessage", TRANSFORMS)
        poses = writer.register_msgdef("geometry_msgs/msg/PoseArray", POSES)
        moved, columns = content.moved, content.angle_columns()
        names = [name for name, _, _ in columns]
        angles = np.column_stack([moved.angles[:, j, a] for _, j, a in columns])
        segments = [(s, SEGMENT[s]) for s in measured_segments(moved)]
        begin = _begin(content)
        for k, t in enumerate(moved.t):
            at = begin + round(1e9 * float(t))
            stamp = {"sec": at // 10**9, "nanosec": at % 10**9}
            state = {"header": _header(stamp, ""), "name": names, "position": angles[k].tolist()}
            state |= {"velocity": [], "effort": []}
            writer.write_message("/joint_states", joints, state, log_time=at, publish_time=at)
            turned = [
                {
                    "header": _header(stamp, "global"),
                    "child_frame_id": name,
                    "transform": {
                        "translation": _vector(np.zeros(3)),
                        "rotation": _rotation(moved.q_GS[k, s]),
                    },
                }
                for name, s in segments
                if np.isfinite(moved.q_GS[k, s, 0])
            ]
            writer.write_message(
                "/tf", transforms, {"transforms": turned}, log_time=at, publish_time=at
            )
            tips = {"header": _header(stamp, "wrist"), "poses": _tips(content, k)}
            writer.write_message("/fingertips", poses, tips, log_time=at, publish_time=at)
        writer._writer.add_metadata("handscope", dict(content.provenance))
    return file.getvalue()


def _begin(content: Content) -> int:
    """The recording's start, ns since 1970; 0 where it is not known."""
    if not content.recording.start_utc:
        return 0
    return round(1e9 * datetime.fromisoformat(content.recording.start_utc).timestamp())


def _header(stamp: dict[str, int], frame: str) -> dict[str, Any]:
    return {"stamp": stamp, "frame_id": frame}


def _vector(v: Any) -> dict[str, float]:
    return {"x": float(v[0]), "y": float(v[1]), "z": float(v[2])}


def _rotation(q: Any) -> dict[str, float]:
    return {"x": float(q[1]), "y": float(q[2]), "z": float(q[3]), "w": float(q[0])}


def _tips(content: Content, k: int) -> list[dict[str, Any]]:
    no_turn = _rotation((1.0, 0.0, 0.0, 0.0))
    return [
        {"position": _vector(content.moved.tips[k, f]), "orientation": no_turn}
        for f in range(len(FINGERS))
    ]
