"""mcap-ros2-support reads the messages back."""

import io
from collections.abc import Callable

import numpy as np
import pytest

from handscope.estimators.hand.anatomy import FINGERS, JOINT, SEGMENT
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.sessions.exports.measured import Exported, Measured

reader = pytest.importorskip("mcap_ros2.reader")
START = 1772600767  # 2026-03-04T05:06:07 UTC, s


@pytest.fixture(scope="module")
def messages(exported: Callable[[str], Exported]) -> dict[str, list[object]]:
    found: dict[str, list[object]] = {}
    for message in reader.read_ros2_messages(io.BytesIO(exported("mcap-ros2").files[""])):
        found.setdefault(message.channel.topic, []).append(message)
    return found


def test_joint_states_carry_our_angles_and_times(
    messages: dict[str, list[object]], measured: Measured
) -> None:
    states = messages["/joint_states"]
    assert len(states) == len(measured.movement)
    one = states[60].ros_msg  # type: ignore[attr-defined]
    angles = dict(zip(one.name, one.position))
    assert angles["index_pip_flexion"] == measured.movement.angles[60, JOINT["index_pip"], 0]
    stamp = one.header.stamp.sec - START + 1e-9 * one.header.stamp.nanosec
    assert stamp == pytest.approx(measured.movement.t[60], abs=1e-8)


def test_transforms_lead_to_our_fingertips(
    messages: dict[str, list[object]], measured: Measured
) -> None:
    for k in (0, 60, 120):
        links = {m.child_frame_id: m for m in messages["/tf"][k].ros_msg.transforms}  # type: ignore[attr-defined]
        for f, finger in enumerate(FINGERS):
            place, at = np.zeros(3), f"{finger}_tip"
            while at != "forearm":
                q, offset = _transform(links[at].transform)
                place, at = quat.rotate(q, place) + offset, links[at].header.frame_id
            np.testing.assert_allclose(place, measured.movement.tips[k, f], atol=1e-4)


def test_the_pose_of_the_hand_is_ours(
    messages: dict[str, list[object]], measured: Measured
) -> None:
    pose = messages["/hand_pose"][60].ros_msg.pose.orientation  # type: ignore[attr-defined]
    ours = measured.movement.q_GS[60, SEGMENT["hand"]]
    assert abs(np.dot([pose.w, pose.x, pose.y, pose.z], ours)) == pytest.approx(1, abs=1e-9)


def _transform(transform: object) -> tuple[Array, Array]:
    r, p = transform.rotation, transform.translation  # type: ignore[attr-defined]
    return np.array([r.w, r.x, r.y, r.z]), np.array([p.x, p.y, p.z])
