"""The state at the instant to which the magnetometers' readings belong, and what it tells of the errors of the newest one; compiled.

Magnetometers and inertial sensors have clocks or filters of their own: readings stamped t may be of t - tau. tau, the lateness, is the state's last row; it is
negative where the magnetometers are early. Between the two instants the body moves as its inertial sensors say: turning with rates that change
evenly, the relative velocity with the relative acceleration.

In      state x and errors as magnet_filter.py has them; the way (22 + L,) with L magnetometers: rates of base and target, change of both rates, specific
        forces, as read; the relative velocity; whether movement tells lateness; how old each reading is by its own time stamp
Source  ours, by the rigid-body motion of magnet_filter.py (5.19)-(5.22); rates and their change: fading memory of degree one (Morrison 1969, Introduction
        to Sequential Smoothing and Prediction, ch. 13). Unsmoothed, the noise of a rate counts as movement that readings would have to show: lateness
        then comes out a third too small. So do the jumps of the filter's velocity: slopes by the lateness take one that is led by accelerations and
        follows slowly, after Huang, Mourikis & Roumeliotis 2010 (Int J Robotics Research 29:502). Where movement does not tell it, it is a parameter
        that is considered (Schmidt 1966, Advances in Control Systems 3:293)
Leaves  a change of the acceleration over tau (0.1 s at 10 m/s^3: 2 mm), and what the biases of a way as short as tau amount to
"""

import math
from typing import NamedTuple

import numpy as np

from handscope.estimators.magnet.tracker.state import P_, TH, THG, V_, XBA, XBG, XGB, XQ, XTA, XTG
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

WAY = 22  # behind it how old each magnetometer's reading is at the newest inertial samples, s
TELLS = 21  # how readings are taken to depend on lateness
LEARNT, CONSIDERED, LEFT_OUT = 1.0, 0.0, -1.0
WB, WT, AB, AT, FB, FT, VS = (3 * k for k in range(7))  # rows of the way
MEMORY = 0.05  # s of the rates
SLOW = 2.0  # s, of the velocity
TURNING, TRAVELLING, SURELY = (
    0.35,
    0.1,
    4.0,
)  # rad/s, m/s, standard deviations: slower movements tell no lateness
UNSURE = 0.1  # m/s, standard deviation of a velocity that nothing is gained by holding on to: followed hands stay below 0.08, lost ones above


@inlined
def went_on(way: Array, now: Array, dt: float) -> None:
    """The way dt later in place, with readings (12,): gyroscope and accelerometer of base, then of target; begun anew where dt is 0."""
    fade = math.exp(-dt / MEMORY) if dt > 0 else 0.0
    for i in range(3):
        way[FB + i], way[FT + i] = now[3 + i], now[9 + i]
        for rate, change, read in ((WB + i, AB + i, now[i]), (WT + i, AT + i, now[6 + i])):
            missed = read - way[rate] - dt * way[change]
            way[rate] = read - fade * fade * missed
            way[change] = way[change] + (1 - fade) ** 2 * missed / dt if dt > 0 else 0.0


@inlined
def turns(x: Array, way: Array) -> tuple[Array, Array]:
    """By what base and target turn over the lateness (3,), (3,), in their own axes."""
    tau = x[-1]
    base, target = np.empty(3), np.empty(3)
    for i in range(3):
        base[i] = tau * (way[WB + i] - x[XBG + i] - 0.5 * tau * way[AB + i])
        target[i] = tau * (way[WT + i] - x[XTG + i] - 0.5 * tau * way[AT + i])
    return base, target


@inlined
def unsure(P: Array) -> float:
    """Variance of the filter's velocity."""
    out: float = P[V_, V_] + P[V_ + 1, V_ + 1] + P[V_ + 2, V_ + 2]
    return out


@inlined
def dependence(way: Array, P: Array, lost: bool) -> float:
    """What readings tell of lateness: nothing of a hand whose place or velocity is not known; nothing more where neither trunk nor hand moves so that a reading
    a hundredth of a second late differs by more than a filter at rest wanders."""
    if lost or unsure(P) > UNSURE**2:
        return LEFT_OUT
    base, target, speed = 0.0, 0.0, 0.0
    for i in range(3):
        base, target, speed = (
            base + way[WB + i] ** 2,
            target + way[WT + i] ** 2,
            speed + way[VS + i] ** 2,
        )
    moves = max(base, target) > TURNING**2 or speed > max(TRAVELLING**2, SURELY**2 * unsure(P))
    return LEARNT if moves else CONSIDERED


@inlined
def considered(way: Array, P: Array, dx: Array, C: Array) -> None:
    """An update dx, C of P in place, which has learnt nothing of lateness where movement does not tell it. What else is known must go on to depend on it: taken for
    certain there, a place that is late by its speed would later tell how late."""
    if way[TELLS] < LEARNT:
        last = len(dx) - 1
        dx[last] = 0.0
        C[last, last] = P[last, last]


@inlined
def settled(way: Array, x: Array, P: Array, v: Array, dt: float) -> None:
    """The way's velocity in place: carried as the filter's was from v (3,) on by accelerations and the base's turning, and slowly drawn to it; the
    filter's own where dt is 0 and while it is not sure of it, so that a hand found again does not drag the velocity of the lost one along."""
    toward = 1.0 - math.exp(-dt / SLOW) if dt > 0 and unsure(P) <= UNSURE**2 else 1.0
    apart, back_b, one = np.empty(3), np.empty(3), np.zeros(4)
    one[0] = 1.0
    for i in range(3):
        apart[i], back_b[i] = way[VS + i] - v[i], -(way[WB + i] - x[XBG + i]) * dt
    apart = multiply_vector(rotation_matrix(rotate_by(one, back_b, False)), apart)
    for i in range(3):
        way[VS + i] = x[3 + i] + (1.0 - toward) * apart[i]


@inlined
def accelerated(x: Array, way: Array) -> Array:
    """The target's acceleration against g less the base's, in the base's axes (3,). (5.19)"""
    out: Array = multiply_vector(
        rotation_matrix(x[XQ : XQ + 4]), way[FT : FT + 3] - x[XTA : XTA + 3]
    )
    for i in range(3):
        out[i] -= way[FB + i] - x[XBA + i]
    return out


@inlined
def earlier(x: Array, way: Array) -> Array:
    """The state tau before: place and both orientations; velocity and the rest stay."""
    base, target = turns(x, way)
    tau, out = x[-1], x.copy()
    one = np.zeros(4)
    one[0] = 1.0
    pulled, p = accelerated(x, way), np.empty(3)
    for i in range(3):
        p[i] = x[i] - tau * x[3 + i] + 0.5 * tau * tau * pulled[i]
    p = multiply_vector(rotation_matrix(rotate_by(one, base, False)), p)
    q_bt, q_gb = (
        rotate_by(rotate_by(x[XQ : XQ + 4], base, True), -target, False),
        rotate_by(x[XGB : XGB + 4], -base, False),
    )
    for i in range(3):
        out[i] = p[i]
    for i in range(4):
        out[XQ + i], out[XGB + i] = q_bt[i], q_gb[i]
    return out


class LedBack(NamedTuple):
    """From the errors of a state to those of the state tau before."""

    tau: float
    C: Array  # (3, 3) the base's axes of now to those of then
    U: Array  # (3, 3) the target's
    far: Array  # (3, 3) acceleration by the target's turning
    place: Array  # (3,) place by lateness
    target: Array  # (3,) target's orientation by lateness
    base: Array  # (3,) base's


@inlined
def dated(x: Array, way: Array, age: float) -> tuple[Array, LedBack]:
    """The state to which a reading belongs that is `age` s old by its time stamp, and the way back to it."""
    late = x.copy()
    late[-1] += age
    then = earlier(late, way)
    return then, led_back(late, then, way)


@inlined
def led_back(x: Array, then: Array, way: Array) -> LedBack:
    base, target = turns(x, way)
    tau, one = x[-1], np.zeros(4)
    one[0] = 1.0
    C, U = (
        rotation_matrix(rotate_by(one, base, False)),
        rotation_matrix(rotate_by(one, target, False)),
    )
    w, u, v, pulled = np.empty(3), np.empty(3), np.empty(3), accelerated(x, way)
    for i in range(3):
        w[i], u[i] = (
            way[WB + i] - x[XBG + i] - tau * way[AB + i],
            way[WT + i] - x[XTG + i] - tau * way[AT + i],
        )
        v[i] = way[VS + i] - tau * pulled[i]
    v, about, carried = (
        multiply_vector(C, v),
        multiply_transposed(rotation_matrix(then[XQ : XQ + 4]), w),
        multiply_vector(skew(w), then[0:3]),
    )
    told = 1.0 if way[TELLS] > LEFT_OUT else 0.0
    for i in range(3):
        v[i], u[i], w[i] = told * (carried[i] - v[i]), told * (about[i] - u[i]), -told * w[i]
    far = multiply_matrices(
        C,
        multiply_matrices(
            rotation_matrix(x[XQ : XQ + 4]), skew(way[FT : FT + 3] - x[XTA : XTA + 3])
        ),
    )
    return LedBack(tau, C, U, far, v, u, w)


@inlined
def by_now(led: LedBack, H: Array) -> None:
    """Slopes H (3, errors) by the errors of the state then, in place made slopes by the errors of now."""
    Hp, Ht, Hg = H[:, P_ : P_ + 3].copy(), H[:, TH : TH + 3].copy(), H[:, THG : THG + 3].copy()
    late = (
        multiply_vector(Hp, led.place)
        + multiply_vector(Ht, led.target)
        + multiply_vector(Hg, led.base)
    )
    HpC, HtU, far = (
        multiply_matrices(Hp, led.C),
        multiply_matrices(Ht, led.U),
        multiply_matrices(Hp, led.far),
    )
    block(1.0, HpC, 0, P_, H)
    block(-led.tau, HpC, 0, V_, H)
    block(1.0, multiply_matrices(Hg, led.C), 0, THG, H)
    for i in range(3):
        H[i, H.shape[1] - 1] = late[i]
        for j in range(3):
            H[i, TH + j] = HtU[i, j] - 0.5 * led.tau**2 * far[i, j]
