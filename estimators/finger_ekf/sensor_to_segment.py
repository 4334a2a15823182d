"""True joints from rotations between misaligned sensors, and the covariance after the initial pose.

In      rotations q_pc between the calibrated frames of neighbouring sensors, q_SB (segment to sensor), soft-tissue gain (rotation of a sensor on its segment, rad per rad of flexion)
Out     true joint rotations, their derivatives by all error states of a chain, the covariance of
        those after the initial pose
Source  ours; a soft-tissue artefact proportional to flexion is the first-order model
Limits  the hand's soft-tissue artefact is counted with the chain's first joint
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from handscope.estimators.alignment.initial_pose import PoseErrorParams
from handscope.estimators.data.options import option
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import FLEXION
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.kernels import right_jacobian_row
from handscope.estimators.numerics.small_matrices import block, product
from handscope.estimators.numerics.typing import Array, Bools


class ErrorState(NamedTuple):
    """First rows of the parts of a chain's error state, three rows each joint or sensor. Turns are on
    the right: q = q^ exp(dth)."""

    angles: int = 0  # rad, of q_pc of three joints
    bias: int = 9  # rad/s, of four gyroscopes
    q_SB: int = 21  # rad, of four sensors on their segments
    soft_tissue: int = 33  # rad per rad of flexion, of three joints
    # one row, uT, horizontal, of the field between tip and hand; unused without magnetometers
    field_difference: int = 42


ERROR = ErrorState()
SIZE = ERROR.field_difference + 1


@dataclass(frozen=True, kw_only=True)
class SensorToSegmentParams(PoseErrorParams):
    """Options of the sensor-to-segment states; angles in deg."""

    misalignment: float = option(
        4.5,
        "deg",
        "turn of a sensor against its segment about each axis, where no functional calibration tells it",
        "sensors misaligned by 5-10 deg: Salchow-Hoemmen 2019, 5",
        least=1e-3,
    )
    skin: float = option(
        2.0,
        "deg",
        "turn of a sensor on its segment while its joint bends by 90 deg",
        "skin moves with the joint; size ours",
        least=1e-3,
    )
    pose_inference: bool = option(
        True,
        "",
        "correct the pose by what gravity in all sensors tells of it; a strip that is missing then changes the other fingers a little",
        "ours: docs/decisions/0014-pose-from-gravity.md",
    )


@dataclass(frozen=True)
class SensorToSegmentPrior:
    """Prior knowledge of the mounting of F chains."""

    # (F, 21, 21) rad^2, of the four sensors' misalignments about the segments' axes and of the three
    # joints' angles in the pose
    covariance: Array
    # (F, 4) the pose has rotated the sensor's frame until gravity agrees with the chain's first
    aligned: Bools


def covariance_after_pose(
    params: SensorToSegmentParams, q_pc: Array, acc: Array, free: Bools, prior: SensorToSegmentPrior
) -> Array:
    """Covariance (F, 43, 43) of the error states after the pose has given q_pc (F, 3, 4); acc (F, 4, 3) points up in it.

    The pose gives the true joints up to the person's pose error, and gravity in every sensor, but no turns about the vertical. The errors are a matrix times independent ones: 21 of the mounting and the pose, gravity in each sensor, soft-tissue gains.
    """
    chains = len(q_pc)
    L = np.zeros((chains, SIZE, 42))
    gravity_error = np.radians(params.angle_sd)
    # the first joint has that of both sensors
    gain_sd = np.radians(params.skin) / (np.pi / 2) / np.sqrt(3) * np.array([np.sqrt(2), 1.0, 1.0])
    root = _root(prior.covariance)
    L[:, ERROR.q_SB : ERROR.soft_tissue, 0:21] = root[:, :12]
    gains = range(ERROR.soft_tissue, ERROR.field_difference)
    L[:, gains, gains] = np.repeat(gain_sd, 3)
    R_cp = quat.matrix(quat.conjugate(q_pc))
    angles = joint_angles.decompose(q_pc)
    # soft-tissue rotation in the pose
    soft_tissue_turn = angles[..., FLEXION, None, None] * L[:, gains].reshape(chains, 3, 3, 42)
    for j in range(3):
        up = _upwards(acc[:, j + 1])
        about = up[:, :, None] * up[:, None, :]
        own, gravity = ERROR.q_SB + 3 * j, 21 + 3 * j
        level, place = np.eye(3) - about, slice(own + 3, own + 6)
        pose, tilt = np.zeros((chains, 3, 42)), np.zeros((chains, 3, 42))
        pose[:, :, :21] = joint_angles.axes(angles[:, j]) @ (
            free[:, j, :, None] * root[:, 12 + 3 * j : 15 + 3 * j]
        )
        tilt[:, :, gravity : gravity + 3], tilt[:, :, gravity + 3 : gravity + 6] = (
            -gravity_error * level @ R_cp[:, j],
            gravity_error * level,
        )
        parent = L[:, own : own + 3] - (soft_tissue_turn[:, j - 1] if j else 0.0)
        # dth + m_c: the joint as asked, up to the pose error
        asked = pose + R_cp[:, j] @ parent + soft_tissue_turn[:, j]
        q_SB_rows = np.where(
            prior.aligned[:, j + 1, None, None],
            about @ L[:, place] + level @ (asked - tilt),
            L[:, place],
        )
        L[:, place] = q_SB_rows
        L[:, 3 * j : 3 * j + 3] = tilt + about @ (asked - q_SB_rows)
    return np.asarray(L @ L.transpose(0, 2, 1))


class JointBuffers(NamedTuple):
    """What the rotations of a chain's joints are computed in: a loop over rows allocates it once."""

    inverse: Array  # (4,)
    half: Array  # (4,)
    bent: Array  # (4,)
    soft_tissue_turn: Array  # (4,)
    before: Array  # (4,)
    turn: Array  # (3,)
    q_now: Array  # (3, 4)
    q_SB_bent: Array  # (3, 4)
    flexion: Array  # (3,)


@inlined
def joint_buffers() -> JointBuffers:
    """Without any content."""
    return JointBuffers(
        np.empty(4),
        np.empty(4),
        np.empty(4),
        np.empty(4),
        np.empty(4),
        np.empty(3),
        np.empty((3, 4)),
        np.empty((3, 4)),
        np.empty(3),
    )


@inlined
def propagate_joints_row(q_pc: Array, delta_q: Array, q_new: Array) -> None:
    """Joint rotations (3, 4) after sensor rotations (4, 4): exp(-w_p dt) q exp(w_c dt). (2.3) with (2.17), exact"""
    _propagate_joints_row(q_pc, delta_q, np.empty(4), np.empty(4), q_new)


@inlined
def _propagate_joints_row(
    q_pc: Array, delta_q: Array, back: Array, half: Array, q_new: Array
) -> None:
    for j in range(3):
        quat.conjugate_row(delta_q[j], back)
        quat.multiply_row(back, q_pc[j], half)
        quat.multiply_row(half, delta_q[j + 1], back)
        quat.normalize_row(back, q_new[j])


@inlined
def joint_rotation_row(
    q_pc: Array, q_SB: Array, soft_tissue_gain: Array, buffers: JointBuffers, q: Array
) -> None:
    """True joints (3, 4); in the buffers q_SB of the children with soft tissue (3, 4), flexions (3,) that the artefact follows."""
    inverse, half, bent, soft_tissue_turn, before, turn = (
        buffers.inverse,
        buffers.half,
        buffers.bent,
        buffers.soft_tissue_turn,
        buffers.before,
        buffers.turn,
    )
    q_SB_bent, flexion = buffers.q_SB_bent, buffers.flexion
    for j in range(3):
        quat.conjugate_row(q_SB[j], inverse)
        quat.multiply_row(inverse, q_pc[j], half)
        quat.multiply_row(half, q_SB[j + 1], bent)  # without soft-tissue artefact
        w, x, y, z = bent[0], bent[1], bent[2], bent[3]
        # as joint_angles.decompose
        flexion[j] = math.atan2(2 * (w * z - x * y), w * w - x * x + y * y - z * z)
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
    """True joints q (3, 4) of rotations (3, 4) between sensors, and A (9, 43): derivative of their errors d, q_true = q exp(d), by the chain's error states; flexion counts as known in the soft-tissue term."""
    inverse, turn, buffers = np.empty(4), np.empty(3), joint_buffers()
    q_SB_bent, flexion = buffers.q_SB_bent, buffers.flexion
    R_cs, R_cp, by_parent = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    of_q_SB, of_gain = np.empty((3, 3, 3)), np.empty((3, 3, 3))
    joint_rotation_row(q_pc, q_SB, soft_tissue_gain, buffers, q)
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
        block(1.0, of_q_SB[j], 3 * j, ERROR.q_SB + 3 + 3 * j, A)
        block(-flexion[j], of_gain[j], 3 * j, ERROR.soft_tissue + 3 * j, A)
        if j == 0:
            block(-1.0, R_cp, 0, ERROR.q_SB, A)
        else:
            product(R_cp, of_q_SB[j - 1], by_parent)
            block(-1.0, by_parent, 3 * j, ERROR.q_SB + 3 * j, A)
            product(R_cp, of_gain[j - 1], by_parent)
            block(flexion[j - 1], by_parent, 3 * j, ERROR.soft_tissue + 3 * (j - 1), A)


@inlined
def true_joints_row(
    q_pc: Array,
    q_SB: Array,
    soft_tissue_gain: Array,
    delta_q: Array,
    buffers: JointBuffers,
    q: Array,
) -> None:
    """True joint rotations (3, 4) after sensor rotations (4, 4)."""
    _propagate_joints_row(q_pc, delta_q, buffers.inverse, buffers.half, buffers.q_now)
    joint_rotation_row(buffers.q_now, q_SB, soft_tissue_gain, buffers, q)


@inlined
def inject_error(
    q_pc: Array,
    bias: Array,
    q_SB: Array,
    soft_tissue_gain: Array,
    field_difference: Array,
    dx: Array,
) -> None:
    """Inject the estimated errors into the means; the reset changes the covariance only in second order."""
    d, q_dx, q_new = np.empty(3), np.empty(4), np.empty(4)
    for i in range(7):
        q, first = (q_pc[i], 3 * i) if i < 3 else (q_SB[i - 3], ERROR.q_SB + 3 * (i - 3))
        for a in range(3):
            d[a] = dx[first + a]
        quat.exp_row(d, q_dx, q_dx)
        quat.multiply_row(q, q_dx, q_new)
        quat.normalize_row(q_new, q)
    for i in range(12):
        bias[i // 3, i % 3] += dx[ERROR.bias + i]
    for i in range(9):
        soft_tissue_gain[i // 3, i % 3] += dx[ERROR.soft_tissue + i]
    field_difference[0] += dx[ERROR.field_difference]


def _root(covariance: Array) -> Array:
    """R with R R' = covariance (..., n, n), which may be singular: a sensor may occur twice in a chain."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :])


def _upwards(acc: Array) -> Array:
    """Unit vectors; dorsal where unknown."""
    size = np.sqrt((acc * acc).sum(axis=-1, keepdims=True))
    return np.where(size > 0, acc / np.where(size > 0, size, 1.0), np.array([1.0, 0.0, 0.0]))
