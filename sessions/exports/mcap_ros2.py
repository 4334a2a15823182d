"""ROS 2 messages in an MCAP file: JointState, the transforms of all bones, and the hand's pose with its fingertips.

Topics: `/joint_states` (rad), `/tf` (from `world` through `forearm` and `hand` to the fingertips), `/hand_pose` (PoseStamped of the hand), each at every sample.
Times are the recording's, from its absolute start where that is known.
"""

import io
import json
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import ANGLES, CHAINS, FINGERS, JOINT, JOINTS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.sessions.exports.measured import Exported, Measured
from handscope.sessions.exports.skeleton import Skeleton, skeleton

_LINE = "=" * 80
_TIME = f"{_LINE}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
_HEADER = f"{_LINE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n{_TIME}"
_QUATERNION = (
    f"{_LINE}\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
)
DEFINITIONS = {
    "sensor_msgs/msg/JointState": f"std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n{_HEADER}",
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n"
    f"{_LINE}\nMSG: geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"
    f"{_LINE}\nMSG: geometry_msgs/Transform\ngeometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"
    f"{_LINE}\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n{_QUATERNION}{_HEADER}",
    "geometry_msgs/msg/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose\n"
    f"{_LINE}\nMSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
    f"{_LINE}\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n{_QUATERNION}{_HEADER}",
}
Z_UP = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])  # back from the skeleton's y up


def write(measured: Measured) -> Exported:
    """The file; ROS has z up, as we have."""
    try:
        from mcap_ros2.writer import Writer
    except ImportError:
        raise InputError("export.package_missing") from None
    bones = skeleton(measured)
    names, positions = _joints(bones, measured)
    links = list(_links(bones))
    q_GH = quat.multiply(
        np.broadcast_to(Z_UP, bones.q_WF.shape),
        quat.multiply(bones.q_WF, bones.rotations[:, JOINT["wrist"]]),
    )
    start = _start_ns(measured.origin.start_utc)
    buffer = io.BytesIO()
    with Writer(buffer) as writer:
        schemas = {name: writer.register_msgdef(name, text) for name, text in DEFINITIONS.items()}
        joint_state, transforms, pose = schemas.values()
        for k, t in enumerate(bones.t.tolist()):
            moment = start + round(t * 1e9)
            stamp = {"sec": moment // 10**9, "nanosec": moment % 10**9}

            def send(topic: str, schema: Any, message: Any, at: int = moment, k: int = k) -> None:
                writer.write_message(topic, schema, message, at, at, k)

            head = {"stamp": stamp, "frame_id": "world"}
            state = {"name": names, "position": positions[k], "velocity": [], "effort": []}
            send("/joint_states", joint_state, {"header": head, **state})
            moved = [
                {
                    "header": {"stamp": stamp, "frame_id": parent},
                    "child_frame_id": child,
                    "transform": {"translation": _xyz(place), "rotation": _xyzw(q[k])},
                }
                for parent, child, place, q in links
            ]
            send("/tf", transforms, {"transforms": moved})
            at = {"position": _xyz([0.0, 0.0, 0.0]), "orientation": _xyzw(q_GH[k])}
            send("/hand_pose", pose, {"header": head, "pose": at})
        writer.add_metadata("handscope", _words(measured))
    return Exported({"": buffer.getvalue()}, bones.notices)


def _joints(bones: Skeleton, measured: Measured) -> tuple[list[str], list[list[float]]]:
    """Names of the freedoms that were measured, and their angles at every sample."""
    angles = measured.movement.angles
    known = [
        (j, joint, a)
        for j, joint in enumerate(JOINTS)
        for a in joint.dofs
        if np.isfinite(angles[:, j, a]).any()
    ]
    names = [f"{joint.name}_{ANGLES[a]}" for _, joint, a in known]
    columns = [bones.angles[:, j, a] for j, _, a in known]
    return names, np.column_stack(columns).tolist() if columns else [[] for _ in bones.t]


def _links(bones: Skeleton) -> Iterator[tuple[str, str, list[float], list[list[float]]]]:
    """Parent, child, place of the child's frame on the parent (m), its rotation at every sample."""
    still = np.tile(quat.IDENTITY, (len(bones.t), 1))
    q_GF = quat.multiply(np.broadcast_to(Z_UP, bones.q_WF.shape), bones.q_WF)
    rotations, nowhere = bones.rotations, [0.0, 0.0, 0.0]
    yield "world", "forearm", nowhere, q_GF.tolist()
    yield "forearm", "hand", nowhere, rotations[:, JOINT["wrist"]].tolist()
    roots, offsets = bones.geometry.roots(), bones.geometry.chain_offsets()
    for finger in bones.fingers:
        f = FINGERS.index(finger)
        parent, place = "hand", roots[f]
        for k, segment in enumerate(CHAINS[finger]):
            joint = next(j for j, joint in enumerate(JOINTS) if joint.child == segment)
            yield parent, segment, place.tolist(), rotations[:, joint].tolist()
            parent, place = segment, offsets[f, k]
        yield parent, f"{finger}_tip", place.tolist(), still.tolist()


def _words(measured: Measured) -> dict[str, str]:
    """What it rests on: MCAP's metadata are words."""
    about = measured.origin.table() | {"hand": measured.recording.hand}
    return {k: v if isinstance(v, str) else json.dumps(v, default=str) for k, v in about.items()}


def _start_ns(start_utc: str) -> int:
    if not start_utc:
        return 0
    moment = datetime.fromisoformat(start_utc)
    known = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return round(known.timestamp() * 1e6) * 1000


def _xyz(v: list[float]) -> dict[str, float]:
    return dict(zip("xyz", v))


def _xyzw(q: list[float] | Array) -> dict[str, float]:
    return {name: float(value) for name, value in zip("wxyz", q)}
