"""The state at the instant of a magnetometer reading, and its Jacobian by the errors of the newest
state; compiled.

Magnetometers and inertial sensors have clocks or filters of their own: a reading stamped t may
belong to t - tau. tau, the latency, is the state's last row; it is negative where the magnetometers
are early. Between the two instants the body moves as its inertial sensors measured: rates change
linearly, the relative velocity changes with the relative acceleration.

In      state x and errors (state.py); Kinematics, with the age of each magnetometer's reading by
        its own time stamp
Source  ours, by the rigid-body motion (5.19)-(5.22). Rates and derivatives: fading memory of degree
        one (Morrison 1969, Introduction to Sequential Smoothing and Prediction, ch. 13); the noise
        of unsmoothed rates would count as movement and bias the latency by a third. Velocity in
        Jacobians: led by accelerations and slowly drawn to the filter's, as its jumps would bias
        the latency too (after Huang, Mourikis & Roumeliotis 2010, Int J Robotics Research 29:502).
        Without movement the latency is a considered parameter (Schmidt 1966, Advances in Control
        Systems 3:293)
Leaves  changes of the acceleration within tau (0.1 s at 10 m/s^3: 2 mm); sensor biases over tau
"""

import math
from typing import NamedTuple

import numpy as np

from handscope.estimators.magnet.tracker.state import ERROR, LATENCY, STATE, InertialSample
from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.kernels import (
    multiply_matrices,
    multiply_transposed,
    multiply_vector,
    rotate_by,
    rotation_matrix,
    skew,
)
from handscope.estimators.numerics.small_matrices import block
from handscope.estimators.numerics.typing import Array

ESTIMATED, CONSIDERED, IGNORED = 1.0, 0.0, -1.0  # how readings depend on latency
MEMORY = 0.05  # s, of rates
VELOCITY_MEMORY = 2.0  # s, of the velocity
# rad/s, m/s, standard deviations: slower movements do not observe latency
MOVING_RATE, MOVING_SPEED, MOVING_SD = 0.35, 0.1, 4.0
MAX_VELOCITY_SD = 0.1  # m/s, sd of the velocity: tracked hands stay below 0.08, lost ones above


class MotionRows(NamedTuple):
    """Rows of Kinematics.motion."""

    w_b: int = 0  # rad/s, rate of the base, as read
    w_t: int = 1  # rad/s, of the target
    alpha_b: int = 2  # rad/s^2, change of the base's rate
    alpha_t: int = 3  # rad/s^2
    f_b: int = 4  # m/s^2, specific force, as read
    f_t: int = 5  # m/s^2
    v_bt: int = 6  # m/s


MOTION = MotionRows()


class Kinematics(NamedTuple):
    """What the inertial sensors measured, by which a state is led to the instant of a reading.
    Arrays are updated in place. They are few: with a field for each row the filter took some 5 %
    longer, as numba counts references to every array at every call."""

    motion: Array  # (7, 3) rows as in MotionRows
    age: Array  # (L,) s of each magnetometer's reading at the newest inertial sample
    latency_mode: float  # ESTIMATED, CONSIDERED or IGNORED


def start_kinematics(magnetometers: int) -> Kinematics:
    """Before the first sample."""
    return Kinematics(np.zeros((len(MOTION), 3)), np.zeros(magnetometers), CONSIDERED)


def copy_kinematics(kinematics: Kinematics) -> Kinematics:
    """For a kernel that updates it."""
    return Kinematics(kinematics.motion.copy(), kinematics.age.copy(), kinematics.latency_mode)


@inlined
def with_latency_mode(kinematics: Kinematics, mode: float) -> Kinematics:
    """The same arrays with another mode."""
    return Kinematics(kinematics.motion, kinematics.age, mode)


@inlined
def predict_kinematics(kinematics: Kinematics, now: InertialSample, dt: float) -> None:
    """Advance kinematics by dt in place; restart where dt is 0."""
    motion = kinematics.motion
    track_rate(motion[MOTION.w_b], motion[MOTION.alpha_b], now.gyr_b, dt)
    track_rate(motion[MOTION.w_t], motion[MOTION.alpha_t], now.gyr_t, dt)
    for i in range(3):
        motion[MOTION.f_b, i], motion[MOTION.f_t, i] = now.acc_b[i], now.acc_t[i]


@inlined
def track_rate(rate: Array, change: Array, gyr: Array, dt: float) -> None:
    """Fading memory of a rate and its change, in place."""
    fade = math.exp(-dt / MEMORY) if dt > 0 else 0.0
    for i in range(3):
        innovation = gyr[i] - rate[i] - dt * change[i]
        rate[i] = gyr[i] - fade * fade * innovation
        change[i] = change[i] + (1 - fade) ** 2 * innovation / dt if dt > 0 else 0.0


@inlined
def rotation_over_latency(x: Array, motion: Array) -> tuple[Array, Array]:
    """Rotations of base and target over the latency (3,), (3,), each in its own axes."""
    tau = x[LATENCY]
    base, target = np.empty(3), np.empty(3)
    for i in range(3):
        base[i] = tau * (
            motion[MOTION.w_b, i] - x[STATE.gyr_bias_b + i] - 0.5 * tau * motion[MOTION.alpha_b, i]
        )
        target[i] = tau * (
            motion[MOTION.w_t, i] - x[STATE.gyr_bias_t + i] - 0.5 * tau * motion[MOTION.alpha_t, i]
        )
    return base, target


@inlined
def velocity_variance(P: Array) -> float:
    """Variance of the filter's velocity."""
    out: float = (
        P[ERROR.v_bt, ERROR.v_bt]
        + P[ERROR.v_bt + 1, ERROR.v_bt + 1]
        + P[ERROR.v_bt + 2, ERROR.v_bt + 2]
    )
    return out


@inlined
def latency_mode(motion: Array, P: Array, lost: bool) -> float:
    """How readings inform latency: IGNORED for a hand of unknown position or velocity; CONSIDERED
    where neither trunk nor hand moves enough for 10 ms to exceed the wander of a filter at rest;
    else ESTIMATED."""
    if lost or velocity_variance(P) > MAX_VELOCITY_SD**2:
        return IGNORED
    base, target, speed = 0.0, 0.0, 0.0
    for i in range(3):
        base, target, speed = (
            base + motion[MOTION.w_b, i] ** 2,
            target + motion[MOTION.w_t, i] ** 2,
            speed + motion[MOTION.v_bt, i] ** 2,
        )
    moves = max(base, target) > MOVING_RATE**2 or speed > max(
        MOVING_SPEED**2, MOVING_SD**2 * velocity_variance(P)
    )
    return ESTIMATED if moves else CONSIDERED


@inlined
def schmidt_update(kinematics: Kinematics, P: Array, dx: Array, C: Array) -> None:
    """Correct an update dx, C of P in place that must not estimate latency. Correlations with it
    remain: if latency were taken as exact here, a position error of latency times speed would later
    bias it."""
    if kinematics.latency_mode < ESTIMATED:
        last = len(dx) - 1
        dx[last] = 0.0
        C[last, last] = P[last, last]


@inlined
def smooth_velocity(kinematics: Kinematics, x: Array, P: Array, v: Array, dt: float) -> None:
    """Update the velocity in kinematics: carry it from the filter's previous velocity v (3,) by
    accelerations and the base's rotation, and draw it slowly to the filter's; reset where dt is 0
    or the filter is uncertain, so that a relocated hand does not inherit the velocity of a lost
    one."""
    motion = kinematics.motion
    toward = (
        1.0 - math.exp(-dt / VELOCITY_MEMORY)
        if dt > 0 and velocity_variance(P) <= MAX_VELOCITY_SD**2
        else 1.0
    )
    deviation, back_b, one = np.empty(3), np.empty(3), np.zeros(4)
    one[0] = 1.0
    for i in range(3):
        deviation[i], back_b[i] = (
            motion[MOTION.v_bt, i] - v[i],
            -(motion[MOTION.w_b, i] - x[STATE.gyr_bias_b + i]) * dt,
        )
    deviation = multiply_vector(rotation_matrix(rotate_by(one, back_b, False)), deviation)
    for i in range(3):
        motion[MOTION.v_bt, i] = x[STATE.v_bt + i] + (1.0 - toward) * deviation[i]


@inlined
def relative_acceleration(x: Array, motion: Array) -> Array:
    """Acceleration of the target less the base's, base axes (3,). (5.19)"""
    out: Array = multiply_vector(
        rotation_matrix(x[STATE.q_bt : STATE.q_bt + 4]),
        motion[MOTION.f_t] - x[STATE.acc_bias_t : STATE.acc_bias_t + 3],
    )
    for i in range(3):
        out[i] -= motion[MOTION.f_b, i] - x[STATE.acc_bias_b + i]
    return out


@inlined
def state_delayed(x: Array, motion: Array) -> Array:
    """The state tau earlier: position and both orientations; velocity and the rest are unchanged."""
    base, target = rotation_over_latency(x, motion)
    tau, out = x[LATENCY], x.copy()
    one = np.zeros(4)
    one[0] = 1.0
    pulled, p = relative_acceleration(x, motion), np.empty(3)
    for i in range(3):
        p[i] = x[i] - tau * x[STATE.v_bt + i] + 0.5 * tau * tau * pulled[i]
    p = multiply_vector(rotation_matrix(rotate_by(one, base, False)), p)
    q_bt, q_gb = (
        rotate_by(rotate_by(x[STATE.q_bt : STATE.q_bt + 4], base, True), -target, False),
        rotate_by(x[STATE.q_gb : STATE.q_gb + 4], -base, False),
    )
    for i in range(3):
        out[i] = p[i]
    for i in range(4):
        out[STATE.q_bt + i], out[STATE.q_gb + i] = q_bt[i], q_gb[i]
    return out


class DelayJacobian(NamedTuple):
    """From the errors of a state to those of the state tau earlier."""

    tau: float
    C: Array  # (3, 3) base axes now to base axes then
    U: Array  # (3, 3) the same of the target
    far: Array  # (3, 3) acceleration by target orientation
    place: Array  # (3,) position by latency
    target: Array  # (3,) target orientation by latency
    base: Array  # (3,) base orientation by latency


@inlined
def state_at_reading(x: Array, kinematics: Kinematics, age: float) -> tuple[Array, DelayJacobian]:
    """The state to which a reading belongs that is `age` s old by its time stamp, and its
    Jacobian."""
    late = x.copy()
    late[LATENCY] += age
    then = state_delayed(late, kinematics.motion)
    return then, delay_jacobian(late, then, kinematics.motion, kinematics.latency_mode)


@inlined
def delay_jacobian(x: Array, then: Array, motion: Array, mode: float) -> DelayJacobian:
    """Jacobian of the state at the reading by the errors of the newest state."""
    base, target = rotation_over_latency(x, motion)
    one = np.zeros(4)
    one[0] = 1.0
    C, U = (
        rotation_matrix(rotate_by(one, base, False)),
        rotation_matrix(rotate_by(one, target, False)),
    )
    far = multiply_matrices(
        C,
        multiply_matrices(
            rotation_matrix(x[STATE.q_bt : STATE.q_bt + 4]),
            skew(motion[MOTION.f_t] - x[STATE.acc_bias_t : STATE.acc_bias_t + 3]),
        ),
    )
    place, turn_t, turn_b = derivatives_by_latency(x, then, motion, C)
    active = 1.0 if mode > IGNORED else 0.0
    for i in range(3):
        place[i], turn_t[i], turn_b[i] = active * place[i], active * turn_t[i], active * turn_b[i]
    return DelayJacobian(x[LATENCY], C, U, far, place, turn_t, turn_b)


@inlined
def derivatives_by_latency(
    x: Array, then: Array, motion: Array, C: Array
) -> tuple[Array, Array, Array]:
    """Of position and of the orientations of target and base, (3,) each. C (3, 3): base axes now to base axes then."""
    tau, pulled = x[LATENCY], relative_acceleration(x, motion)
    w, u, v = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        w[i], u[i] = (
            motion[MOTION.w_b, i] - x[STATE.gyr_bias_b + i] - tau * motion[MOTION.alpha_b, i],
            motion[MOTION.w_t, i] - x[STATE.gyr_bias_t + i] - tau * motion[MOTION.alpha_t, i],
        )
        v[i] = motion[MOTION.v_bt, i] - tau * pulled[i]
    v, about, carried = (
        multiply_vector(C, v),
        multiply_transposed(rotation_matrix(then[STATE.q_bt : STATE.q_bt + 4]), w),
        multiply_vector(skew(w), then[0:3]),
    )
    for i in range(3):
        v[i], u[i], w[i] = carried[i] - v[i], about[i] - u[i], -w[i]
    return v, u, w


@inlined
def map_jacobian_to_now(delay: DelayJacobian, H: Array) -> None:
    """Turn a Jacobian H (3, errors) by the errors of the delayed state into one by the errors of
    now, in place."""
    Hp, Ht, Hg = (
        H[:, ERROR.p_bt : ERROR.p_bt + 3].copy(),
        H[:, ERROR.th_bt : ERROR.th_bt + 3].copy(),
        H[:, ERROR.th_gb : ERROR.th_gb + 3].copy(),
    )
    late = (
        multiply_vector(Hp, delay.place)
        + multiply_vector(Ht, delay.target)
        + multiply_vector(Hg, delay.base)
    )
    HpC, HtU, far = (
        multiply_matrices(Hp, delay.C),
        multiply_matrices(Ht, delay.U),
        multiply_matrices(Hp, delay.far),
    )
    block(1.0, HpC, 0, ERROR.p_bt, H)
    block(-delay.tau, HpC, 0, ERROR.v_bt, H)
    block(1.0, multiply_matrices(Hg, delay.C), 0, ERROR.th_gb, H)
    for i in range(3):
        H[i, H.shape[1] - 1] = late[i]
        for j in range(3):
            H[i, ERROR.th_bt + j] = HtU[i, j] - 0.5 * delay.tau**2 * far[i, j]
