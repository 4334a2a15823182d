"""Measurement model of the magnetometers, iterated updates, and the search for a lost magnet;
compiled.

In      state x and covariance P (state.py); readings (magnetometers, 3) in the base's axes
Out     predicted readings and Jacobians; errors, covariance, normalised innovation squared
Source  Kortier, thesis ch. 5, (5.7)-(5.15). The update is iterated (Bell & Cathey 1993, IEEE Trans
        Autom Control 38:294): the dipole is far from linear where the position is uncertain
Leaves  the Jacobian of a known position is taken three quarters of the way to the solution
        (docs/methods/magnet.md says why)
"""

import math

import numpy as np

from handscope.estimators.magnet.tracker.latency import Kinematics
from handscope.estimators.magnet.tracker.measurement_model import compute_innovations
from handscope.estimators.magnet.tracker.state import (
    B_,
    P_,
    TH,
    XB,
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
    multiply_transposed,
    multiply_vector,
    rotation_matrix,
)
from handscope.estimators.numerics.typing import Array

ITERATIONS = 12
SHARE = 0.75  # of the way to the solution, where the Jacobian is taken
NEAR = 0.002  # m: a smaller step is converged
GRID = 10  # grid points along each axis of the workspace
EVIDENCE = 12.0  # by which a candidate must lower the cost against the filter's own position


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
    s: NoiseModel, x: Array, P: Array, kinematics: Kinematics, mag: Array, variance_scale: float
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
    kinematics: Kinematics,
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
    kinematics: Kinematics,
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
