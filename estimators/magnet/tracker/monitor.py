"""Innovation monitor of the magnetometers and tests of what their readings determine; compiled.

In      state x and covariance P (state.py)
Out     normalised innovation squared, observability of the magnet's position, reset of a lost one
Source  Kortier, thesis ch. 5, (5.7), Fig. 5.3; limits: ours
"""

import math
from typing import NamedTuple

import numpy as np

from handscope.estimators.magnet.tracker.latency import Kinematics
from handscope.estimators.magnet.tracker.measurement_model import (
    compute_innovations,
    count_axes,
    magnetometers,
)
from handscope.estimators.magnet.tracker.state import ERROR, STATE, NoiseModel
from handscope.estimators.numerics.constants import MU0_4PI
from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.kalman import innovation_gain
from handscope.estimators.numerics.kernels import multiply_matrices, rotation_matrix, skew
from handscope.estimators.numerics.small_matrices import block, spread
from handscope.estimators.numerics.typing import Array

LOST_SD = 0.06  # m: a position of a larger sd is searched for in the whole workspace
NIS_GATE = 5.0  # normalised innovation squared a degree of freedom; readings beyond are left out
MIN_SIGNAL = 1.0  # times the noise of a single reading: least signal of a known position
MIN_SIGNAL_LOST = 3.0  # the same of a lost one
DIPOLE_CURVATURE = 12.0  # second derivative along the axis, over field by squared distance
MAX_SD_SHARE = 0.3  # largest sd that readings may set, over the nearest distance
MAX_SD_SHARE_LOST = 0.15  # the same of a lost position
LOST_NIS = 3.0  # mean NIS at which the position is given up: no chance over half a second
LOST_TURN_SD = 20 * math.pi / 180
INHOMOGENEITY_MEMORY = 600.0  # s over which the field's inhomogeneity is measured


class FieldStatistics(NamedTuple):
    """Of the two components of the ambient field that readings and gravity determine."""

    time: float = 0.0  # s of measurement
    mean_y: float = 0.0  # T
    mean_z: float = 0.0  # T
    square_y: float = 0.0  # T^2, mean squared deviation
    square_z: float = 0.0  # T^2


class InnovationMonitor(NamedTuple):
    """How the readings of the magnetometers have fitted so far."""

    mean_nis: float = 1.0
    lost_time: float = 0.0  # s since it is too large
    silent_time: float = 0.0  # s without a usable reading
    search_delay: float = 0.0  # s until a hand out of reach is searched again
    field: FieldStatistics = FieldStatistics()


@inlined
def with_field(monitor: InnovationMonitor, field: FieldStatistics) -> InnovationMonitor:
    """The same with other statistics of the field."""
    m = monitor
    return InnovationMonitor(m.mean_nis, m.lost_time, m.silent_time, m.search_delay, field)


@inlined
def with_silence(monitor: InnovationMonitor, dt: float, search_delay: float) -> InnovationMonitor:
    """The same after dt without a usable reading."""
    m = monitor
    return InnovationMonitor(m.mean_nis, m.lost_time, m.silent_time + dt, search_delay, m.field)


@inlined
def is_lost(P: Array) -> bool:
    """Whether the position is so uncertain that it is searched in the whole workspace."""
    return bool(
        P[ERROR.p_bt, ERROR.p_bt]
        + P[ERROR.p_bt + 1, ERROR.p_bt + 1]
        + P[ERROR.p_bt + 2, ERROR.p_bt + 2]
        > LOST_SD**2
    )


@inlined
def reset_position(s: NoiseModel, x: Array, P: Array, centre: Array, turn: float) -> None:
    """Forget position and velocity; make the hand's orientation less certain."""
    for i in range(6):
        for j in range(len(P)):
            P[i, j] = P[j, i] = 0.0
    for i in range(3):
        P[ERROR.p_bt + i, ERROR.p_bt + i], P[ERROR.v_bt + i, ERROR.v_bt + i] = (
            s.reach**2 / 3,
            s.reach_speed**2,
        )
        P[ERROR.th_bt + i, ERROR.th_bt + i] += turn**2
        x[STATE.p_bt + i], x[STATE.v_bt + i] = centre[i], 0.0


@inlined
def compute_nis(s: NoiseModel, x: Array, P: Array, kinematics: Kinematics, mag: Array) -> float:
    """Normalised innovation squared a degree of freedom of the axes that answered, at least one."""
    rows = 3 * len(mag)
    H, innovation, noise = np.zeros((rows, len(P))), np.zeros(rows), np.zeros((rows, rows))
    compute_innovations(
        s, x, kinematics, mag, 1.0 + linearisation_variance(x, P) / s.mag**2, H, innovation, noise
    )
    out: float = innovation_gain(
        P, innovation, H, noise, np.empty((rows, len(P))), np.empty(len(P))
    ) / count_axes(mag)
    return out


@inlined
def linearisation_variance(x: Array, P: Array) -> float:
    """Variance, T^2, of the field's second-order term at an uncertain position."""
    away = nearest_distance(x)
    by_place: float = (
        DIPOLE_CURVATURE
        * field_strength(x, away)
        / away**2
        * (
            P[ERROR.p_bt, ERROR.p_bt]
            + P[ERROR.p_bt + 1, ERROR.p_bt + 1]
            + P[ERROR.p_bt + 2, ERROR.p_bt + 2]
        )
        / 3
    )
    return by_place**2 / 2  # (e^2 - E e^2) / 2 has half the square of e's variance


@inlined
def error_correlation_samples(P: Array, dt: float) -> float:
    """Number of readings, dt s apart, over which a position error is constant: its size over its
    rate. The second-order term counts so many times, else readings would seem to carry information
    that none has."""
    place, speed = 0.0, 0.0
    for i in range(3):
        place, speed = (
            place + P[ERROR.p_bt + i, ERROR.p_bt + i],
            speed + P[ERROR.v_bt + i, ERROR.v_bt + i],
        )
    return max(1.0, math.sqrt(place / speed) / dt)


@inlined
def is_observable(s: NoiseModel, x: Array, P: Array, lost: bool) -> bool:
    """Whether readings determine the magnet's position: sd below a share of its distance, as the
    dipole is not linear beyond, and field above a multiple of the noise, which does not average
    out. More is asked of a lost one."""
    audible = MIN_SIGNAL_LOST if lost else MIN_SIGNAL
    straight = MAX_SD_SHARE_LOST if lost else MAX_SD_SHARE
    nearest, J, known = nearest_distance(x), np.zeros((3, ERROR.lever + 3)), np.empty((3, 3))
    loud, R = field_strength(x, nearest), rotation_matrix(x[STATE.q_bt : STATE.q_bt + 4])
    for i in range(3):
        J[i, ERROR.p_bt + i] = 1.0
    block(1.0, R, 0, ERROR.lever, J)
    block(-1.0, multiply_matrices(R, skew(x[STATE.lever : STATE.lever + 3])), 0, ERROR.th_bt, J)
    spread(J, P, known)
    return bool(
        known[0, 0] + known[1, 1] + known[2, 2] < (straight * nearest) ** 2
        and loud**2 > audible**2 * s.single**2
    )


@inlined
def nearest_distance(x: Array) -> float:
    """From the hand's sensor to the nearest magnetometer, m."""
    nearest, many = math.inf, magnetometers(x)
    for k in range(many):
        first, square = STATE.residuals + 3 * (many + k), 0.0
        for i in range(3):
            square += (x[i] - x[first + i]) ** 2
        nearest = min(nearest, square)
    return math.sqrt(nearest)


@inlined
def field_strength(x: Array, away: float) -> float:
    """Field beside the magnet, T; twice that on its axis. (5.7)"""
    return (
        MU0_4PI
        * math.sqrt(x[STATE.moment] ** 2 + x[STATE.moment + 1] ** 2 + x[STATE.moment + 2] ** 2)
        / max(away, 0.01) ** 3
    )


@inlined
def field_inhomogeneity(
    field: FieldStatistics, x: Array, dt: float
) -> tuple[FieldStatistics, float]:
    """Statistics with the field of state x, and the standard deviation of the field between
    positions, T."""
    time = min(field.time + dt, INHOMOGENEITY_MEMORY)
    mean_y, square_y = moving_moments(field.mean_y, field.square_y, x[STATE.B_g + 1], dt / time)
    mean_z, square_z = moving_moments(field.mean_z, field.square_z, x[STATE.B_g + 2], dt / time)
    sd = math.sqrt(0.5 * square_y + 0.5 * square_z)
    return FieldStatistics(time, mean_y, mean_z, square_y, square_z), sd


@inlined
def moving_moments(mean: float, square: float, value: float, share: float) -> tuple[float, float]:
    """Mean and mean squared deviation with a new value that counts for a share."""
    off = value - mean
    return mean + share * off, square + share * ((1.0 - share) * off * off - square)
