"""How the true joints follow from the rotations between sensors that sit askew on their segments, and what one pose tells of that.

In      rotations q_pc between the (calibrated) frames of neighbouring sensors, seats q_SB (segment to sensor) and skin (turn of a sensor on its segment
        in rad per rad of its joint's flexion)
Out     true joint rotations, their derivatives by all error states of a chain, the covariance of those after the initial pose
Source  ours; that a sensor is turned by its skin in proportion to flexion is the first order of what is not known better
Limits  the hand's sensor is not turned by skin: its part is counted to the chain's first joint
"""

import math
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import FLEXION
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.kernels import right_jacobian_row
from handscope.estimators.numerics.small_matrices import block, product
from handscope.estimators.numerics.typing import Array, Bools

ANGLES, BIASES, SENSOR_TO_SEGMENT, SOFT_TISSUE, FIELD_DIFFERENCE = (
    slice(0, 9),
    slice(9, 21),
    slice(21, 33),
    slice(33, 42),
    42,
)
SIZE = 43  # the last: by what the field at the tip differs from the hand's (estimators/finger_ekf/magnetic_heading.py); nothing where it is not asked for


@dataclass(frozen=True, kw_only=True)
class SensorToSegmentParams:
    misalignment: float = option(
        4.5,
        "deg",
        "turn of a sensor against its segment about each axis, where no functional calibration tells it",
        "sensors 5-10 deg askew: Salchow-Hoemmen 2019, 5",
        least=1e-3,
    )
    skin: float = option(
        2.0,
        "deg",
        "turn of a sensor on its segment while its joint bends by 90 deg",
        "skin moves with the joint; size ours",
        least=1e-3,
    )
    pose_sd: float = option(
        2.0,
        "deg",
        "what a person misses the initial pose by, each freedom of a joint that was not measured",
        "ours: how careful a person is is not known; any standard deviation from 1.5 to 2.5 deg counted as likely",
        least=1e-3,
    )
    angle_sd: float = option(
        0.3,
        "deg",
        "error of gravity's direction in a sensor in the pose",
        "ours: 0.05 m/s^2 of accelerometer bias",
        least=1e-6,
    )


@dataclass(frozen=True)
class SensorToSegmentPrior:
    """What is known of how the sensors of F chains sit before they move."""

    covariance: Array  # (F, 12, 12) rad^2, of the four sensors' turns against their segments, about the segments' axes
    pose_sd: Array  # (F, 3, 3) rad, of each joint's angles in the pose
    aligned: Bools  # (F, 4) the pose has turned its frame until gravity agrees, so it is tilted as the chain's first; else it is as it is


def covariance_after_pose(
    params: SensorToSegmentParams, q_pc: Array, acc: Array, free: Bools, prior: SensorToSegmentPrior
) -> Array:
    """Covariance (F, 43, 43) of the error states of joints and seats once the pose has told q_pc (F, 3, 4); acc (F, 4, 3) points up in it.

    The pose knows the true joints but for what the person misses, and gravity in every sensor; it never sees turns about the vertical. The
    errors are written as a matrix times independent ones: twelve of the seats, gravity in each sensor, what is missed of each joint's pose, the skins.
    """
    chains = len(q_pc)
    L = np.zeros((chains, SIZE, 42))
    gravity_error = np.radians(params.angle_sd)
    gain_sd = (
        np.radians(params.skin) / (np.pi / 2) / np.sqrt(3) * np.array([np.sqrt(2), 1.0, 1.0])
    )  # of the first joint that of both sensors
    L[:, 21:33, 0:12] = _root(prior.covariance)
    L[:, range(33, 42), range(33, 42)] = np.repeat(gain_sd, 3)
    R_cp = quat.matrix(quat.conjugate(q_pc))
    angles = joint_angles.decompose(q_pc)
    soft_tissue_turn = angles[..., FLEXION, None, None] * L[:, 33:42].reshape(
        chains, 3, 3, 42
    )  # what turns the sensors already
    for j in range(3):
        up = _upwards(acc[:, j + 1])
        about = up[:, :, None] * up[:, None, :]
        level, place, gravity = np.eye(3) - about, slice(24 + 3 * j, 27 + 3 * j), 12 + 3 * j
        pose, tilt = np.zeros((chains, 3, 42)), np.zeros((chains, 3, 42))
        pose[:, :, 24 + 3 * j : 27 + 3 * j] = (prior.pose_sd[:, j] * free[:, j])[
            :, None
        ] * joint_angles.axes(angles[:, j])
        tilt[:, :, gravity : gravity + 3], tilt[:, :, gravity + 3 : gravity + 6] = (
            -gravity_error * level @ R_cp[:, j],
            gravity_error * level,
        )
        parent = L[:, 21 + 3 * j : 24 + 3 * j] - (soft_tissue_turn[:, j - 1] if j else 0.0)
        asked = (
            pose + R_cp[:, j] @ parent + soft_tissue_turn[:, j]
        )  # dth + m_c: the joint is as asked but for what is missed
        q_SB_rows = np.where(
            prior.aligned[:, j + 1, None, None],
            about @ L[:, place] + level @ (asked - tilt),
            L[:, place],
        )
        L[:, place] = q_SB_rows
        L[:, 3 * j : 3 * j + 3] = tilt + about @ (asked - q_SB_rows)
    return np.asarray(L @ L.transpose(0, 2, 1))


@inlined
def propagate_joints_row(q_pc: Array, delta_q: Array, q_new: Array) -> None:
    """Joint rotations (3, 4) after the four sensors have turned by (4, 4): exp(-w_p dt) q exp(w_c dt). (2.3) with (2.17), exact"""
    back, half = np.empty(4), np.empty(4)
    for j in range(3):
        quat.conjugate_row(delta_q[j], back)
        quat.multiply_row(back, q_pc[j], half)
        quat.multiply_row(half, delta_q[j + 1], back)
        quat.normalize_row(back, q_new[j])


@inlined
def joint_rotation_row(
    q_pc: Array, q_SB: Array, soft_tissue_gain: Array, q: Array, q_SB_bent: Array, flexion: Array
) -> None:
    """True joints (3, 4), seats of their children as the skin has turned them (3, 4), flexions (3,) that count for the skin."""
    inverse, half, bent, soft_tissue_turn, before, turn = (
        np.empty(4),
        np.empty(4),
        np.empty(4),
        np.empty(4),
        np.empty(4),
        np.empty(3),
    )
    for j in range(3):
        quat.conjugate_row(q_SB[j], inverse)
        quat.multiply_row(inverse, q_pc[j], half)
        quat.multiply_row(half, q_SB[j + 1], bent)  # were it not for the skin
        w, x, y, z = bent[0], bent[1], bent[2], bent[3]
        flexion[j] = math.atan2(
            2 * (w * z - x * y), w * w - x * x + y * y - z * z
        )  # as joint_angles.decompose
        for a in range(3):
            turn[a] = -flexion[j] * soft_tissue_gain[j, a]
        quat.exp_row(turn, half, soft_tissue_turn)
        quat.multiply_row(q_SB[j + 1], soft_tissue_turn, q_SB_bent[j])
        quat.multiply_row(bent, soft_tissue_turn, half)
        quat.multiply_row(before, half, q[j])
        if j == 0:
            for a in range(4):
                q[j, a] = half[a]
        quat.conjugate_row(soft_tissue_turn, before)


@inlined
def joint_jacobian_row(
    q_pc: Array, q_SB: Array, soft_tissue_gain: Array, q: Array, A: Array
) -> None:
    """True joints q (3, 4) of rotations (3, 4) between sensors, and A (9, 43): how their errors d, q_true = q exp(d), follow from the chain's error
    states; flexion counts as known where it turns the skin."""
    q_SB_bent, flexion, inverse, turn = np.empty((3, 4)), np.empty(3), np.empty(4), np.empty(3)
    R_cs, R_cp, by_parent = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    of_q_SB, of_gain = np.empty((3, 3, 3)), np.empty((3, 3, 3))
    joint_rotation_row(q_pc, q_SB, soft_tissue_gain, q, q_SB_bent, flexion)
    for j in range(3):
        for a in range(3):
            turn[a] = flexion[j] * soft_tissue_gain[j, a]
        quat.exp_row(turn, inverse, inverse)
        quat.matrix_row(inverse, turn, of_q_SB[j])
        for a in range(3):
            turn[a] = -turn[a]
        right_jacobian_row(turn, of_gain[j])
        quat.conjugate_row(q_SB_bent[j], inverse)
        quat.matrix_row(inverse, turn, R_cs)  # sensor to its segment
        quat.conjugate_row(q[j], inverse)
        quat.matrix_row(inverse, turn, R_cp)
        block(1.0, R_cs, 3 * j, 3 * j, A)
        block(1.0, of_q_SB[j], 3 * j, 24 + 3 * j, A)
        block(-flexion[j], of_gain[j], 3 * j, 33 + 3 * j, A)
        if j == 0:
            block(-1.0, R_cp, 0, 21, A)
        else:
            product(R_cp, of_q_SB[j - 1], by_parent)
            block(-1.0, by_parent, 3 * j, 21 + 3 * j, A)
            product(R_cp, of_gain[j - 1], by_parent)
            block(flexion[j - 1], by_parent, 3 * j, 30 + 3 * j, A)


@inlined
def true_joints_row(
    q_pc: Array, q_SB: Array, soft_tissue_gain: Array, delta_q: Array, q: Array
) -> None:
    """True joint rotations (3, 4) after the sensors have turned by (4, 4)."""
    q_now, q_SB_bent, flexion = np.empty((3, 4)), np.empty((3, 4)), np.empty(3)
    propagate_joints_row(q_pc, delta_q, q_now)
    joint_rotation_row(q_now, q_SB, soft_tissue_gain, q, q_SB_bent, flexion)


@inlined
def inject_error(
    q_pc: Array,
    bias: Array,
    q_SB: Array,
    soft_tissue_gain: Array,
    field_difference: Array,
    dx: Array,
) -> None:
    """The errors found are put into the rotations, whose covariance changes by that only in the second order."""
    d, q_dx, q_new = np.empty(3), np.empty(4), np.empty(4)
    for i in range(7):
        q, first = (q_pc[i], 3 * i) if i < 3 else (q_SB[i - 3], 12 + 3 * i)
        for a in range(3):
            d[a] = dx[first + a]
        quat.exp_row(d, q_dx, q_dx)
        quat.multiply_row(q, q_dx, q_new)
        quat.normalize_row(q_new, q)
    for i in range(12):
        bias[i // 3, i % 3] += dx[9 + i]
    for i in range(9):
        soft_tissue_gain[i // 3, i % 3] += dx[33 + i]
    field_difference[0] += dx[FIELD_DIFFERENCE]


def _root(covariance: Array) -> Array:
    """R with R R' = covariance (..., n, n), which may be singular: one sensor may stand in a chain more than once."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :])


def _upwards(acc: Array) -> Array:
    """Unit vectors; where nothing is known the back of a flat hand."""
    size = np.sqrt((acc * acc).sum(axis=-1, keepdims=True))
    return np.where(size > 0, acc / np.where(size > 0, size, 1.0), np.array([1.0, 0.0, 0.0]))
