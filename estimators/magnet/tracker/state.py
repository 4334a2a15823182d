"""The arithmetic of magnet_tracking.py for one sample after the other, compiled: state and errors, time update, one scalar measurement.

State   x (45 + 6 L,) with L magnetometers: p_bt, v_bt, q_bt, B_g, b_tg, b_ta, q_gb, b_bg, b_ba, v_b, then what was told before and is not exact: the
        magnet's moment and place on the target, the slopes of the room's field (g, T/m, five) and of one that calibrations took it for (b), what each
        calibration left besides (b, T), the magnetometers' places, how late their readings are (s);
        P (43 + 6 L, 43 + 6 L) of the error [dp, dv, dth_bt, dB, db_tg, db_ta, dth_gb, db_bg, db_ba, dv_b, dm, dp_tm, dS, dc_1.., dp_b1.., dtau],
        R = R^ (1 + [dth]x); v_b is the trunk's velocity against the ground in its own axes
Source  Kortier, thesis ch. 5, (5.2)-(5.22); what magnetometers tell: magnet_reading.py
Leaves  (5.22) moves p and v of the trunk's frame as if the trunk did not turn; ours v is the difference of the velocities against the ground, in the
        trunk's axes: dp/dt = v - w x p, dv/dt = a - w x v, exact without angular acceleration (w = 2 rad/s at 0.4 m: 1.6 m/s^2 otherwise amiss).
        His 24 errors leave the trunk's velocity out and take its accelerometer, moment, places and calibrations for exact: an error of theirs lasts, and
        white noise in its place makes the filter either too sure or too careful
"""

import math
from typing import NamedTuple

import numpy as np

from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.kernels import (
    multiply_matrices,
    multiply_transposed,
    multiply_vector,
    rotate_by,
    rotation_matrix,
    skew,
    transpose,
)
from handscope.estimators.numerics.small_matrices import block, product, put, spread
from handscope.estimators.numerics.typing import Array

P_, V_, TH, B_, BTG, BTA, THG, BBG, BBA, VB = (3 * k for k in range(10))  # rows of the error
OWN = 30  # errors of trunk and hand; behind them what does not move
MOM, LEV, GRAD, CAL = (
    30,
    33,
    36,
    42,
)  # moment, its place, slopes, calibrations; the magnetometers' places follow
XQ, XB, XTG, XTA, XGB, XBG, XBA, XVB = (
    6,
    10,
    13,
    16,
    19,
    23,
    26,
    29,
)  # rows of the state behind p and v
GRADIENT_TIME = 600.0  # s for which the slopes of the room's field stay alike: who sits hardly leaves their place
XM, XG, XL = 32, 38, 44  # where the state's rows of MOM, of SLO and of LEFT begin


class NoiseModel(NamedTuple):
    """Spectral densities and standard deviations in SI, as the loop needs them."""

    gyr: float  # rad/s/sqrt(Hz)
    gyr_moving: float  # 1/sqrt(Hz), times the rate
    acc: float  # m/s^2/sqrt(Hz), white
    acc_slow: float  # m/s^2/sqrt(Hz), what errors that stay alike amount to
    acc_moving_slow: float  # 1/sqrt(Hz), times the acceleration
    mag: float  # T
    mag_residual: float  # T
    gradient: float  # T/m, of the room's field
    single: float  # T, by which a single reading is off, all in it
    mag_correlation_angle: float  # rad
    acc_correlation_time: float  # s
    gyr_walk: float  # rad/s/sqrt(s)
    acc_walk: float  # m/s^2/sqrt(s)
    acc_turned: (
        float  # m/s^2/sqrt(rad), what scales and axes make of gravity as it turns through them
    )
    field_walk: float  # T/sqrt(s)
    field_across: float  # T
    gravity: float
    gate: float  # share of g
    acc_still: float  # m/s^2
    acc_moving: float  # m/s^2
    acc_common: float  # m/s^2
    trunk_speed: float  # m/s
    speed_correlation_time: float  # s
    still_acc: float  # m/s^2
    still_speed: float  # m/s
    still_rate: float  # rad/s
    still_correlation_time: float  # s
    reach: float  # m, half the volume's edge
    reach_speed: float  # m/s
    max_gap: float  # s
    nis_limit: float
    mean_rates: float  # 1: a reading is the mean since the one before


@inlined
def inject_error(x: Array, dx: Array) -> Array:
    """The state with an error put in. (5.3)"""
    out = x.copy()
    for i in range(OWN, len(dx)):
        out[XM + i - OWN] += dx[i]
    for i in range(3):
        out[i] += dx[P_ + i]
        out[3 + i] += dx[V_ + i]
        out[XB + i] += dx[B_ + i]
        out[XTG + i] += dx[BTG + i]
        out[XTA + i] += dx[BTA + i]
        out[XBG + i] += dx[BBG + i]
        out[XBA + i] += dx[BBA + i]
        out[XVB + i] += dx[VB + i]
    q_bt, q_gb = (
        rotate_by(x[XQ : XQ + 4], dx[TH : TH + 3], False),
        rotate_by(x[XGB : XGB + 4], dx[THG : THG + 3], False),
    )
    for i in range(4):
        out[XQ + i], out[XGB + i] = q_bt[i], q_gb[i]
    return out


@inlined
def propagate_state(
    s: NoiseModel, x: Array, before: Array, now: Array, dt: float, F: Array
) -> Array:
    """The state dt later and its derivative F (30, 30); readings (12,): gyroscope and accelerometer of base, then of target. (5.19)-(5.22)"""
    w_b, w_t, back_b, back_t = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    f_b0, f_t0, f_b1, f_t1 = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        mean_b = now[i] if s.mean_rates > 0.5 else 0.5 * (before[i] + now[i])
        mean_t = now[6 + i] if s.mean_rates > 0.5 else 0.5 * (before[6 + i] + now[6 + i])
        w_b[i], w_t[i] = (mean_b - x[XBG + i]) * dt, (mean_t - x[XTG + i]) * dt
        back_b[i], back_t[i] = -w_b[i], -w_t[i]
        f_b0[i], f_b1[i] = before[3 + i] - x[XBA + i], now[3 + i] - x[XBA + i]
        f_t0[i], f_t1[i] = before[9 + i] - x[XTA + i], now[9 + i] - x[XTA + i]
    one = np.zeros(4)
    one[0] = 1.0
    C = rotation_matrix(rotate_by(one, back_b, False))  # old axes of the base to new ones
    R0 = rotation_matrix(x[XQ : XQ + 4])
    out = x.copy()
    q_bt, q_gb = (
        rotate_by(rotate_by(x[XQ : XQ + 4], back_b, True), w_t, False),
        rotate_by(x[XGB : XGB + 4], w_b, False),
    )
    R1 = rotation_matrix(q_bt)
    a0, a1 = multiply_vector(R0, f_t0), multiply_vector(R1, f_t1)
    up = np.zeros(3)
    up[2] = s.gravity
    g0: Array = multiply_transposed(rotation_matrix(x[XGB : XGB + 4]), up)
    g1: Array = multiply_transposed(rotation_matrix(q_gb), up)
    v, p, u = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        u[i] = x[XVB + i] + 0.5 * dt * (f_b0[i] - g0[i])
        a0[i], a1[i] = a0[i] - f_b0[i], a1[i] - f_b1[i]  # (5.19): gravity is in both
        v[i] = x[3 + i] + 0.5 * dt * a0[i]
        p[i] = x[i] + dt * x[3 + i] + dt * dt / 3 * a0[i]
    v, p, u = multiply_vector(C, v), multiply_vector(C, p), multiply_vector(C, u)
    for i in range(3):
        out[XVB + i] = u[i] + 0.5 * dt * (f_b1[i] - g1[i])
        out[3 + i], out[i] = v[i] + 0.5 * dt * a1[i], p[i] + dt * dt / 6 * a1[i]
    for i in range(4):
        out[XQ + i], out[XGB + i] = q_bt[i], q_gb[i]
    for i in range(OWN):
        for j in range(OWN):
            F[i, j] = 1.0 if i == j else 0.0
    block(1.0, C, P_, P_, F)
    block(1.0, C, V_, V_, F)
    block(dt, C, P_, V_, F)
    R, f = multiply_matrices(C, R0), np.empty(3)
    for i in range(3):
        f[i] = 0.5 * (f_t0[i] + f_t1[i])
    push = multiply_matrices(R, skew(f))
    block(-dt, push, V_, TH, F)
    block(-0.5 * dt * dt, push, P_, TH, F)
    block(-dt, R, V_, BTA, F)
    block(-0.5 * dt * dt, R, P_, BTA, F)
    block(dt, C, V_, BBA, F)
    block(0.5 * dt * dt, C, P_, BBA, F)
    block(-dt, skew(out[0:3]), P_, BBG, F)
    block(-dt, skew(out[3:6]), V_, BBG, F)
    block(1.0, C, VB, VB, F)
    block(-dt, multiply_matrices(C, skew(g0)), VB, THG, F)
    block(-dt, C, VB, BBA, F)
    block(-dt, skew(out[XVB : XVB + 3]), VB, BBG, F)
    block(1.0, rotation_matrix(rotate_by(one, back_t, False)), TH, TH, F)
    block(1.0, C, THG, THG, F)
    for i in range(3):
        F[TH + i, BTG + i] = F[THG + i, BBG + i] = -dt
    block(dt, transpose(R1), TH, BBG, F)
    return out


@inlined
def turn_rates(x: Array, now: Array) -> tuple[float, float]:
    """How fast base and target turn, rad/s."""
    base, target = 0.0, 0.0
    for i in range(3):
        base += (now[i] - x[XBG + i]) ** 2
        target += (now[6 + i] - x[XTG + i]) ** 2
    return math.sqrt(base), math.sqrt(target)


@inlined
def specific_force_square(s: NoiseModel, x: Array, now: Array) -> float:
    """How much base and target are accelerated, (m/s^2)^2, both together."""
    R = rotation_matrix(x[XQ : XQ + 4])
    up, out = np.zeros(3), 0.0
    up[2] = s.gravity
    g_b: Array = multiply_transposed(rotation_matrix(x[XGB : XGB + 4]), up)
    g_t: Array = multiply_transposed(R, g_b)
    for i in range(3):
        out += (now[3 + i] - x[XBA + i] - g_b[i]) ** 2 + (now[9 + i] - x[XTA + i] - g_t[i]) ** 2
    return out


@inlined
def propagate_covariance(
    s: NoiseModel,
    P: Array,
    F: Array,
    dt: float,
    w_b: float,
    w_t: float,
    acceleration_square: float,
    field_change: float,
    noise_inflation: float,
) -> None:
    """The covariance dt later, base and target turning by w_b and w_t (rad/s) and accelerated by `push` (m/s^2)^2, in place; `spread_field` T is what the
    field across itself may be at other places of the trunk; `rough` multiplies the noise of sensors that did not answer.

    (5.6). What scales and axes of a sensor are off by grows with what it reads: as noise of one size it would blur the turning of what does not turn.
    """
    carried, across = np.empty((OWN, OWN)), np.empty((OWN, len(P) - OWN))
    spread(F, P, carried)
    product(F, P[:OWN, OWN:], across)
    mag_share, gradient_share = (
        math.exp(-w_b * dt / s.mag_correlation_angle),
        math.exp(-dt / GRADIENT_TIME),
    )
    first, last = (
        CAL - OWN,
        CAL - OWN + (len(P) - CAL - 1) // 2,
    )  # of the calibrations: they change as the trunk turns
    for j in range(len(P) - OWN):
        share = (
            mag_share
            if first <= j < last
            else gradient_share
            if GRAD <= OWN + j < GRAD + 5
            else 1.0
        )
        for i in range(OWN):
            P[i, OWN + j] = P[OWN + j, i] = share * across[i, j]
        if share < 1.0:
            for k in range(OWN, len(P)):
                P[OWN + j, k] *= share
                P[k, OWN + j] *= share
            P[OWN + j, OWN + j] += (1.0 - share * share) * (
                s.mag_residual if first <= j < last else s.gradient
            ) ** 2
    put(carried, P[:OWN, :OWN])
    gyr_b, gyr_t = (
        noise_inflation * (s.gyr**2 + (s.gyr_moving * w_b) ** 2),
        noise_inflation * (s.gyr**2 + (s.gyr_moving * w_t) ** 2),
    )
    acc = (
        2 * (noise_inflation * s.acc * s.acc + s.acc_slow * s.acc_slow)
        + s.acc_moving_slow**2 * acceleration_square
    )  # of both accelerometers: half is the base's
    for i in range(OWN):  # the base's gyroscope moves p, v and both orientations by the same error
        for j in range(OWN):
            for k in range(3):
                a = F[i, BBG + k] if not BBG <= i < VB else 0.0
                b = F[j, BBG + k] if not BBG <= j < VB else 0.0
                P[i, j] += a * b * gyr_b / dt
    for i in range(3):
        P[TH + i, TH + i] += gyr_t * dt
        P[V_ + i, V_ + i] += acc * dt
        P[P_ + i, P_ + i] += acc * dt**3 / 3
        P[P_ + i, V_ + i] += acc * dt**2 / 2
        P[V_ + i, P_ + i] += acc * dt**2 / 2
        P[VB + i, VB + i] += acc * dt / 2
        P[VB + i, V_ + i] -= acc * dt / 2
        P[V_ + i, VB + i] -= acc * dt / 2
        P[VB + i, P_ + i] -= acc * dt**2 / 4
        P[P_ + i, VB + i] -= acc * dt**2 / 4
        P[B_ + i, B_ + i] += (
            s.field_walk**2 * dt if i > 0 else (1.0 - F[B_, B_] ** 2) * field_change**2
        )
        P[BTG + i, BTG + i] += s.gyr_walk**2 * dt
        P[BBG + i, BBG + i] += s.gyr_walk**2 * dt
        P[BTA + i, BTA + i] += (s.acc_walk**2 + s.acc_turned**2 * w_t) * dt
        P[BBA + i, BBA + i] += (s.acc_walk**2 + s.acc_turned**2 * w_b) * dt


@inlined
def scalar_update(P: Array, dx: Array, H: Array, e: float, variance: float) -> float:
    """One scalar measurement e = H dx + noise: dx and P in place; gives the normalised innovation squared. (5.5)"""
    size = len(dx)
    PH = np.zeros(size)
    for j in range(size):
        if H[j] != 0.0:
            for i in range(size):
                PH[i] += P[i, j] * H[j]
    S, residual = variance, e
    for i in range(size):
        S += H[i] * PH[i]
        residual -= H[i] * dx[i]
    for i in range(size):
        K = PH[i] / S
        dx[i] += K * residual
        for j in range(size):
            P[i, j] -= K * PH[j]
    return residual * residual / S
