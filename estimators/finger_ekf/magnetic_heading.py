"""Heading of a chain from the magnetometers of hand and fingertip: both see the same horizontal field.

In      fields (2, 3) uT in the frames of the chain's first and last sensor, their verticals, rotations q_pc between the sensors
Out     one row of a Kalman update: innovation (heading difference of the two fields), Jacobian, noise
Source  Kortier, thesis ch. 2: (2.24)-(2.26) over the three joints between hand and tip, as a heading, for the accelerometers give the vertical; gates as (2.27), on the field's strength and vertical part. Ours: the difference of two magnetometers is an error state that persists while they keep their orientation and decorrelates over a turn of one radian
Limits  a field that differs between hand and tip in direction only passes the gates on strength; its innovation must lie within three standard deviations
"""

import math
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.finger_ekf.kernel_params import KernelParams
from handscope.estimators.finger_ekf.sensor_to_segment import ERROR
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.small_matrices import variance_of
from handscope.estimators.numerics.typing import Array

LEAST = 3.0  # uT, weakest horizontal field that is used
UNLIKELY = 3.0  # standard deviations
# rad, sd of a heading known well enough to judge the room by
KNOWN = math.radians(5.0)
LOOKS = 50.0  # updates over which rejections are averaged: 10 s
DISTURBED = 0.1  # share of rejections beyond which the room is not trusted


@dataclass(frozen=True, kw_only=True)
class MagnetometerParams:
    """Options of the heading update."""

    magnetometers: bool = option(
        False,
        "",
        "use the magnetometers of the hand and of fingertips, where there are any, for the fingers' headings",
        "Kortier thesis, 2.2.3, (2.24)-(2.27)",
    )
    mag_noise: float = option(
        0.6,
        "uT",
        "white noise of a magnetometer axis",
        "MPU-9250 product specification: 4 counts of 0.15 uT",
        least=1e-3,
    )
    mag_error: float = option(
        1.5,
        "uT",
        "what a magnetometer's axis errs by in one orientation and place: bias, scale, the room",
        "ours: 1 uT of bias, 1 % of 50 uT, a room",
        least=1e-3,
    )
    mag_gate: float = option(
        5.0,
        "uT",
        "fields at hand and tip that differ by more in size or in their vertical part are left out",
        "Kortier thesis, (2.27); size ours",
    )


@inlined
def heading_row(
    p: KernelParams,
    q_pc: Array,
    mag: Array,
    up: Array,
    field_difference: Array,
    P: Array,
    innovation: Array,
    H: Array,
    noise: Array,
) -> bool:
    """Fill row 0 of an update: heading of the tip's field against the hand's, corrected by `field_difference` (2,) (uT, share of rejections); false where it must not be used.

    With y the tip's field in the hand's frame, b its horizontal part and u the vertical there, what
    turns y by d changes that heading by (u - (u.y) / |b|^2 b).d: where the field dips steeply,
    tilts count more than headings.
    """
    R, q, q_next, y = np.empty((3, 3, 3)), q_pc[0].copy(), np.empty(4), np.empty(3)
    quat.matrix_row(q, y, R[0])
    for j in range(1, 3):
        quat.multiply_row(q, q_pc[j], q_next)
        for a in range(4):
            q[a] = q_next[a]
        quat.matrix_row(q, y, R[j])
    quat.rotate_row(q, mag[1], y)
    u, at_hand, b = up[0], mag[0].copy(), np.empty(3)
    down_hand, down = _dot(u, at_hand), _dot(u, y)
    # (2.27)
    gates = (
        abs(math.sqrt(_dot(at_hand, at_hand)) - math.sqrt(_dot(y, y))) < p.mag_gate
        and abs(down_hand - down) < p.mag_gate
    )
    for a in range(3):
        at_hand[a] -= down_hand * u[a]
        b[a] = y[a] - down * u[a]
    size, least = math.sqrt(_dot(b, b)), math.sqrt(_dot(at_hand, at_hand))
    if not min(size, least) > LEAST:
        return False
    across = u[0] * (at_hand[1] * b[2] - at_hand[2] * b[1]) + u[1] * (
        at_hand[2] * b[0] - at_hand[0] * b[2]
    )
    across += u[2] * (at_hand[0] * b[1] - at_hand[1] * b[0])
    innovation[0] = field_difference[0] / size - math.atan2(across, _dot(at_hand, b))
    for j in range(3):
        for a in range(3):
            for c in range(3):
                H[0, 3 * j + a] += (u[c] - down / (size * size) * b[c]) * R[j, c, a]
    known = variance_of(H[0], P) < KNOWN**2
    H[0, ERROR.field_difference] = -1.0 / size
    noise[0, 0] = 2 * (p.mag_noise / size) ** 2
    likely = gates and innovation[0] ** 2 < UNLIKELY**2 * (variance_of(H[0], P) + noise[0, 0])
    if known:
        field_difference[1] += ((0.0 if likely else 1.0) - field_difference[1]) / LOOKS
    return bool(likely and field_difference[1] < DISTURBED)


@inlined
def _dot(a: Array, b: Array) -> float:
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
