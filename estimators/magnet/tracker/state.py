"""State of the magnet tracker, its propagation, and one scalar measurement update; compiled.

State   x (45 + 6 L,) with L magnetometers: p_bt, v_bt, q_bt, B_g, b_tg, b_ta, q_gb, b_bg, b_ba,
        v_b, then declared values that are not exact: the magnet's moment and position on the
        target, gradients of the ambient field (g, T/m, five) and of the calibration (b, one),
        residual of each calibration (b, T), positions of the magnetometers, latency of their
        readings (s); P (43 + 6 L, 43 + 6 L) of the error [dp, dv, dth_bt, dB, db_tg, db_ta, dth_gb,
        db_bg, db_ba, dv_b, dm, dp_tm, dS, dc_1.., dp_b1.., dtau], R = R^ (1 + [dth]x); v_b is the
        trunk's velocity against the ground in its own axes
Source  Kortier, thesis ch. 5, (5.2)-(5.22); the magnetometers' measurement model:
        magnetic_update.py
Leaves  (5.22) propagates p and v as if the trunk did not rotate; here v is the difference of the
        velocities against the ground, in trunk axes: dp/dt = v - w x p, dv/dt = a - w x v, exact
        without angular acceleration (otherwise 1.6 m/s^2 off at 2 rad/s and 0.4 m). His 24 errors
        omit the trunk's velocity and take its accelerometer, moment, positions and calibrations as
        exact: these errors are constant, and white noise in their place makes the filter over- or
        underconfident
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
OWN = 30  # motion errors of trunk and hand; constant errors follow
# moment, its position, gradients, calibrations; positions of the magnetometers follow
MOM, LEV, GRAD, CAL = 30, 33, 36, 42
# rows of the state after p and v
XQ, XB, XTG, XTA, XGB, XBG, XBA, XVB = 6, 10, 13, 16, 19, 23, 26, 29
GRADIENT_TIME = 600.0  # s, correlation time of the ambient gradients of a seated person
XM, XG, XL = 32, 38, 44  # first state rows of MOM, GRAD and CAL


class NoiseModel(NamedTuple):
    """Spectral densities, standard deviations and limits in SI."""

    gyr: float  # rad/s/sqrt(Hz)
    gyr_moving: float  # 1/sqrt(Hz), times the rate
    acc: float  # m/s^2/sqrt(Hz), white
    acc_slow: float  # m/s^2/sqrt(Hz), of correlated errors
    acc_moving_slow: float  # 1/sqrt(Hz), times the acceleration
    mag: float  # T
    mag_residual: float  # T
    gradient: float  # T/m, of the ambient field
    single: float  # T, total error of a single reading
    mag_correlation_angle: float  # rad
    acc_correlation_time: float  # s
    gyr_walk: float  # rad/s/sqrt(s)
    acc_walk: float  # m/s^2/sqrt(s)
    acc_turned: float  # m/s^2/sqrt(rad), scale and axis errors while gravity rotates through them
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
    reach: float  # m, half the workspace's edge
    reach_speed: float  # m/s
    max_gap: float  # s
    nis_limit: float
    mean_rates: float  # 1: a sample is the mean since the one before


@inlined
def inject_error(x: Array, dx: Array) -> Array:
    """The state with an error injected. (5.3)"""
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
    """The state dt later and its Jacobian F (30, 30); readings (12,): gyroscope and accelerometer
    of base, then of target. (5.19)-(5.22)"""
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
    C = rotation_matrix(rotate_by(one, back_b, False))  # old base axes to new ones
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
    """Angular rates of base and target, rad/s."""
    base, target = 0.0, 0.0
    for i in range(3):
        base += (now[i] - x[XBG + i]) ** 2
        target += (now[6 + i] - x[XTG + i]) ** 2
    return math.sqrt(base), math.sqrt(target)


@inlined
def specific_force_square(s: NoiseModel, x: Array, now: Array) -> float:
    """Squared acceleration of base and target, (m/s^2)^2, both together."""
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
    """The covariance dt later, in place. (5.6)

    w_b, w_t: rates of base and target, rad/s; acceleration_square (m/s^2)^2; field_change T: how
    far the field across itself may differ at other positions of the trunk; noise_inflation: factor
    on the noise of sensors that did not answer. Scale and axis errors grow with what a sensor
    reads: noise of constant size would blur the orientation of what does not turn.
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
    )  # calibrations: they decorrelate as the trunk turns
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
    )  # of both accelerometers; half is the base's
    for i in range(OWN):  # one error of the base's gyroscope acts on p, v and both orientations
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
    """One scalar measurement e = H dx + noise: dx and P in place; returns the normalised innovation
    squared. (5.5)"""
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
