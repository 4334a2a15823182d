"""State of the magnet tracker, its propagation, and one scalar measurement update; compiled.

State   x (45 + 6 L,) with L magnetometers, rows as in StateLayout; P (43 + 6 L, 43 + 6 L), rows as
        in ErrorState. Declared values that are not exact follow the motion: magnet, gradients of the
        ambient field, calibrations, positions of the magnetometers, latency of their readings
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


class ErrorState(NamedTuple):
    """First rows of the parts of the error state: three rows each, where nothing else is said. Turns
    are on the right: R = R^ (1 + [dth]x)."""

    p_bt: int = 0  # m
    v_bt: int = 3  # m/s
    th_bt: int = 6  # rad, of q_bt
    B_g: int = 9  # T
    gyr_bias_t: int = 12  # rad/s
    acc_bias_t: int = 15  # m/s^2
    th_gb: int = 18  # rad, of q_gb
    gyr_bias_b: int = 21  # rad/s
    acc_bias_b: int = 24  # m/s^2
    v_b: int = 27  # m/s
    moment: int = 30  # A m^2; from here on errors of values that are constant
    lever: int = 33  # m
    gradients: int = 36  # T/m, five of the ambient field and one of the calibration
    residuals: int = 42  # T, 3 L; then m, 3 L, positions of magnetometers; s, one, latency


class StateLayout(NamedTuple):
    """First rows of the parts of the state: as the error state's, but for two unit quaternions."""

    p_bt: int = 0  # m, of the hand's sensor, base axes
    v_bt: int = 3  # m/s, difference of the velocities against the ground, base axes
    q_bt: int = 6  # (4,)
    B_g: int = 10  # T, ambient field
    gyr_bias_t: int = 13  # rad/s
    acc_bias_t: int = 16  # m/s^2
    q_gb: int = 19  # (4,)
    gyr_bias_b: int = 23  # rad/s
    acc_bias_b: int = 26  # m/s^2
    v_b: int = 29  # m/s, of the trunk against the ground, base axes
    moment: int = 32  # A m^2, target axes
    lever: int = 35  # m, from the hand's sensor to the magnet, target axes
    gradients: int = 38  # T/m, (6,)
    residuals: int = 44  # T, (3 L,) of the calibrations; then positions m, (3 L,), and latency


ERROR, STATE = ErrorState(), StateLayout()
OWN = ERROR.moment  # motion errors of trunk and hand
LATENCY = -1  # row of the state, s; the error's, too

GRADIENT_TIME = 600.0  # s, correlation time of the ambient gradients of a seated person


def rows(first: int, count: int = 3) -> slice:
    """Rows of a part that begins there."""
    return slice(first, first + count)


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
        out[STATE.moment + i - OWN] += dx[i]
    for i in range(3):
        out[i] += dx[ERROR.p_bt + i]
        out[STATE.v_bt + i] += dx[ERROR.v_bt + i]
        out[STATE.B_g + i] += dx[ERROR.B_g + i]
        out[STATE.gyr_bias_t + i] += dx[ERROR.gyr_bias_t + i]
        out[STATE.acc_bias_t + i] += dx[ERROR.acc_bias_t + i]
        out[STATE.gyr_bias_b + i] += dx[ERROR.gyr_bias_b + i]
        out[STATE.acc_bias_b + i] += dx[ERROR.acc_bias_b + i]
        out[STATE.v_b + i] += dx[ERROR.v_b + i]
    q_bt, q_gb = (
        rotate_by(x[STATE.q_bt : STATE.q_bt + 4], dx[ERROR.th_bt : ERROR.th_bt + 3], False),
        rotate_by(x[STATE.q_gb : STATE.q_gb + 4], dx[ERROR.th_gb : ERROR.th_gb + 3], False),
    )
    for i in range(4):
        out[STATE.q_bt + i], out[STATE.q_gb + i] = q_bt[i], q_gb[i]
    return out


class InertialSample(NamedTuple):
    """Readings of trunk (base b) and hand (target t), each in its own axes."""

    gyr_b: Array  # (3,) rad/s
    acc_b: Array  # (3,) m/s^2
    gyr_t: Array  # (3,) rad/s
    acc_t: Array  # (3,) m/s^2


class InertialInterval(NamedTuple):
    """Readings at both ends of a step."""

    before: InertialSample
    now: InertialSample
    dt: float  # s
    noise_inflation: float  # factor on the noise where a sensor did not answer


class Increments(NamedTuple):
    """What the sensors measured over a step, without their biases."""

    turn_b: Array  # (3,) rad
    turn_t: Array  # (3,) rad
    back_b: Array  # (3,) rad, the opposite turns
    back_t: Array  # (3,) rad
    f_b0: Array  # (3,) m/s^2, specific force before
    f_b1: Array  # (3,) m/s^2, after
    f_t0: Array  # (3,) m/s^2
    f_t1: Array  # (3,) m/s^2


class StepRotations(NamedTuple):
    """Orientations before and after a step."""

    C: Array  # (3, 3) base axes before to base axes after
    U: Array  # (3, 3) the same of the target
    R0: Array  # (3, 3) target to base, before
    R1: Array  # (3, 3) the same, after
    g0: Array  # (3,) m/s^2, what the base's accelerometer reads of gravity, before
    g1: Array  # (3,) m/s^2, the same, after


class Movement(NamedTuple):
    """What the process noise of a step depends on."""

    w_b: float  # rad/s, rate of the base
    w_t: float  # rad/s, rate of the target
    acceleration_square: float  # (m/s^2)^2, of both together
    field_change: float  # T, by which the field across itself may differ at other positions
    noise_inflation: float  # factor on the noise where a sensor did not answer


@inlined
def inertial_sample(row: Array) -> InertialSample:
    """Views of a row (12,) of samples."""
    return InertialSample(row[0:3], row[3:6], row[6:9], row[9:12])


@inlined
def propagate_state(s: NoiseModel, x: Array, interval: InertialInterval, F: Array) -> Array:
    """The state after an interval and its Jacobian F (30, 30). (5.19)-(5.22)"""
    step, out = remove_biases(s, x, interval), x.copy()
    q_bt, q_gb = (
        rotate_by(rotate_by(x[STATE.q_bt : STATE.q_bt + 4], step.back_b, True), step.turn_t, False),
        rotate_by(x[STATE.q_gb : STATE.q_gb + 4], step.turn_b, False),
    )
    for i in range(4):
        out[STATE.q_bt + i], out[STATE.q_gb + i] = q_bt[i], q_gb[i]
    rotations = rotations_over(s, x, out, step)
    integrate_accelerations(x, step, rotations, interval.dt, out)
    for i in range(OWN):
        for j in range(OWN):
            F[i, j] = 1.0 if i == j else 0.0
    fill_translation_rows(out, step, rotations, interval.dt, F)
    fill_rotation_rows(rotations, interval.dt, F)
    return out


@inlined
def remove_biases(s: NoiseModel, x: Array, interval: InertialInterval) -> Increments:
    """Turns over an interval and specific forces at both its ends."""
    before, now, dt = interval.before, interval.now, interval.dt
    w_b, w_t, back_b, back_t = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    f_b0, f_t0, f_b1, f_t1 = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        mean_b = now.gyr_b[i] if s.mean_rates > 0.5 else 0.5 * (before.gyr_b[i] + now.gyr_b[i])
        mean_t = now.gyr_t[i] if s.mean_rates > 0.5 else 0.5 * (before.gyr_t[i] + now.gyr_t[i])
        w_b[i], w_t[i] = (
            (mean_b - x[STATE.gyr_bias_b + i]) * dt,
            (mean_t - x[STATE.gyr_bias_t + i]) * dt,
        )
        back_b[i], back_t[i] = -w_b[i], -w_t[i]
        f_b0[i], f_b1[i] = (
            before.acc_b[i] - x[STATE.acc_bias_b + i],
            now.acc_b[i] - x[STATE.acc_bias_b + i],
        )
        f_t0[i], f_t1[i] = (
            before.acc_t[i] - x[STATE.acc_bias_t + i],
            now.acc_t[i] - x[STATE.acc_bias_t + i],
        )
    return Increments(w_b, w_t, back_b, back_t, f_b0, f_b1, f_t0, f_t1)


@inlined
def rotations_over(s: NoiseModel, x: Array, after: Array, step: Increments) -> StepRotations:
    """Of a step from state x to a state whose orientations are those after it."""
    one, up = np.zeros(4), np.zeros(3)
    one[0], up[2] = 1.0, s.gravity
    return StepRotations(
        rotation_matrix(rotate_by(one, step.back_b, False)),
        rotation_matrix(rotate_by(one, step.back_t, False)),
        rotation_matrix(x[STATE.q_bt : STATE.q_bt + 4]),
        rotation_matrix(after[STATE.q_bt : STATE.q_bt + 4]),
        multiply_transposed(rotation_matrix(x[STATE.q_gb : STATE.q_gb + 4]), up),
        multiply_transposed(rotation_matrix(after[STATE.q_gb : STATE.q_gb + 4]), up),
    )


@inlined
def integrate_accelerations(
    x: Array, step: Increments, rotations: StepRotations, dt: float, out: Array
) -> None:
    """Fill position and both velocities of the state after a step, by accelerations that change
    linearly. (5.19), (5.22)"""
    a0, a1 = multiply_vector(rotations.R0, step.f_t0), multiply_vector(rotations.R1, step.f_t1)
    v, p, u = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        u[i] = x[STATE.v_b + i] + 0.5 * dt * (step.f_b0[i] - rotations.g0[i])
        a0[i], a1[i] = a0[i] - step.f_b0[i], a1[i] - step.f_b1[i]  # (5.19): gravity is in both
        v[i] = x[STATE.v_bt + i] + 0.5 * dt * a0[i]
        p[i] = x[i] + dt * x[STATE.v_bt + i] + dt * dt / 3 * a0[i]
    v, p, u = (
        multiply_vector(rotations.C, v),
        multiply_vector(rotations.C, p),
        multiply_vector(rotations.C, u),
    )
    for i in range(3):
        out[STATE.v_b + i] = u[i] + 0.5 * dt * (step.f_b1[i] - rotations.g1[i])
        out[STATE.v_bt + i], out[i] = v[i] + 0.5 * dt * a1[i], p[i] + dt * dt / 6 * a1[i]


@inlined
def fill_translation_rows(
    out: Array, step: Increments, rotations: StepRotations, dt: float, F: Array
) -> None:
    """Fill the rows of position and velocities of the Jacobian F; `out` is the state after."""
    C, R, f = rotations.C, multiply_matrices(rotations.C, rotations.R0), np.empty(3)
    block(1.0, C, ERROR.p_bt, ERROR.p_bt, F)
    block(1.0, C, ERROR.v_bt, ERROR.v_bt, F)
    block(dt, C, ERROR.p_bt, ERROR.v_bt, F)
    for i in range(3):
        f[i] = 0.5 * (step.f_t0[i] + step.f_t1[i])
    push = multiply_matrices(R, skew(f))
    block(-dt, push, ERROR.v_bt, ERROR.th_bt, F)
    block(-0.5 * dt * dt, push, ERROR.p_bt, ERROR.th_bt, F)
    block(-dt, R, ERROR.v_bt, ERROR.acc_bias_t, F)
    block(-0.5 * dt * dt, R, ERROR.p_bt, ERROR.acc_bias_t, F)
    block(dt, C, ERROR.v_bt, ERROR.acc_bias_b, F)
    block(0.5 * dt * dt, C, ERROR.p_bt, ERROR.acc_bias_b, F)
    block(-dt, skew(out[0:3]), ERROR.p_bt, ERROR.gyr_bias_b, F)
    block(-dt, skew(out[STATE.v_bt : STATE.v_bt + 3]), ERROR.v_bt, ERROR.gyr_bias_b, F)
    block(1.0, C, ERROR.v_b, ERROR.v_b, F)
    block(-dt, multiply_matrices(C, skew(rotations.g0)), ERROR.v_b, ERROR.th_gb, F)
    block(-dt, C, ERROR.v_b, ERROR.acc_bias_b, F)
    block(-dt, skew(out[STATE.v_b : STATE.v_b + 3]), ERROR.v_b, ERROR.gyr_bias_b, F)


@inlined
def fill_rotation_rows(rotations: StepRotations, dt: float, F: Array) -> None:
    """Fill the rows of both orientations of the Jacobian F."""
    block(1.0, rotations.U, ERROR.th_bt, ERROR.th_bt, F)
    block(1.0, rotations.C, ERROR.th_gb, ERROR.th_gb, F)
    for i in range(3):
        F[ERROR.th_bt + i, ERROR.gyr_bias_t + i] = F[ERROR.th_gb + i, ERROR.gyr_bias_b + i] = -dt
    block(dt, transpose(rotations.R1), ERROR.th_bt, ERROR.gyr_bias_b, F)


@inlined
def turn_rates(x: Array, now: InertialSample) -> tuple[float, float]:
    """Angular rates of base and target, rad/s."""
    base, target = 0.0, 0.0
    for i in range(3):
        base += (now.gyr_b[i] - x[STATE.gyr_bias_b + i]) ** 2
        target += (now.gyr_t[i] - x[STATE.gyr_bias_t + i]) ** 2
    return math.sqrt(base), math.sqrt(target)


@inlined
def specific_force_square(s: NoiseModel, x: Array, now: InertialSample) -> float:
    """Squared acceleration of base and target, (m/s^2)^2, both together."""
    R = rotation_matrix(x[STATE.q_bt : STATE.q_bt + 4])
    up, out = np.zeros(3), 0.0
    up[2] = s.gravity
    g_b: Array = multiply_transposed(rotation_matrix(x[STATE.q_gb : STATE.q_gb + 4]), up)
    g_t: Array = multiply_transposed(R, g_b)
    for i in range(3):
        base = now.acc_b[i] - x[STATE.acc_bias_b + i] - g_b[i]
        target = now.acc_t[i] - x[STATE.acc_bias_t + i] - g_t[i]
        out += base**2 + target**2
    return out


@inlined
def propagate_covariance(s: NoiseModel, P: Array, F: Array, dt: float, movement: Movement) -> None:
    """The covariance dt later, in place. (5.6)

    Scale and axis errors grow with what a sensor reads: noise of constant size would blur the
    orientation of what does not turn.
    """
    carried = np.empty((OWN, OWN))
    spread(F, P, carried)
    propagate_constant_errors(s, P, F, dt, movement.w_b)
    put(carried, P[:OWN, :OWN])
    add_gyroscope_noise(s, P, F, dt, movement)
    add_acceleration_noise(s, P, dt, movement)
    add_random_walks(s, P, F, dt, movement)


@inlined
def propagate_constant_errors(s: NoiseModel, P: Array, F: Array, dt: float, w_b: float) -> None:
    """Covariances of the constant errors, with those of the motion errors, in place: calibrations
    decorrelate as the trunk turns, gradients with time."""
    across = np.empty((OWN, len(P) - OWN))
    product(F, P[:OWN, OWN:], across)
    mag_share, gradient_share = (
        math.exp(-w_b * dt / s.mag_correlation_angle),
        math.exp(-dt / GRADIENT_TIME),
    )
    first, last = (
        ERROR.residuals - OWN,
        ERROR.residuals - OWN + (len(P) - ERROR.residuals - 1) // 2,
    )  # calibrations
    for j in range(len(P) - OWN):
        share = (
            mag_share
            if first <= j < last
            else gradient_share
            if ERROR.gradients <= OWN + j < ERROR.gradients + 5
            else 1.0
        )
        for i in range(OWN):
            P[i, OWN + j] = P[OWN + j, i] = share * across[i, j]
        if share < 1.0:
            sd = s.mag_residual if first <= j < last else s.gradient
            for k in range(OWN, len(P)):
                P[OWN + j, k] *= share
                P[k, OWN + j] *= share
            P[OWN + j, OWN + j] += (1.0 - share * share) * sd**2


@inlined
def add_gyroscope_noise(s: NoiseModel, P: Array, F: Array, dt: float, movement: Movement) -> None:
    """One error of the base's gyroscope acts on p, v and both orientations."""
    gyr_b, gyr_t = (
        movement.noise_inflation * (s.gyr**2 + (s.gyr_moving * movement.w_b) ** 2),
        movement.noise_inflation * (s.gyr**2 + (s.gyr_moving * movement.w_t) ** 2),
    )
    for i in range(OWN):
        for j in range(OWN):
            for k in range(3):
                a = F[i, ERROR.gyr_bias_b + k] if not ERROR.gyr_bias_b <= i < ERROR.v_b else 0.0
                b = F[j, ERROR.gyr_bias_b + k] if not ERROR.gyr_bias_b <= j < ERROR.v_b else 0.0
                P[i, j] += a * b * gyr_b / dt
    for i in range(3):
        P[ERROR.th_bt + i, ERROR.th_bt + i] += gyr_t * dt


@inlined
def add_acceleration_noise(s: NoiseModel, P: Array, dt: float, movement: Movement) -> None:
    """Of both accelerometers on the relative velocity; half of it is the base's."""
    acc = (
        2 * (movement.noise_inflation * s.acc * s.acc + s.acc_slow * s.acc_slow)
        + s.acc_moving_slow**2 * movement.acceleration_square
    )
    for i in range(3):
        P[ERROR.v_bt + i, ERROR.v_bt + i] += acc * dt
        P[ERROR.p_bt + i, ERROR.p_bt + i] += acc * dt**3 / 3
        P[ERROR.p_bt + i, ERROR.v_bt + i] += acc * dt**2 / 2
        P[ERROR.v_bt + i, ERROR.p_bt + i] += acc * dt**2 / 2
        P[ERROR.v_b + i, ERROR.v_b + i] += acc * dt / 2
        P[ERROR.v_b + i, ERROR.v_bt + i] -= acc * dt / 2
        P[ERROR.v_bt + i, ERROR.v_b + i] -= acc * dt / 2
        P[ERROR.v_b + i, ERROR.p_bt + i] -= acc * dt**2 / 4
        P[ERROR.p_bt + i, ERROR.v_b + i] -= acc * dt**2 / 4


@inlined
def add_random_walks(s: NoiseModel, P: Array, F: Array, dt: float, movement: Movement) -> None:
    """Of the ambient field and the biases; across itself the field changes as the trunk turns."""
    for i in range(3):
        P[ERROR.B_g + i, ERROR.B_g + i] += (
            s.field_walk**2 * dt
            if i > 0
            else (1.0 - F[ERROR.B_g, ERROR.B_g] ** 2) * movement.field_change**2
        )
        P[ERROR.gyr_bias_t + i, ERROR.gyr_bias_t + i] += s.gyr_walk**2 * dt
        P[ERROR.gyr_bias_b + i, ERROR.gyr_bias_b + i] += s.gyr_walk**2 * dt
        P[ERROR.acc_bias_t + i, ERROR.acc_bias_t + i] += (
            s.acc_walk**2 + s.acc_turned**2 * movement.w_t
        ) * dt
        P[ERROR.acc_bias_b + i, ERROR.acc_bias_b + i] += (
            s.acc_walk**2 + s.acc_turned**2 * movement.w_b
        ) * dt


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
