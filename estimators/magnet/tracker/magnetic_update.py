"""Measurement model of the magnetometers, iterated updates, and the search for a lost magnet;
compiled.

In      state x and covariance P (state.py); readings (magnetometers, 3) in the base's axes
Out     predicted readings and Jacobians; errors, covariance, normalised innovation squared
Source  Kortier, thesis ch. 5, (5.7)-(5.15). The update is iterated (Bell & Cathey 1993, IEEE Trans
        Autom Control 38:294): the dipole is far from linear where the position is uncertain
Leaves  the Jacobian of a known position is taken three quarters of the way to the solution
        (docs/methods.md says why)
"""

import math
from typing import NamedTuple

import numpy as np

from handscope.estimators.magnet.tracker.latency import (
    KINEMATICS_SIZE,
    map_jacobian_to_now,
    state_at_reading,
)
from handscope.estimators.magnet.tracker.state import (
    B_,
    GRAD,
    LEV,
    MOM,
    OWN,
    P_,
    TH,
    THG,
    XB,
    XG,
    XGB,
    XL,
    XM,
    XQ,
    NoiseModel,
    inject_error,
)
from handscope.estimators.numerics.constants import MU0_4PI
from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.kalman import downdate_covariance, innovation_gain
from handscope.estimators.numerics.kernels import (
    multiply_matrices,
    multiply_transposed,
    multiply_vector,
    rotation_matrix,
    skew,
    transpose,
)
from handscope.estimators.numerics.small_matrices import block, clear, product
from handscope.estimators.numerics.typing import Array

TWO, SIX = math.sqrt(1 / 2), math.sqrt(1 / 6)  # five gradients of equal size
ITERATIONS = 12
SHARE = 0.75  # of the way to the solution, where the Jacobian is taken
NEAR = 0.002  # m: a smaller step is converged
GRID = 10  # grid points along each axis of the workspace
EVIDENCE = 12.0  # by which a candidate must lower the cost against the filter's own position


@inlined
def magnetometers(x: Array) -> int:
    """Number of magnetometers in a state."""
    return (len(x) - XL - 1) // 6


class CommonTerms(NamedTuple):
    """Terms of the measurement model that all magnetometers share, base axes."""

    R: Array  # (3, 3) target to base
    R_gb: Array  # (3, 3)
    moment: Array  # (3,)
    arm: Array  # (3,) from the target's sensor to the magnet
    B_b: Array  # (3,) ambient field at the base's sensor
    S_b: Array  # (3, 3) its gradient
    by_lever: Array  # (3, 3) of the arm by the target's orientation
    by_moment: Array  # (3, 3) of the moment


@inlined
def common_terms(x: Array) -> CommonTerms:
    R, R_gb, S = (
        rotation_matrix(x[XQ : XQ + 4]),
        rotation_matrix(x[XGB : XGB + 4]),
        np.empty((3, 3)),
    )
    moment, lever = x[XM : XM + 3], x[XM + 3 : XM + 6]
    S[0, 1], S[0, 2], S[1, 2] = (
        TWO * x[XG],
        TWO * x[XG + 1],
        TWO * x[XG + 2],
    )  # xy, xz, yz, then xx - yy, xx + yy - 2 zz
    S[0, 0], S[1, 1], S[2, 2] = (
        TWO * x[XG + 3] + SIX * x[XG + 4],
        SIX * x[XG + 4] - TWO * x[XG + 3],
        -2 * SIX * x[XG + 4],
    )
    S[1, 0], S[2, 0], S[2, 1] = S[0, 1], S[0, 2], S[1, 2]
    S_b = multiply_matrices(transpose(R_gb), multiply_matrices(S, R_gb))
    B_b = multiply_transposed(R_gb, x[XB : XB + 3])
    return CommonTerms(
        R,
        R_gb,
        multiply_vector(R, moment),
        multiply_vector(R, lever),
        B_b,
        S_b,
        multiply_matrices(R, skew(lever)),
        multiply_matrices(R, skew(moment)),
    )


@inlined
def predict_reading(x: Array, at: CommonTerms, k: int, H: Array) -> Array:
    """Predicted reading of magnetometer k, base axes (3,); fills its Jacobian H (3, errors).
    (5.7)-(5.15), (5.24)"""
    residual, place, m = XL + 3 * k, XL + 3 * (magnetometers(x) + k), at.moment
    r = np.empty(3)
    for i in range(3):
        r[i] = x[i] + at.arm[i] - x[place + i]
    square = max(
        r[0] * r[0] + r[1] * r[1] + r[2] * r[2], 1e-4
    )  # nearer than a centimetre is inside the housing
    along = r[0] * m[0] + r[1] * m[1] + r[2] * m[2]
    k5 = MU0_4PI / square**2.5
    J, D = np.empty((3, 3)), np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            J[i, j] = 3 * k5 * r[i] * r[j]
            D[i, j] = 3 * k5 * (r[i] * m[j] + m[i] * r[j] - 5 * along * r[i] * r[j] / square)
        J[i, i] -= k5 * square
        D[i, i] += 3 * k5 * along
    clear(H)
    block(1.0, D, 0, P_, H)
    slopes, room = room_field(x, at, x[place : place + 3], H)
    by_lever, by_moment = multiply_matrices(D, at.by_lever), multiply_matrices(J, at.by_moment)
    reads: Array = multiply_vector(J, m)
    for i in range(3):
        H[i, OWN + residual - XM + i] = 1.0
        for j in range(3):
            H[i, OWN + place - XM + j] = slopes[i, j] - D[i, j]
            H[i, TH + j] = -by_lever[i, j] - by_moment[i, j]
            H[i, B_ + j] = at.R_gb[j, i]
        reads[i] += room[i] + x[residual + i]
    block(1.0, multiply_matrices(J, at.R), 0, MOM, H)
    block(1.0, multiply_matrices(D, at.R), 0, LEV, H)
    return reads


@inlined
def room_field(x: Array, at: CommonTerms, place: Array, H: Array) -> tuple[Array, Array]:
    """Gradient (3, 3) and value (3,) of the ambient field at a magnetometer, base axes; fills its
    Jacobian by trunk orientation and gradients. A field without curl and divergence has five;
    calibrations add one."""
    p, steep, steep_b = multiply_vector(at.R_gb, place), np.zeros((3, 6)), np.zeros((3, 6))
    steep[0, 0], steep[1, 0], steep[0, 1], steep[2, 1] = (
        TWO * p[1],
        TWO * p[0],
        TWO * p[2],
        TWO * p[0],
    )
    steep[1, 2], steep[2, 2], steep[0, 3], steep[1, 3] = (
        TWO * p[2],
        TWO * p[1],
        TWO * p[0],
        -TWO * p[1],
    )
    steep[0, 4], steep[1, 4], steep[2, 4] = SIX * p[0], SIX * p[1], -2 * SIX * p[2]
    for i in range(3):
        steep[i, 5] = p[i]
    product(transpose(at.R_gb), steep, steep_b)
    block(1.0, steep_b, 0, GRAD, H)
    field_change, carried, field, slopes = (
        multiply_vector(at.S_b, place),
        multiply_matrices(at.S_b, skew(place)),
        np.empty(3),
        at.S_b.copy(),
    )
    turning, about = skew(at.B_b), skew(field_change)
    for i in range(3):
        field[i] = at.B_b[i] + field_change[i] + x[XG + 5] * place[i]
        for j in range(3):
            H[i, THG + j] = turning[i, j] + about[i, j] - carried[i, j]
        slopes[i, i] += x[XG + 5]
    return slopes, field


@inlined
def predict_delayed_reading(x: Array, kinematics: Array, k: int, H: Array) -> Array:
    """Predicted reading (3,) of magnetometer k at the instant of its sample; fills the Jacobian H
    (3, errors) by the errors of now."""
    then, since = state_at_reading(x, kinematics, kinematics[KINEMATICS_SIZE + k])
    reads: Array = predict_reading(then, common_terms(then), k, H)
    map_jacobian_to_now(since, H)
    return reads


@inlined
def count_axes(mag: Array) -> int:
    """Number of axes that answered."""
    count = 0
    for k in range(len(mag)):
        count += 3 * (not math.isnan(mag[k, 0] + mag[k, 1] + mag[k, 2]))
    return count


@inlined
def compute_innovations(
    s: NoiseModel,
    x: Array,
    kinematics: Array,
    mag: Array,
    variance_scale: float,
    H: Array,
    innovation: Array,
    noise: Array,
) -> None:
    """Fill innovations (m,), Jacobian (m, errors) with zeros where a magnetometer did not answer,
    and noise (m, m) of variance_scale times the magnetometers' variance."""
    age = kinematics[KINEMATICS_SIZE]
    then, since = state_at_reading(x, kinematics, age)
    at = common_terms(then)
    for k in range(len(mag)):
        rows = H[3 * k : 3 * k + 3]
        for i in range(3):
            noise[3 * k + i, 3 * k + i], innovation[3 * k + i] = variance_scale * s.mag**2, 0.0
        if math.isnan(mag[k, 0] + mag[k, 1] + mag[k, 2]):
            clear(rows)
            continue
        if kinematics[KINEMATICS_SIZE + k] != age:
            age = kinematics[KINEMATICS_SIZE + k]
            then, since = state_at_reading(x, kinematics, age)
            at = common_terms(then)
        reads = predict_reading(then, at, k, rows)
        map_jacobian_to_now(since, rows)
        for i in range(3):
            innovation[3 * k + i] = mag[k, i] - reads[i]


@inlined
def damped_step(dx: Array, new: Array, last: bool) -> float:
    """Move dx towards the new error in place; returns the distance of its position, m. Long steps
    are shortened, as the linearisation does not hold over them."""
    change = math.sqrt((new[0] - dx[0]) ** 2 + (new[1] - dx[1]) ** 2 + (new[2] - dx[2]) ** 2)
    share = 0.1 / change if not last and change > 0.1 else 1.0
    for i in range(len(dx)):
        dx[i] += share * (new[i] - dx[i])
    return change


@inlined
def iterated_update(
    s: NoiseModel, x: Array, P: Array, kinematics: Array, mag: Array, variance_scale: float
) -> tuple[Array, Array, float]:
    """Update of a known position: error, covariance, normalised innovation squared (3 degrees of
    freedom a reading).

    A Jacobian at the prior biases a position away from the array, one at the solution towards it:
    by 2 SHARE - 3/2 of what the readings' curvature makes of the filter's variance, where half of
    that variance is their own noise, as for a hand at rest (a moving filter adds its own).
    """
    size, rows = len(P), 3 * len(mag)
    dx, C, cost, new = np.zeros(size), P.copy(), 0.0, np.empty(size)
    H, W, innovation, noise, unused = (
        np.zeros((rows, size)),
        np.empty((rows, size)),
        np.zeros(rows),
        np.zeros((rows, rows)),
        np.zeros(rows),
    )
    compute_innovations(s, x, kinematics, mag, variance_scale, H, innovation, noise)
    for iteration in range(ITERATIONS):
        compute_innovations(
            s, inject_error(x, SHARE * dx), kinematics, mag, variance_scale, H, unused, noise
        )
        cost = innovation_gain(P, innovation, H, noise, W, new)
        if damped_step(dx, new, iteration == ITERATIONS - 1) < NEAR:
            break
    downdate_covariance(C, W)
    return dx, C, cost


@inlined
def global_update(
    s: NoiseModel,
    x: Array,
    P: Array,
    kinematics: Array,
    start: Array,
    mag: Array,
    variance_scale: float,
) -> tuple[Array, Array, float]:
    """Update of a lost position, from x corrected by `start`; returns as iterated_update. The
    Jacobian is taken at the solution."""
    W, C = np.empty((3 * len(mag), len(P))), P.copy()
    dx, cost = gauss_newton_from(s, x, P, kinematics, start, mag, variance_scale, W)
    downdate_covariance(C, W)
    return dx, C, cost


@inlined
def gauss_newton_from(
    s: NoiseModel,
    x: Array,
    P: Array,
    kinematics: Array,
    start: Array,
    mag: Array,
    variance_scale: float,
    W: Array,
) -> tuple[Array, float]:
    """Gauss-Newton from x corrected by `start`: error and normalised innovation squared; fills W
    (m, errors) as in numerics/kalman.py."""
    rows, size = W.shape
    dx, cost, new = start.copy(), 0.0, np.empty(size)
    H, innovation, noise = np.zeros((rows, size)), np.zeros(rows), np.zeros((rows, rows))
    for iteration in range(ITERATIONS):
        compute_innovations(
            s, inject_error(x, dx), kinematics, mag, variance_scale, H, innovation, noise
        )
        for row in range(rows):
            for j in range(size):
                innovation[row] += H[row, j] * dx[j]
        cost = innovation_gain(P, innovation, H, noise, W, new)
        if damped_step(dx, new, iteration == ITERATIONS - 1) < NEAR:
            break
    return dx, cost


@inlined
def grid_coordinate(k: int) -> float:
    """Grid from -1 to 1, denser in the middle, where the field curves most."""
    u: float = 2.0 * k / (GRID - 1) - 1.0
    return u * math.sqrt(abs(u))


@inlined
def candidate_positions(s: NoiseModel, x: Array, P: Array, mag: Array, centre: Array) -> Array:
    """Errors (8, errors), zero but for the position: the best fit to the readings in each octant of
    the workspace."""
    best, lowest, where, innovation = (
        np.zeros((8, len(P))),
        np.full(8, math.inf),
        np.zeros(3),
        np.zeros(3),
    )
    R = rotation_matrix(x[XQ : XQ + 4])
    m, arm, B_b = (
        multiply_vector(R, x[XM : XM + 3]),
        multiply_vector(R, x[XM + 3 : XM + 6]),
        multiply_transposed(rotation_matrix(x[XGB : XGB + 4]), x[XB : XB + 3]),
    )
    first = XL + 3 * len(mag)
    tilt = P[TH, TH] + P[TH + 1, TH + 1] + P[TH + 2, TH + 2]
    common = (
        P[B_, B_] + P[B_ + 1, B_ + 1] + P[B_ + 2, B_ + 2]
    ) / 3  # of the ambient field, an error common to all magnetometers
    weighted = np.zeros(3)
    for a in range(GRID):
        where[0] = centre[0] + s.reach * grid_coordinate(a)
        for b in range(GRID):
            where[1] = centre[1] + s.reach * grid_coordinate(b)
            for c in range(GRID):
                where[2] = centre[2] + s.reach * grid_coordinate(c)
                cost, weight = 0.0, 0.0
                for i in range(3):
                    weighted[i] = 0.0
                for k in range(len(mag)):
                    if math.isnan(mag[k, 0] + mag[k, 1] + mag[k, 2]):
                        continue
                    square, along, field_strength = 1e-4, 0.0, 0.0
                    for i in range(3):
                        r = where[i] + arm[i] - x[first + 3 * k + i]
                        square += r * r
                        along += r * m[i]
                    for i in range(3):
                        own = (
                            MU0_4PI
                            * (
                                3 * along * (where[i] + arm[i] - x[first + 3 * k + i])
                                - square * m[i]
                            )
                            / square**2.5
                        )
                        field_strength += own * own
                        innovation[i] = mag[k, i] - B_b[i] - own
                    variance = (
                        s.single**2 + (tilt + 0.25) * field_strength
                    )  # half the field: between grid points
                    weight += 1.0 / variance
                    cost += 3 * math.log(variance)
                    for i in range(3):
                        cost += innovation[i] ** 2 / variance
                        weighted[i] += innovation[i] / variance
                cost += 3 * math.log(1.0 + common * weight)
                for i in range(3):
                    cost -= common * weighted[i] ** 2 / (1.0 + common * weight)
                octant = 4 * (2 * a // GRID) + 2 * (2 * b // GRID) + 2 * c // GRID
                if cost < lowest[octant]:
                    lowest[octant] = cost
                    for i in range(3):
                        best[octant, P_ + i] = where[i] - x[i]
    return best
