"""Measurement updates from inertial readings and the standstill test; compiled.

In      state x, covariance P, errors dx and an InertialSample (state.py)
Out     dx and P in place
Source  Kortier, thesis ch. 5, (5.16)-(5.18)
Leaves  (5.16) takes any specific force of the size of g for gravity, with a new error at each
        sample; the acceleration of a swaying body returns with the sway and is not white. Ours:
        (5.16) only at standstill (Skog et al. 2010); a seated trunk and its hand have bounded
        speeds, so that accelerations average out. (5.18) only where trunk and hand both stand
        still: one alone does not determine the difference of two velocities
"""

import math
from typing import NamedTuple

import numpy as np

from handscope.estimators.magnet.tracker.state import (
    ERROR,
    STATE,
    InertialSample,
    NoiseModel,
    inject_error,
    scalar_update,
)
from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.kernels import (
    multiply_matrices,
    multiply_transposed,
    rotation_matrix,
    skew,
    transpose,
)
from handscope.estimators.numerics.small_matrices import block
from handscope.estimators.numerics.typing import Array

MOVING_SD = 4.0  # standard deviations of the velocity from which on a hand does not stand still


class Standstill(NamedTuple):
    """Which of the two sensors passes the standstill test."""

    base: bool
    target: bool


@inlined
def inertial_update(
    s: NoiseModel,
    x: Array,
    P: Array,
    now: InertialSample,
    still: Standstill,
    lost: bool,
    dt: float,
) -> Array:
    """All updates from inertial readings, in place; returns the state. For a lost hand nothing
    distinguishes a slow slide from rest."""
    dx, faster = np.zeros(len(P)), 0.0
    for i in range(3):
        faster += x[STATE.v_bt + i] ** 2 / (P[ERROR.v_bt + i, ERROR.v_bt + i] + s.still_speed**2)
    # a hand that slides without turning passes for still: not where its velocity is known
    target = still.target and not (still.base and faster > MOVING_SD**2)
    gravity_update(s, x, P, dx, now, Standstill(still.base, target), lost, dt)
    speed_update(s, x, P, dx, Standstill(still.base, target and not lost), dt)
    common_acceleration_update(s, x, P, dx, now, dt)
    if still.base and target and not lost:
        standstill_update(s, x, P, dx, now, dt)
    out: Array = inject_error(x, dx)
    return out


@inlined
def gravity_update(
    s: NoiseModel,
    x: Array,
    P: Array,
    dx: Array,
    now: InertialSample,
    still: Standstill,
    lost: bool,
    dt: float,
) -> None:
    """The accelerometer of a sensor at standstill reads gravity; of a lost hand to within the limit
    of the standstill test. (5.16)"""
    variance, up = s.acc_still**2 * s.acc_correlation_time / dt, np.zeros(3)
    up[2] = s.gravity
    g_b: Array = multiply_transposed(rotation_matrix(x[STATE.q_gb : STATE.q_gb + 4]), up)
    if still.base:
        base_gravity_update(x, P, dx, now.acc_b, g_b, variance)
    if still.target:
        if lost:
            variance = s.still_acc**2 * 2 * s.still_correlation_time / dt
        target_gravity_update(x, P, dx, now.acc_t, g_b, variance)


@inlined
def base_gravity_update(
    x: Array, P: Array, dx: Array, acc: Array, g_b: Array, variance: float
) -> None:
    """Of the trunk's accelerometer; g_b (3,) is what it reads of gravity."""
    H = np.zeros((3, len(P)))
    block(1.0, skew(g_b), 0, ERROR.th_gb, H)
    innovation = acc - x[STATE.acc_bias_b : STATE.acc_bias_b + 3] - g_b
    accelerometer_update(P, dx, H, ERROR.acc_bias_b, innovation, variance)


@inlined
def target_gravity_update(
    x: Array, P: Array, dx: Array, acc: Array, g_b: Array, variance: float
) -> None:
    """Of the hand's accelerometer; g_b (3,) is gravity in the base's axes."""
    R, H = rotation_matrix(x[STATE.q_bt : STATE.q_bt + 4]), np.zeros((3, len(P)))
    g_t: Array = multiply_transposed(R, g_b)
    block(1.0, skew(g_t), 0, ERROR.th_bt, H)
    block(1.0, multiply_matrices(transpose(R), skew(g_b)), 0, ERROR.th_gb, H)
    innovation = acc - x[STATE.acc_bias_t : STATE.acc_bias_t + 3] - g_t
    accelerometer_update(P, dx, H, ERROR.acc_bias_t, innovation, variance)


@inlined
def accelerometer_update(
    P: Array, dx: Array, H: Array, bias: int, innovation: Array, variance: float
) -> None:
    """The three axes of an accelerometer, one after the other; H (3, errors) gets its bias, the errors
    `bias` and after."""
    for i in range(3):
        H[i, bias + i] = 1.0
        scalar_update(P, dx, H[i], innovation[i], variance)


@inlined
def speed_update(
    s: NoiseModel, x: Array, P: Array, dx: Array, still: Standstill, dt: float
) -> None:
    """The speeds of a seated trunk and its hand are bounded; a wrong inclination would make them
    grow."""
    H = np.zeros(len(P))
    speed, correlation_time = (
        (s.still_speed, s.still_correlation_time)
        if still.base
        else (s.trunk_speed, s.speed_correlation_time)
    )
    for i in range(3):
        H[ERROR.v_b + i] = 1.0
        scalar_update(P, dx, H, -x[STATE.v_b + i], speed**2 * 2 * correlation_time / dt)
        if not still.target:
            H[ERROR.v_bt + i] = 1.0
            scalar_update(
                P,
                dx,
                H,
                -x[STATE.v_bt + i] - x[STATE.v_b + i],
                s.reach_speed**2 * 2 * s.speed_correlation_time / dt,
            )
        H[ERROR.v_b + i] = H[ERROR.v_bt + i] = 0.0


@inlined
def common_acceleration_update(
    s: NoiseModel, x: Array, P: Array, dx: Array, now: InertialSample, dt: float
) -> None:
    """A common acceleration of trunk and hand observes their relative orientation. (5.17)"""
    f_b, f_t = now.acc_b, now.acc_t
    norm_b = math.sqrt(f_b[0] ** 2 + f_b[1] ** 2 + f_b[2] ** 2)
    norm_t = math.sqrt(f_t[0] ** 2 + f_t[1] ** 2 + f_t[2] ** 2)
    if not (
        abs(norm_b - norm_t) < s.acc_common
        and centripetal_acceleration(x, now) < s.acc_common
        and abs(norm_b - s.gravity) > s.gate * s.gravity
    ):
        return
    R, H = rotation_matrix(x[STATE.q_bt : STATE.q_bt + 4]), np.zeros((3, len(P)))
    common = multiply_transposed(R, f_b - x[STATE.acc_bias_b : STATE.acc_bias_b + 3])
    block(1.0, skew(common), 0, ERROR.th_bt, H)
    block(-1.0, transpose(R), 0, ERROR.acc_bias_b, H)
    variance = (s.acc_moving + norm_b * 0.1) ** 2 * s.acc_correlation_time / dt
    innovation = f_t - x[STATE.acc_bias_t : STATE.acc_bias_t + 3] - common
    accelerometer_update(P, dx, H, ERROR.acc_bias_t, innovation, variance)


@inlined
def centripetal_acceleration(x: Array, now: InertialSample) -> float:
    """By which two positions on one rotating body differ, m/s^2."""
    turning = 0.0
    for i in range(3):
        turning += max(
            (now.gyr_b[i] - x[STATE.gyr_bias_b + i]) ** 2,
            (now.gyr_t[i] - x[STATE.gyr_bias_t + i]) ** 2,
        )
    return turning * math.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)


@inlined
def standstill_update(
    s: NoiseModel, x: Array, P: Array, dx: Array, now: InertialSample, dt: float
) -> None:
    """Trunk and hand both stand still: zero velocity, zero rates. (5.18)"""
    H, lasting = (
        np.zeros(len(P)),
        2 * s.still_correlation_time / dt,
    )  # spectral density of a correlated error
    for i in range(3):
        H[ERROR.v_bt + i] = 1.0
        scalar_update(P, dx, H, -x[STATE.v_bt + i], s.still_speed**2 * lasting)
        H[ERROR.v_bt + i], H[ERROR.gyr_bias_t + i] = 0.0, 1.0
        scalar_update(P, dx, H, now.gyr_t[i] - x[STATE.gyr_bias_t + i], s.still_rate**2 * lasting)
        H[ERROR.gyr_bias_t + i], H[ERROR.gyr_bias_b + i] = 0.0, 1.0
        scalar_update(P, dx, H, now.gyr_b[i] - x[STATE.gyr_bias_b + i], s.still_rate**2 * lasting)
        H[ERROR.gyr_bias_b + i] = 0.0
