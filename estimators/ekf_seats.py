"""How the true joints follow from the rotations between sensors that sit askew on their segments, and what one pose tells of that.

In      rotations q_pc between the (calibrated) frames of neighbouring sensors, seats q_SB (segment to sensor) and skin (turn of a sensor on its segment
        in rad per rad of its joint's flexion)
Out     true joint rotations, their derivatives by all 42 error states of a chain, the covariance of those after the initial pose
Source  ours; that a sensor is turned by its skin in proportion to flexion is the first order of what is not known better
Limits  the hand's sensor is not turned by skin: its part is counted to the chain's first joint
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimators import quaternions as quat
from estimators.options import option
from estimators.quaternions import Array

ANGLES, BIASES, SEATS, SKIN = slice(0, 9), slice(9, 21), slice(21, 33), slice(33, 42)
SIZE = 42
AXIS_OF = (2, 0, 1)  # flexion turns about z, deviation about x, pronation about y


@dataclass(frozen=True, kw_only=True)
class SeatParams:
    misalignment: float = option(
        4.5, "deg", "turn of a sensor against its segment about each axis", "sensors 5-10 deg askew: Salchow-Hoemmen 2019, 5", least=1e-3
    )
    skin: float = option(
        2.0, "deg", "turn of a sensor on its segment while its joint bends by 90 deg", "skin moves with the joint; size ours", least=1e-3
    )
    pose_sd: float = option(
        1.45, "deg", "what a person misses the initial pose by, each freedom of a joint", "ours: at most 2.5 deg, evenly spread", least=1e-3
    )
    angle_sd: float = option(
        0.3, "deg", "error of gravity's direction in a sensor in the pose", "ours: 0.05 m/s^2 of accelerometer bias", least=1e-6
    )


@dataclass(frozen=True)
class Seated:
    """The true joints of F chains."""

    q: Array  # (F, 3, 4)
    A: Array  # (F, 9, 42) how their errors d, q_true = q exp(d), follow from the chain's error states


def carried(q_pc: Array, turned: Array) -> Array:
    """Joint rotations (..., 3, 4) after the four sensors have turned by (..., 4, 4): exp(-w_p dt) q exp(w_c dt). (2.3) with (2.17), exact"""
    return quat.normalize(quat.multiply(quat.multiply(quat.conjugate(turned[..., :3, :]), q_pc), turned[..., 1:, :]))


def joints(q_pc: Array, seat: Array, skin: Array, turned: Array) -> Array:
    """True joint rotations (..., 3, 4) after the sensors have turned by (..., 4, 4)."""
    return _joints(carried(q_pc, turned), seat, skin)[0]


def seated(q_pc: Array, seat: Array, skin: Array) -> Seated:
    """The true joints of rotations (F, 3, 4) between sensors, with derivatives; flexion counts as known where it turns the skin."""
    q, q_SB, flexion = _joints(q_pc, seat, skin)
    A = np.zeros((len(q), 9, SIZE))
    R_cs, R_cp = quat.matrix(quat.conjugate(q_SB)), quat.matrix(quat.conjugate(q))  # sensor to its segment; parent to child
    turn = flexion[..., None] * skin
    of_seat, of_skin = quat.matrix(quat.exp(turn)), -flexion[..., None, None] * right_jacobian(-turn)
    for j in range(3):
        rows, seat_c, skin_c = slice(3 * j, 3 * j + 3), slice(24 + 3 * j, 27 + 3 * j), slice(33 + 3 * j, 36 + 3 * j)
        A[:, rows, rows], A[:, rows, seat_c], A[:, rows, skin_c] = R_cs[:, j], of_seat[:, j], of_skin[:, j]
        if j == 0:
            A[:, rows, 21:24] = -R_cp[:, 0]
        else:
            A[:, rows, 21 + 3 * j : 24 + 3 * j] = -R_cp[:, j] @ of_seat[:, j - 1]
            A[:, rows, 30 + 3 * j : 33 + 3 * j] = -R_cp[:, j] @ of_skin[:, j - 1]
    return Seated(q, A)


def after_pose(params: SeatParams, q_pc: Array, acc: Array, free: NDArray[np.bool_], aligned: bool = True) -> Array:
    """Covariance (F, 42, 42) of the error states of joints and seats once the pose has told q_pc (F, 3, 4); acc (F, 4, 3) points up in it.

    The pose knows the true joints but for what the person misses, and gravity in every sensor; it never sees turns about the vertical. `aligned`: the
    sensors' frames were turned until gravity agrees, so they are tilted as the chain's first; else each is askew on its own. The errors are written as
    a matrix times independent ones: the first seat, gravity in each sensor, then for each joint seat and missed pose.
    """
    chains = len(q_pc)
    L = np.zeros((chains, SIZE, 33))
    askew, missed, seen = (np.radians(sd) for sd in (params.misalignment, params.pose_sd, params.angle_sd))
    L[:, 21:24, 0:3] = askew * np.eye(3)
    R_cp = quat.matrix(quat.conjugate(q_pc))
    for j in range(3):
        up = _upwards(acc[:, j + 1])
        about = up[:, :, None] * up[:, None, :]
        level, own, gravity = np.eye(3) - about, 15 + 6 * j, 3 + 3 * j
        pose, tilt = np.zeros((chains, 3, 33)), np.zeros((chains, 3, 33))
        pose[:, AXIS_OF, range(own + 3, own + 6)] = missed * free[:, j]
        tilt[:, :, gravity : gravity + 3], tilt[:, :, gravity + 3 : gravity + 6] = -seen * level @ R_cp[:, j], seen * level
        asked = pose + R_cp[:, j] @ L[:, 21 + 3 * j : 24 + 3 * j]  # dth + m_c: the joint is as asked but for what is missed
        seat = np.zeros((chains, 3, 33))
        seat[:, :, own : own + 3] = askew * (about if aligned else np.eye(3))
        if aligned:
            seat += level @ (asked - tilt)
        L[:, 24 + 3 * j : 27 + 3 * j] = seat
        L[:, 3 * j : 3 * j + 3] = tilt + about @ (asked - seat)
    P = L @ L.transpose(0, 2, 1)
    skin = np.radians(params.skin) / (np.pi / 2) / np.sqrt(3) * np.array([np.sqrt(2), 1.0, 1.0])  # of the first joint that of both sensors
    P[:, range(33, 42), range(33, 42)] = np.repeat(skin**2, 3)
    return np.asarray(P)


def right_jacobian(v: Array) -> Array:
    """exp(v + dv) = exp(v) exp(J dv), (..., 3, 3)."""
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    sq = x * x + y * y + z * z
    small = sq < 1e-6
    safe = np.where(small, 1.0, sq)
    angle = np.sqrt(safe)
    a = np.where(small, 0.5 - sq / 24, (1 - np.cos(angle)) / safe)
    b = np.where(small, 1 / 6 - sq / 120, (angle - np.sin(angle)) / (safe * angle))
    S = quat.skew(v)
    return np.asarray(np.eye(3) - a[..., None, None] * S + b[..., None, None] * (S @ S))


def _joints(q_pc: Array, seat: Array, skin: Array) -> tuple[Array, Array, Array]:
    """True joints (..., 3, 4), seats of their children as the skin has turned them (..., 3, 4), flexions (..., 3) that count for the skin."""
    bent = quat.multiply(quat.multiply(quat.conjugate(seat[..., :3, :]), q_pc), seat[..., 1:, :])  # were it not for the skin
    flexion = _flexion(bent)
    by_skin = quat.exp(-flexion[..., None] * skin)
    q = quat.multiply(bent, by_skin)
    q[..., 1:, :] = quat.multiply(quat.conjugate(by_skin[..., :2, :]), q[..., 1:, :])
    return q, quat.multiply(seat[..., 1:, :], by_skin), flexion


def _flexion(q: Array) -> Array:
    """Of joint_angles.decompose the first."""
    w, x, y, z = (q[..., k] for k in range(4))
    return np.asarray(np.arctan2(2 * (w * z - x * y), w * w - x * x + y * y - z * z))


def _upwards(acc: Array) -> Array:
    """Unit vectors; where nothing is known the back of a flat hand."""
    size = np.sqrt((acc * acc).sum(axis=-1, keepdims=True))
    return np.where(size > 0, acc / np.where(size > 0, size, 1.0), np.array([1.0, 0.0, 0.0]))
