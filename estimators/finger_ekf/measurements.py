"""Measurements of the finger filter with their Jacobians: shared vertical and joint constraints.

In      rotations between the sensors of one chain, gravity or specific forces in their frames (4, 3), rates (4,); the true joints
Out     rows for a Kalman update: innovation, Jacobian H by the 43 error states, noise; unused rows have zero Jacobians and innovations
Source  Kortier, thesis ch. 2: (2.25)-(2.28) vectors of neighbouring segments with their gates,
        (2.29)-(2.32) joint constraints, written for angles: the same for small ones, and ranges of motion fit in; zero-rate updates as in VQF (Laidig & Seel 2023)
Limits  time-correlated noise counts as white noise, its variance scaled by correlation time over update interval; that of joints is the time that a chain has stayed, if it is long (mean_rest.py)
"""

import math
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.finger_ekf.kernel_params import KernelParams
from handscope.estimators.finger_ekf.sensor_to_segment import SIZE
from handscope.estimators.hand import anatomy as hand_anatomy
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import (
    DEVIATION,
    FINGER_JOINTS,
    FINGERS,
    FLEXION,
    IS_DOF,
    JOINT,
    PRONATION,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.jit import inlined, rowwise
from handscope.estimators.numerics.small_matrices import variance_of
from handscope.estimators.numerics.typing import Array, Bools

# s, time constant of the vertical at which Jacobians are taken; VQF's errors are correlated over 3 s
SETTLED = 20.0
FAR = math.cos(math.radians(10.0))  # cosine between verticals beyond which the filter restarts
STEEPEST = math.radians(80.0)  # flexion and pronation are one at 90 deg of deviation
# the wrist's chain has one joint
_CHAINS = [
    *([JOINT[j] for j in FINGER_JOINTS[f]] for f in FINGERS),
    [JOINT["wrist"]] * 3,
]
IS_FREE: Bools = IS_DOF[np.array(_CHAINS)]  # (6 chains, 3 joints, 3 angles)
LIMITS: Array = hand_anatomy.LIMITS[np.array(_CHAINS)]  # (6, 3, 3, 2) rad


@dataclass(frozen=True, kw_only=True)
class UpdateParams:
    """Options of the measurement updates."""

    vertical: str = option(
        "fused",
        "",
        "which way is up for a sensor: as its own fusion has it (VQF), or its accelerometer where the thesis' gates let it pass",
        "accelerometers: Kortier thesis, (2.25)-(2.28); fused: ours, not disturbed by movement",
        ("fused", "accelerometers"),
    )
    inclination: float = option(
        0.18,
        "deg",
        "error of gravity's direction as a sensor's fusion sees it, each axis, of a sensor that hardly turns; without what an accelerometer's bias makes of it",
        "VQF on ten BROAD trials: docs/decisions/0009-sizes-of-errors.md",
        least=0.01,
    )
    inclination_by_rate: float = option(
        0.0016,
        "s",
        "how much larger that error is, in rad, for a rate in rad/s (root mean square)",
        "VQF on ten BROAD trials: docs/decisions/0009-sizes-of-errors.md",
        least=0.0,
    )
    acc_bias: float = option(
        0.05,
        "m/s^2",
        "bias of an accelerometer axis: what it does to the vertical of a sensor that lies another way than in the pose is part of the standard deviations",
        "MPU-9250 specification, table 2, after a calibration of the strip; size ours, as the error of gravity in the pose",
        least=0.0,
    )
    inclination_time: float = option(
        3.0, "s", "time over which that error stays alike", "VQF's tauAcc", least=0.0
    )
    acc_noise: float = option(
        0.04,
        "m/s^2",
        "white noise of an accelerometer axis",
        "Kortier thesis, Table 2.1",
        least=1e-4,
    )
    acc_error: float = option(
        0.1,
        "m/s^2",
        "what two accelerometers at rest may differ by else: bias, scale",
        "ours; of the thesis' model none",
    )
    acc_gate: float = option(
        0.5,
        "m/s^2",
        "accelerometers whose magnitudes differ by more are left out",
        "Kortier thesis, (2.27); size ours",
    )
    rate_gate: float = option(
        2.0,
        "rad/s",
        "accelerometers of segments that turn faster are left out",
        "Kortier thesis, (2.28); size ours",
        least=0.01,
    )
    lever: float = option(
        0.04,
        "m",
        "distance between neighbouring sensors, over which turning makes them feel different accelerations",
        "ours: a phalanx",
    )
    dimensions: bool = option(
        True,
        "",
        "use what the joints cannot do",
        "Kortier thesis, (2.29)-(2.32); ranges: hand_anatomy.py",
    )
    dimension_noise: float = option(
        2.0,
        "deg",
        "turn of a true joint about an axis that is no freedom, or beyond its range, and of its sensors beyond seat and skin; more where a recording shows more",
        "ours; 1e-5 deg in Kortier's Table 2.1, which knows no soft tissue",
        least=1e-5,
    )
    correlation: float = option(
        1.0,
        "s",
        "time over which errors of accelerometers and joints stay alike",
        "ours: half a movement",
        least=0.0,
    )
    rest_rate: float = option(
        0.5,
        "deg/s",
        "a sensor that turns slower for 1.5 s rests",
        "ours; VQF's 2 deg/s takes the skin's turn over a moving finger for rest, more often one way than the other once a bias is wrong",
        least=0.01,
    )
    creeping: float = option(
        0.1,
        "deg/s",
        "rate at which a sensor that seems to rest still turns, for 1.5 s alike",
        "ours: as for the fusion of a single sensor; weighs as it does in VQF",
        least=1e-3,
    )


@inlined
def vectors_row(
    p: KernelParams,
    q_pc: Array,
    acc: Array,
    up: Array,
    inclination_variance: Array,
    rates: Array,
    both_sensors_valid: Array,
    span: float,
    innovation: Array,
    H: Array,
    noise: Array,
) -> None:
    """Rows 0..8, three a joint: both sensors see the same vector acc (4, 3); `both_sensors_valid` (3,) is 1 where both are measured, `inclination_variance` (4,) rad^2 applies to fused verticals.

    Turns about the vertical are unobservable. Jacobians are taken at `up` (4, 3), the low-passed vertical: at the newest one, whose errors change, the filter would gain spurious heading information (Huang, Mourikis & Roumeliotis 2010, Int J Rob Res 29:502).

    Neighbouring joints share a sensor, so their innovations are negatively correlated.
    """
    used, variance, R_pc, v = np.zeros(3), np.empty(3), np.empty((3, 3, 3)), np.empty(3)
    lasts = max(1.0, (p.inclination_time if p.fused else p.correlation) / span)
    for j in range(3):
        quat.matrix_row(q_pc[j], v, R_pc[j])
        if p.fused:
            used[j], variance[j] = (
                both_sensors_valid[j],
                GRAVITY**2 * (inclination_variance[j] + inclination_variance[j + 1]),
            )
        else:
            magnitude_difference, fastest = (
                abs(_norm(acc[j]) - _norm(acc[j + 1])),
                max(rates[j], rates[j + 1]),
            )
            if (
                both_sensors_valid[j] > 0
                and magnitude_difference < p.acc_gate
                and fastest < p.rate_gate
            ):  # (2.27), (2.28)
                used[j] = 1.0
            variance[j] = (
                2 * p.acc_noise**2
                + p.acc_error**2
                + magnitude_difference**2
                + (p.lever * fastest**2) ** 2
            )
        for a in range(3):
            noise[3 * j + a, 3 * j + a] = lasts * variance[j]
            v[a] = GRAVITY * up[j + 1, a]
        if used[j] > 0:
            vector_jacobian_row(R_pc[j], v, 3 * j, 3 * j, H)
            for a in range(3):
                r = R_pc[j, a]
                # (2.25)
                innovation[3 * j + a] = acc[j, a] - (
                    r[0] * acc[j + 1, 0] + r[1] * acc[j + 1, 1] + r[2] * acc[j + 1, 2]
                )
    for j in range(2):
        both = (
            GRAVITY**2 * inclination_variance[j + 1]
            if p.fused
            else 0.5 * math.sqrt(variance[j] * variance[j + 1])
        )
        # 0 for unused rows
        shared = -lasts * both * used[j] * used[j + 1]
        for a in range(3):
            for b in range(3):
                noise[3 * j + a, 3 * j + 3 + b] = noise[3 * j + 3 + b, 3 * j + a] = (
                    shared * R_pc[j, a, b]
                )


@inlined
def vector_jacobian_row(R_pc: Array, v_c: Array, row: int, column: int, H: Array) -> None:
    """Write the derivative of R_pc v_c by dth, -R_pc [v_c]x, into H. (2.26)"""
    for a in range(3):
        x, y, z = R_pc[a, 0], R_pc[a, 1], R_pc[a, 2]
        H[row + a, column] = v_c[1] * z - v_c[2] * y
        H[row + a, column + 1] = v_c[2] * x - v_c[0] * z
        H[row + a, column + 2] = v_c[0] * y - v_c[1] * x


@inlined
def smoothed_vertical_row(
    up: Array, delta_q: Array, acc: Array, vector_valid: Array, span: float, smoothed: Array
) -> None:
    """Low-pass the vertical (4, 3): carry it over the rotations `delta_q` (4, 4), then draw it towards valid readings."""
    back, carried = np.empty(4), np.empty(3)
    for s in range(4):
        quat.conjugate_row(delta_q[s], back)
        quat.rotate_row(back, up[s], carried)
        if vector_valid[s] > 0:
            size = _norm(acc[s])
            along = (
                carried[0] * acc[s, 0] + carried[1] * acc[s, 1] + carried[2] * acc[s, 2]
            ) / size
            # far: at the start or after a gap
            weight = 1.0 if along < FAR else min(1.0, span / SETTLED)
            for a in range(3):
                carried[a] += weight * (acc[s, a] / size - carried[a])
        size = _norm(carried)
        for a in range(3):
            smoothed[s, a] = carried[a] / size if size > 0 else carried[a]


@inlined
def joint_constraints_row(
    p: KernelParams,
    q: Array,
    A: Array,
    P: Array,
    compliance_variance: Array,
    free: Array,
    limits: Array,
    known: Array,
    lasts: float,
    innovation: Array,
    H: Array,
    noise: Array,
) -> None:
    """Rows 9..17, three a joint: forbidden angles are zero, the others within their range; soft; their errors are alike over `lasts` updates. (2.29)-(2.32)

    Jacobians are taken at the permitted angles, so that a hinge gains no spurious flexion information. The end of a range is one-sided: its noise includes the angle's own variance from P (43, 43).
    """
    angles, allowed, J = np.empty(3), np.empty(3), np.empty((3, 3))
    for j in range(3):
        joint_angles.decompose_row(q[j], angles, angles)
        for a in range(3):
            allowed[a] = min(max(angles[a], limits[j, a, 0]), limits[j, a, 1])
        angle_jacobian_row(allowed, allowed, J)
        unsure = max(P[3 * j, 3 * j], P[3 * j + 1, 3 * j + 1], P[3 * j + 2, 3 * j + 2])
        for a in range(3):
            row, outside = 9 + 3 * j + a, allowed[a] - angles[a]
            variance = (
                compliance_variance[j] if free[j, a] == 0 else p.dimension_noise**2
            ) + 0.5 * unsure * unsure
            if known[j] > 0 and p.dimensions and (free[j, a] == 0 or outside != 0):
                innovation[row] = outside
                for k in range(SIZE):
                    H[row, k] = (
                        J[a, 0] * A[3 * j, k]
                        + J[a, 1] * A[3 * j + 1, k]
                        + J[a, 2] * A[3 * j + 2, k]
                    )
                variance += variance_of(H[row], P) if free[j, a] > 0 else 0.0
            noise[row, row] = variance * lasts


@inlined
def _norm(v: Array) -> float:
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


@rowwise("(a),(v)->(a,v)")
def angle_jacobian(angles: Array, row: Array, J: Array) -> None:
    """Derivative J of flexion, deviation, pronation (..., 3) by d, q_true = q exp(d); `row`: any 3."""
    deviation = min(max(angles[DEVIATION], -STEEPEST), STEEPEST)
    c, s, cd, td = (
        math.cos(angles[PRONATION]),
        math.sin(angles[PRONATION]),
        math.cos(deviation),
        math.tan(deviation),
    )
    J[FLEXION, 0], J[FLEXION, 1], J[FLEXION, 2] = -s / cd, 0.0, c / cd
    J[DEVIATION, 0], J[DEVIATION, 1], J[DEVIATION, 2] = c, 0.0, s
    J[PRONATION, 0], J[PRONATION, 1], J[PRONATION, 2] = s * td, 1.0, -c * td


angle_jacobian_row = angle_jacobian.row
