"""Measurement updates from inertial readings and the standstill test; compiled.

In      state x, covariance P and errors dx (state.py); readings (12,): gyroscope and accelerometer
        of base, then of target
Out     dx and P in place
Source  Kortier, thesis ch. 5, (5.16)-(5.18)
Leaves  (5.16) takes any specific force of the size of g for gravity, with a new error at each
        sample; the acceleration of a swaying body returns with the sway and is not white. Ours:
        (5.16) only at standstill (Skog et al. 2010); a seated trunk and its hand have bounded
        speeds, so that accelerations average out. (5.18) only where trunk and hand both stand
        still: one alone does not determine the difference of two velocities
"""

import math

import numpy as np

from handscope.estimators.magnet.tracker.state import (
    BBA,
    BBG,
    BTA,
    BTG,
    TH,
    THG,
    V_,
    VB,
    XBA,
    XBG,
    XGB,
    XQ,
    XTA,
    XTG,
    XVB,
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
from handscope.estimators.numerics.small_matrices import block, clear
from handscope.estimators.numerics.typing import Array

MOVING_SD = 4.0  # standard deviations of the velocity from which on a hand does not stand still


@inlined
def inertial_update(
    s: NoiseModel,
    x: Array,
    P: Array,
    now: Array,
    still_b: bool,
    still_t: bool,
    lost: bool,
    dt: float,
) -> Array:
    """All updates from inertial readings, in place; returns the state. For a lost hand nothing
    distinguishes a slow slide from rest."""
    dx = np.zeros(len(P))
    faster = (
        0.0  # a hand that slides without turning passes for still: not where its velocity is known
    )
    for i in range(3):
        faster += x[3 + i] ** 2 / (P[V_ + i, V_ + i] + s.still_speed**2)
    still_t = still_t and not (still_b and faster > MOVING_SD**2)
    gravity_update(s, x, P, dx, now, still_b, still_t, lost, dt)
    speed_update(s, x, P, dx, still_b, still_t and not lost, dt)
    common_acceleration_update(s, x, P, dx, now, dt)
    if still_b and still_t and not lost:
        standstill_update(s, x, P, dx, now, dt)
    out: Array = inject_error(x, dx)
    return out


@inlined
def gravity_update(
    s: NoiseModel,
    x: Array,
    P: Array,
    dx: Array,
    now: Array,
    still_b: bool,
    still_t: bool,
    lost: bool,
    dt: float,
) -> None:
    """The accelerometer of a sensor at standstill reads gravity; of a lost hand to within the limit
    of the standstill test. (5.16)"""
    R, up, H = rotation_matrix(x[XQ : XQ + 4]), np.zeros(3), np.zeros((3, len(P)))
    up[2] = s.gravity
    variance = s.acc_still**2 * s.acc_correlation_time / dt
    g_b: Array = multiply_transposed(rotation_matrix(x[XGB : XGB + 4]), up)
    g_t: Array = multiply_transposed(R, g_b)
    S = skew(g_b)
    if still_b:
        block(1.0, S, 0, THG, H)
        for i in range(3):
            H[i, BBA + i] = 1.0
        for i in range(3):
            scalar_update(P, dx, H[i], now[3 + i] - x[XBA + i] - g_b[i], variance)
    if still_t:
        if lost:
            variance = s.still_acc**2 * 2 * s.still_correlation_time / dt
        clear(H)
        block(1.0, skew(g_t), 0, TH, H)
        block(1.0, multiply_matrices(transpose(R), S), 0, THG, H)
        for i in range(3):
            H[i, BTA + i] = 1.0
        for i in range(3):
            scalar_update(P, dx, H[i], now[9 + i] - x[XTA + i] - g_t[i], variance)


@inlined
def speed_update(
    s: NoiseModel, x: Array, P: Array, dx: Array, still_b: bool, still_t: bool, dt: float
) -> None:
    """The speeds of a seated trunk and its hand are bounded; a wrong inclination would make them
    grow."""
    H = np.zeros(len(P))
    speed, correlation_time = (
        (s.still_speed, s.still_correlation_time)
        if still_b
        else (s.trunk_speed, s.speed_correlation_time)
    )
    for i in range(3):
        H[VB + i] = 1.0
        scalar_update(P, dx, H, -x[XVB + i], speed**2 * 2 * correlation_time / dt)
        if not still_t:
            H[V_ + i] = 1.0
            scalar_update(
                P,
                dx,
                H,
                -x[3 + i] - x[XVB + i],
                s.reach_speed**2 * 2 * s.speed_correlation_time / dt,
            )
        H[VB + i] = H[V_ + i] = 0.0


@inlined
def common_acceleration_update(
    s: NoiseModel, x: Array, P: Array, dx: Array, now: Array, dt: float
) -> None:
    """A common acceleration of trunk and hand observes their relative orientation. (5.17)"""
    f_b, f_t, turning = now[3:6], now[9:12], 0.0
    norm_b = math.sqrt(f_b[0] ** 2 + f_b[1] ** 2 + f_b[2] ** 2)
    norm_t = math.sqrt(f_t[0] ** 2 + f_t[1] ** 2 + f_t[2] ** 2)
    for i in range(3):
        turning += max((now[i] - x[XBG + i]) ** 2, (now[6 + i] - x[XTG + i]) ** 2)
    centripetal = turning * math.sqrt(
        x[0] ** 2 + x[1] ** 2 + x[2] ** 2
    )  # two positions on one rotating body differ by it
    if (
        abs(norm_b - norm_t) < s.acc_common
        and centripetal < s.acc_common
        and abs(norm_b - s.gravity) > s.gate * s.gravity
    ):
        R, H = rotation_matrix(x[XQ : XQ + 4]), np.zeros((3, len(P)))
        common = multiply_transposed(R, f_b - x[XBA : XBA + 3])
        block(1.0, skew(common), 0, TH, H)
        block(-1.0, transpose(R), 0, BBA, H)
        for i in range(3):
            H[i, BTA + i] = 1.0
        for i in range(3):
            scalar_update(
                P,
                dx,
                H[i],
                f_t[i] - x[XTA + i] - common[i],
                (s.acc_moving + norm_b * 0.1) ** 2 * s.acc_correlation_time / dt,
            )


@inlined
def standstill_update(s: NoiseModel, x: Array, P: Array, dx: Array, now: Array, dt: float) -> None:
    """Trunk and hand both stand still: zero velocity, zero rates. (5.18)"""
    H, lasting = (
        np.zeros(len(P)),
        2 * s.still_correlation_time / dt,
    )  # spectral density of a correlated error
    for i in range(3):
        H[V_ + i] = 1.0
        scalar_update(P, dx, H, -x[3 + i], s.still_speed**2 * lasting)
        H[V_ + i], H[BTG + i] = 0.0, 1.0
        scalar_update(P, dx, H, now[6 + i] - x[XTG + i], s.still_rate**2 * lasting)
        H[BTG + i], H[BBG + i] = 0.0, 1.0
        scalar_update(P, dx, H, now[i] - x[XBG + i], s.still_rate**2 * lasting)
        H[BBG + i] = 0.0
