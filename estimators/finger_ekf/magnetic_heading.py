"""What the magnetometers of hand and fingertip tell of the heading of a chain's joints: both see the same horizontal field.

In      fields (2, 3) uT that the chain's first and last sensors see in their frames, the vertical there, rotations q_pc between the sensors
Out     one row for a Kalman update: by what heading the two fields differ, its Jacobian by the chain's error states, its noise
Source  Kortier, thesis ch. 2: (2.24)-(2.26) over the three joints between hand and tip, as a heading: what is up is told by the accelerometers;
        gates as (2.27), on the size of the field and on its vertical part. Ours: by what two magnetometers differ is an error state, which stays as it is
        while they keep their orientation and is another after a turn of a radian, so that looks at one and the same error do not count as many
Limits  a field that differs between hand and tip in direction alone passes the gates on its size: what it seems to tell must lie within three of the
        filter's own standard deviations
"""

import math
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.finger_ekf.preintegration import MAG_GATE, MAG_NOISE
from handscope.estimators.finger_ekf.sensor_to_segment import FIELD_DIFFERENCE
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.small_matrices import variance_of
from handscope.estimators.numerics.typing import Array

LEAST = 3.0  # uT: a horizontal field that is weaker tells no heading
UNLIKELY = 3.0  # standard deviations
KNOWN = math.radians(
    5.0
)  # a heading that is known so well before the look tells what the room is like
LOOKS = 50.0  # over which that is averaged: 10 s of updates
DISTURBED = 0.1  # share of unlikely looks from which on a room is not trusted


@dataclass(frozen=True, kw_only=True)
class MagnetometerParams:
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


def pack_params(params: MagnetometerParams) -> Array:
    """The options as kernels take them; nothing errs, and nothing is used, where magnetometers are not asked for."""
    return np.array(
        [params.mag_noise, params.mag_error if params.magnetometers else 0.0, params.mag_gate]
    )


@inlined
def heading_row(
    p: Array,
    q_pc: Array,
    mag: Array,
    up: Array,
    field_difference: Array,
    P: Array,
    innovation: Array,
    H: Array,
    noise: Array,
) -> bool:
    """Row 0 of an update: the heading of the tip's field against the hand's, but for what they are `field_difference` (2,) (uT; the share of looks left out
    while the heading was known); false where it must not be used.

    With y the tip's field in the hand's frame, b its horizontal part and u the vertical there, what turns y by d changes that heading by
    (u - (u.y) / |b|^2 b).d: where the field dips steeply, tilts count more than headings.
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
    gates = (
        abs(math.sqrt(_dot(at_hand, at_hand)) - math.sqrt(_dot(y, y))) < p[MAG_GATE]
        and abs(down_hand - down) < p[MAG_GATE]
    )  # (2.27)
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
    H[0, FIELD_DIFFERENCE] = -1.0 / size
    noise[0, 0] = 2 * (p[MAG_NOISE] / size) ** 2
    likely = gates and innovation[0] ** 2 < UNLIKELY**2 * (variance_of(H[0], P) + noise[0, 0])
    if known:
        field_difference[1] += ((0.0 if likely else 1.0) - field_difference[1]) / LOOKS
    return bool(likely and field_difference[1] < DISTURBED)


@inlined
def _dot(a: Array, b: Array) -> float:
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
