"""Exact kinematics of all segments from a motion's coordinates and their derivatives.

In      coordinates (n, 54) with first and second derivatives, a sized hand
Out     per segment: orientation, angular velocity and acceleration, place and acceleration of its origin, all in the global frame
Source  rigid-body recursion from the forearm outwards; joint rotations intrinsic z-x'-y''
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import (
    CHAINS,
    FINGERS,
    JOINT,
    JOINTS,
    SEGMENT,
    SEGMENTS,
    Hand,
    side_sign,
)
from handscope.estimators.hand.geometry import HandGeometry, root_joint
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.motion import Motion


@dataclass(frozen=True)
class Kinematics:
    """(n, segments, ...) in the global frame; a segment's origin is its distal joint centre (hand: MCP 3, forearm: wrist, distal phalanx: tip)."""

    t: Array  # (n,) s
    q_GB: Array  # (n, segments, 4)
    w: Array  # (n, segments, 3) rad/s
    dw: Array  # (n, segments, 3) rad/s^2
    p: Array  # (n, segments, 3) m
    a: Array  # (n, segments, 3) m/s^2
    angles: Array  # (n, joints, 3) rad
    rates: Array  # (n, joints, 3) rad/s, their derivatives
    accelerations: Array  # (n, joints, 3) rad/s^2
    tips: Array  # (n, 5, 3) m in WCS


def compute_kinematics(motion: Motion, geometry: HandGeometry, t: Array) -> Kinematics:
    """Kinematics at the instants t (n,)."""
    x, dx, ddx = motion.at(np.asarray(t, dtype=float))
    n, segments = len(x), len(SEGMENTS)
    q, w, dw, p, a = np.empty((n, segments, 4)), *(np.empty((n, segments, 3)) for _ in range(4))
    angles, rates, accelerations = (c[:, 6:].reshape(n, len(JOINTS), 3) for c in (x, dx, ddx))
    k = Kinematics(t, q, w, dw, p, a, angles, rates, accelerations, np.empty((n, 5, 3)))
    sign = side_sign(geometry.hand)
    ground = quat.from_matrix(base_orientation(geometry.hand))
    _set(
        k,
        "forearm",
        *_rotate_child(
            (np.tile(ground, (n, 1)), np.zeros((n, 3)), np.zeros((n, 3))),
            x[:, 3:6],
            dx[:, 3:6],
            ddx[:, 3:6],
        ),
        x[:, :3],
        ddx[:, :3],
    )
    for joint in JOINTS:
        j = 6 + 3 * JOINT[joint.name]
        q, w, dw = _rotate_child(
            _of(k, joint.parent), x[:, j : j + 3], dx[:, j : j + 3], ddx[:, j : j + 3]
        )
        centre, at = _joint_centre(k, joint.name, joint.parent, geometry)
        arm = (
            np.array(geometry.joint_positions["middle_mcp"])
            if joint.child == "hand"
            else sign * np.array([0.0, geometry.lengths[joint.child], 0.0])
        )
        _set(
            k,
            joint.child,
            q,
            w,
            dw,
            *rigid_point(centre, at, w, dw, quat.rotate(q, np.tile(arm, (n, 1)))),
        )
    wrist, q_GW = k.p[:, SEGMENT["forearm"]], k.q_GB[:, SEGMENT["forearm"]]
    for f, finger in enumerate(FINGERS):
        k.tips[:, f] = quat.rotate(
            quat.conjugate(q_GW), k.p[:, SEGMENT[CHAINS[finger][-1]]] - wrist
        )
    return k


def concatenate(parts: Sequence[Kinematics]) -> Kinematics:
    """One after the other."""
    return Kinematics(
        *(np.concatenate([getattr(k, f.name) for k in parts]) for f in fields(Kinematics))
    )


def true_trajectory(kinematics: Kinematics, hand: Hand) -> Trajectory:
    """What an ideal method would give."""
    k = kinematics
    return Trajectory(
        hand,
        k.t,
        joint_angles.mask_non_freedoms(k.angles),
        k.q_GB,
        k.tips,
        np.zeros((len(k.t), len(SEGMENTS)), np.uint8),
    )


def rigid_point(p: Array, a: Array, w: Array, dw: Array, arm: Array) -> tuple[Array, Array]:
    """Place and acceleration of a point that sits at `arm` from a point at p with acceleration a on a body turning with w, dw."""
    return p + arm, a + quat.cross(dw, arm) + quat.cross(w, quat.cross(w, arm))


def base_orientation(hand: Hand) -> Array:
    """R_GB (3, 3) of a segment with the palm down and the fingers along the global y axis."""
    sign = side_sign(hand)
    return np.column_stack([(0, 0, sign), (0, sign, 0), (-1, 0, 0)]).astype(float)


def _joint_centre(
    k: Kinematics, joint: str, parent: str, geometry: HandGeometry
) -> tuple[Array, Array]:
    """Place and acceleration of a joint's centre; MCP and thumb CMC lie off the hand's origin."""
    s = SEGMENT[parent]
    if parent != "hand":
        return k.p[:, s], k.a[:, s]
    assert joint in {root_joint(finger) for finger in FINGERS}
    arm = np.array(geometry.joint_positions[joint]) - np.array(
        geometry.joint_positions["middle_mcp"]
    )
    return rigid_point(
        k.p[:, s],
        k.a[:, s],
        k.w[:, s],
        k.dw[:, s],
        quat.rotate(k.q_GB[:, s], np.tile(arm, (len(k.t), 1))),
    )


def _rotate_child(
    parent: tuple[Array, Array, Array], angles: Array, rates: Array, accelerations: Array
) -> tuple[Array, Array, Array]:
    """Orientation, angular velocity and acceleration of a child from its parent's and the joint's angles."""
    q_p, w_p, dw_p = parent
    z, x, y = (angles[:, i] for i in range(3))
    q_z = quat.about(2, z)
    q_zx = quat.multiply(q_z, quat.about(0, x))
    e_z = np.tile([0.0, 0.0, 1.0], (len(z), 1))
    e_x, e_y = (
        quat.rotate(q_z, np.tile([1.0, 0.0, 0.0], (len(z), 1))),
        quat.rotate(q_zx, np.tile([0.0, 1.0, 0.0], (len(z), 1))),
    )
    w_z, w_x, w_y = rates[:, :1] * e_z, rates[:, 1:2] * e_x, rates[:, 2:] * e_y
    relative = w_z + w_x + w_y
    change = (
        accelerations[:, :1] * e_z
        + accelerations[:, 1:2] * e_x
        + accelerations[:, 2:] * e_y
        + quat.cross(w_z, w_x)
        + quat.cross(w_z + w_x, w_y)
    )
    w_rel = quat.rotate(q_p, relative)
    return (
        quat.multiply(q_p, quat.multiply(q_zx, quat.about(1, y))),
        w_p + w_rel,
        dw_p + quat.rotate(q_p, change) + quat.cross(w_p, w_rel),
    )


def _of(k: Kinematics, segment: str) -> tuple[Array, Array, Array]:
    s = SEGMENT[segment]
    return k.q_GB[:, s], k.w[:, s], k.dw[:, s]


def _set(k: Kinematics, segment: str, q: Array, w: Array, dw: Array, p: Array, a: Array) -> None:
    s = SEGMENT[segment]
    k.q_GB[:, s], k.w[:, s], k.dw[:, s], k.p[:, s], k.a[:, s] = q, w, dw, p, a
