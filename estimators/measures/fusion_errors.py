"""Standard deviations of angles and tips from a fusion after one pose: each source of error propagated from the pose to every sample.

In      a trajectory of `m2`, whose headings come from the pose alone, and its calibration
Out     standard deviations of joint angles (n, joints, 3) rad and of tips (n, 5, 3) m, at every sample
Source  ours. A sensor that the pose fixed leaves the error e = r + (u - u_0) d of its segment's orientation: r is what the pose was missed by, d the sensor's turn about the vertical u_0, which gravity
        does not show, u the vertical now, both in the segment's frame. Sizes are the options of `ekf` with their sources; unknown sizes of misalignment and pose error are averaged
        over, weighed by gravity in all sensors (finger_ekf/pose_error/pose_inference.py)
Limits  first order; the movement is not used, so sizes of skin, slips and joints that give are not inferred; a rest does not reduce the variance of headings
"""

import math
from collections.abc import Iterator

import numpy as np

from handscope.estimators.alignment.initial_pose import PoseParams
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.finger_ekf.filter import FilterParams
from handscope.estimators.finger_ekf.pose_error import bent_joints, pose_inference
from handscope.estimators.finger_ekf.pose_error.pose_inference import MOUNTINGS, VERTICAL
from handscope.estimators.hand import forward_kinematics, joint_angles, length_covariance
from handscope.estimators.hand.anatomy import (
    CHILDREN,
    DEVIATION,
    FINGERS,
    FLEXION,
    IS_DOF,
    JOINT,
    PARENTS,
    SEGMENT,
    SEGMENTS,
)
from handscope.estimators.hand.forward_kinematics import CHAIN_JOINTS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array, Indices

PARAMS = FilterParams()
LENGTH_SD = 0.03  # 1, as ekf's option `length_sd`
EVERY = 0.2  # s between two instants that are looked at: movements are slower
PIECE = 512  # of them at a time
# joints from the wrist to the tip of each finger (5, 4)
_CHAINS = np.column_stack([np.full(len(FINGERS), JOINT["wrist"]), CHAIN_JOINTS])
# joints with skin on both sides, as in sensor_to_segment.py
_FIRST = np.isin(PARENTS, (SEGMENT["forearm"], SEGMENT["hand"]))


def deviations(moved: Trajectory, calibration: Calibration) -> tuple[Array, Array]:
    """Standard deviations of angles and tips of samples that this calibration serves."""
    if not len(moved):
        return np.empty_like(moved.angles), np.empty_like(moved.tips)
    steady = _steady(calibration)
    slot = np.floor(moved.t / EVERY + 1e-9)
    rows = np.flatnonzero(np.diff(slot, prepend=-np.inf) > 0)
    found = [_of_rows(moved.at(part), calibration, steady) for part in _parts(rows)]
    newest = np.searchsorted(rows, np.arange(len(moved)), side="right") - 1
    angles, tips = (np.concatenate(values)[newest] for values in zip(*found))
    return (
        np.where(np.isnan(moved.angles), np.nan, angles),
        np.where(np.isnan(moved.tips), np.nan, tips),
    )


def _parts(rows: Indices) -> Iterator[Indices]:
    for first in range(0, len(rows), PIECE):
        yield rows[first : first + PIECE]


def _steady(calibration: Calibration) -> tuple[Array, Array, Array]:
    """r (segments, 3, m) and d (segments, m) of independent causes, and the verticals u_0 (segments, 3) of the pose."""
    on_hand = pose_inference.segments_on_hand(calibration)
    R_sh = quat.matrix(quat.conjugate(on_hand))
    q_GH = quat.multiply(calibration.q_GS["hand"], quat.conjugate(calibration.q_BS["hand"]))
    u_0 = quat.rotate(quat.conjugate(quat.multiply(q_GH, on_hand)), VERTICAL)
    root = _root(_second_moment(calibration))
    mounted = root[:MOUNTINGS].reshape(len(SEGMENTS), 3, -1)
    missed = R_sh @ pose_inference.missed_orientations(on_hand) @ root
    turned = np.einsum("sa,sam->sm", u_0, missed - mounted)
    upright = u_0[:, :, None] * turned[:, None]
    # the pose lays every sensor as gravity in the hand's has it: its tilt is common to all
    hand = SEGMENT["hand"]
    tilt = mounted[hand] - u_0[hand][:, None] * (u_0[hand] @ mounted[hand])
    aligned = [bool(calibration.nominal) and s not in calibration.q_BS_sd for s in SEGMENTS]
    return (
        np.where(np.array(aligned)[:, None, None], missed + R_sh @ tilt, mounted + upright),
        turned,
        u_0,
    )


def _second_moment(calibration: Calibration) -> Array:
    """Mean squares of the errors of mountings and of the pose's angles, rad^2."""
    bent = bent_joints.find(PARAMS, calibration)
    pose_sd, known = bent_joints.pose_angles_sd(PARAMS, calibration, bent)
    if not pose_inference.can_infer(calibration):
        return pose_inference.prior_covariance(PARAMS, calibration, pose_sd)
    return pose_inference.second_moment(
        calibration,
        math.radians(PARAMS.misalignment),
        pose_sd,
        math.radians(PARAMS.angle_sd),
        known,
    )


def _root(covariance: Array) -> Array:
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _of_rows(
    moved: Trajectory, calibration: Calibration, steady: tuple[Array, Array, Array]
) -> tuple[Array, Array]:
    r, d, u_0 = steady
    u = quat.rotate(quat.conjugate(moved.q_GS), VERTICAL)
    common = r + (u - u_0)[..., None] * d[:, None]  # (n, segments, 3, m) of the orientations
    own = _own_covariance(moved, calibration, u, u_0)  # (n, segments, 3, 3), each sensor for itself
    angles = np.where(IS_DOF, moved.angles, 0.0)
    q_pc = joint_angles.compose(angles)
    by_child, by_parent = _angle_jacobians(angles, q_pc)
    of_angles = by_child @ common[:, CHILDREN] + by_parent @ common[:, PARENTS]
    variance = (of_angles**2).sum(axis=-1)
    for J, side in ((by_child, CHILDREN), (by_parent, PARENTS)):
        variance += ((J @ own[:, side]) * J).sum(axis=-1)
    return np.sqrt(variance), np.sqrt(
        _tip_variance(calibration, angles, q_pc, (by_child, by_parent), of_angles, own)
    )


def _angle_jacobians(angles: Array, q_pc: Array) -> tuple[Array, Array]:
    """Derivatives (n, joints, 3, 3) of the angles by the errors of the orientations of child and parent."""
    held = angles.copy()  # at 90 deg of deviation flexion and pronation are one
    held[..., DEVIATION] = np.clip(held[..., DEVIATION], -np.radians(80), np.radians(80))
    by_child = np.linalg.inv(joint_angles.axes(held)) * IS_DOF[..., None]
    return by_child, -by_child @ quat.matrix(quat.conjugate(q_pc))


def _own_covariance(moved: Trajectory, calibration: Calibration, u: Array, u_0: Array) -> Array:
    """Covariance of the independent error of each sensor's orientation (n, segments, 3, 3): accelerometer bias, vertical of the fusion, drift of the heading, skin, unrest in the pose."""
    away = u - u_0
    acc = (PARAMS.acc_bias / GRAVITY) ** 2
    tilt = np.array(
        [calibration.quality[s].tilt_change if s in calibration.quality else 0.0 for s in SEGMENTS]
    )
    inclined = math.radians(PARAMS.inclination) ** 2
    every_axis = acc * (away**2).sum(axis=-1) + inclined + _skin(moved.angles) + tilt**2
    upright = _heading_variance(moved.t, calibration) - inclined
    return np.asarray(
        every_axis[..., None, None] * np.eye(3)
        + upright[..., None, None] * u[..., :, None] * u[..., None, :]
        - acc * away[..., :, None] * away[..., None, :]
    )


def _skin(angles: Array) -> Array:
    """Variance (n, segments) about each axis of the soft-tissue artefact of the child's sensor of a bent joint."""
    size = np.radians(PARAMS.skin) / (np.pi / 2) / np.sqrt(3.0)
    found = np.zeros((len(angles), len(SEGMENTS)))
    flexion = np.nan_to_num(angles[..., FLEXION])  # an unknown joint counts as straight
    found[:, CHILDREN] = (size * flexion) ** 2 * np.where(_FIRST, 2.0, 1.0)
    return found


def _heading_variance(t: Array, calibration: Calibration) -> Array:
    """Of each sensor's heading (n, segments), rad^2, as noise and bias of its gyroscope make it grow from the pose on."""
    passed = np.maximum(np.abs(t - 0.5 * (calibration.t + calibration.end)), 0.0)[:, None]
    scatter = [
        max(q.rate_wander / 3.0, q.bias_sd or 0.0) if q else np.radians(PoseParams.pose_rate)
        for q in map(calibration.quality.get, SEGMENTS)
    ]
    bias = np.radians(PARAMS.bias_sd) ** 2 + np.square(scatter)
    walk, noise = np.radians(PARAMS.bias_walk) ** 2, np.radians(PARAMS.gyr_noise) ** 2
    return np.asarray(bias * passed**2 + walk * passed**3 / 3.0 + noise * passed / 2.0)


def _tip_variance(
    calibration: Calibration,
    angles: Array,
    q_pc: Array,
    jacobians: tuple[Array, Array],
    of_angles: Array,
    own: Array,
) -> Array:
    """Of the tips (n, 5, 3) m^2: errors of a chain's joints together, as neighbours share a sensor, and of its lengths."""
    known = np.isfinite(q_pc[:, JOINT["wrist"], 0])[:, None]  # an unknown wrist counts as neutral
    R = quat.matrix(np.where(known, q_pc[:, JOINT["wrist"]], quat.IDENTITY))[:, None]
    roots = np.einsum("nab,fb->nfa", R[:, 0], calibration.geometry.roots())
    ends = forward_kinematics.joint_places(q_pc, calibration.geometry)
    centres = np.concatenate([np.zeros_like(roots)[:, :, None], roots[:, :, None], ends], axis=2)
    tip = ends[:, :, 2]
    variance = _by_lengths(calibration, R[:, 0], ends, roots)
    by_sensor = np.zeros((5, *roots.shape, 3))  # derivative by forearm, hand and three segments
    common = np.zeros((*roots.shape, of_angles.shape[-1]))
    for k, joints in enumerate(_CHAINS.T):
        if k:
            R = R @ quat.matrix(q_pc[:, joints])
        axes, arm = R @ joint_angles.axes(angles[:, joints]), (tip - centres[:, :, k])[..., None]
        J = np.cross(axes, arm, axisa=2, axisb=2, axisc=2)  # of the tip by the joint's angles
        used = known[..., None, None] if k == 0 else np.True_
        for side, jacobian in ((k + 1, jacobians[0]), (k, jacobians[1])):
            by_sensor[side] += np.where(used, J @ jacobian[:, joints], 0.0)
        common += np.where(used, J @ of_angles[:, joints], 0.0)
    segments = [PARENTS[_CHAINS[:, 0]], *CHILDREN[_CHAINS].T]
    for k, (J, s) in enumerate(zip(by_sensor, segments)):
        Q = np.where(known[..., None, None], own[:, s], 0.0) if k == 0 else own[:, s]
        variance += ((J @ Q) * J).sum(axis=-1)
    return np.asarray(variance + (common**2).sum(axis=-1))


def _by_lengths(calibration: Calibration, R_wrist: Array, ends: Array, roots: Array) -> Array:
    bones = np.diff(np.concatenate([roots[:, :, None], ends], axis=2), axis=2)  # (n, 5, 3, 3)
    turned = np.broadcast_to(R_wrist[:, None], (*roots.shape[:2], 3, 3))
    J = np.concatenate([turned, bones.transpose(0, 1, 3, 2)], axis=3)
    C = length_covariance.covariance(calibration.geometry, LENGTH_SD, calibration.lengths_sd)
    C += length_covariance.of_palm(calibration.geometry)
    return np.asarray(((J @ C) * J).sum(axis=-1))
