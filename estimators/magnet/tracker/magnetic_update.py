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
from typing import NamedTuple

import numpy as np

from handscope.estimators.magnet.tracker.latency import Kinematics
from handscope.estimators.magnet.tracker.measurement_model import compute_innovations
from handscope.estimators.magnet.tracker.state import ERROR, STATE, NoiseModel, inject_error
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


class GridTerms(NamedTuple):
    """What the cost of all grid points has in common."""

    moment: Array  # (3,) A m^2, base axes
    arm: Array  # (3,) m, from the hand's sensor to the magnet
    B_b: Array  # (3,) T, ambient field
    places: Array  # (3 L,) m, of the magnetometers
    tilt: float  # rad^2, variance of the hand's orientation
    common: float  # T^2, variance of the ambient field, an error common to all magnetometers
    variance: float  # T^2, of a single reading


@inlined
def grid_terms(s: NoiseModel, x: Array, P: Array, magnetometers: int) -> GridTerms:
    """Of state x and covariance P."""
    R, first = (
        rotation_matrix(x[STATE.q_bt : STATE.q_bt + 4]),
        STATE.residuals + 3 * magnetometers,
    )
    th, B = ERROR.th_bt, ERROR.B_g
    return GridTerms(
        multiply_vector(R, x[STATE.moment : STATE.moment + 3]),
        multiply_vector(R, x[STATE.lever : STATE.lever + 3]),
        multiply_transposed(
            rotation_matrix(x[STATE.q_gb : STATE.q_gb + 4]), x[STATE.B_g : STATE.B_g + 3]
        ),
        x[first : first + 3 * magnetometers],
        P[th, th] + P[th + 1, th + 1] + P[th + 2, th + 2],
        (P[B, B] + P[B + 1, B + 1] + P[B + 2, B + 2]) / 3,
        s.single**2,
    )


@inlined
def candidate_positions(s: NoiseModel, x: Array, P: Array, mag: Array, centre: Array) -> Array:
    """Errors (8, errors), zero but for the position: the best fit to the readings in each octant of
    the workspace."""
    best, lowest, where = np.zeros((8, len(P))), np.full(8, math.inf), np.zeros(3)
    terms, work = grid_terms(s, x, P, len(mag)), np.empty((3, 3))
    for a in range(GRID):
        where[0] = centre[0] + s.reach * grid_coordinate(a)
        for b in range(GRID):
            where[1] = centre[1] + s.reach * grid_coordinate(b)
            for c in range(GRID):
                where[2] = centre[2] + s.reach * grid_coordinate(c)
                cost = grid_point_cost(terms, where, mag, work)
                octant = 4 * (2 * a // GRID) + 2 * (2 * b // GRID) + 2 * c // GRID
                if cost < lowest[octant]:
                    lowest[octant] = cost
                    for i in range(3):
                        best[octant, ERROR.p_bt + i] = where[i] - x[STATE.p_bt + i]
    return best


@inlined
def grid_point_cost(terms: GridTerms, where: Array, mag: Array, work: Array) -> float:
    """Normalised innovation squared of a position, with the logarithm of its variance; work (3, 3)
    is filled."""
    cost, weight, weighted, innovation, r = 0.0, 0.0, work[0], work[1], work[2]
    for i in range(3):
        weighted[i] = 0.0
    for k in range(len(mag)):
        if math.isnan(mag[k, 0] + mag[k, 1] + mag[k, 2]):
            continue
        for i in range(3):
            r[i] = where[i] + terms.arm[i] - terms.places[3 * k + i]
            innovation[i] = mag[k, i] - terms.B_b[i]
        field_square = subtract_dipole(terms.moment, r, innovation)
        variance = (
            terms.variance + (terms.tilt + 0.25) * field_square
        )  # half the field: between grid points
        weight += 1.0 / variance
        cost += 3 * math.log(variance)
        for i in range(3):
            cost += innovation[i] ** 2 / variance
            weighted[i] += innovation[i] / variance
    cost += 3 * math.log(1.0 + terms.common * weight)
    for i in range(3):
        cost -= terms.common * weighted[i] ** 2 / (1.0 + terms.common * weight)
    return cost


@inlined
def subtract_dipole(m: Array, r: Array, reading: Array) -> float:
    """Subtract the field of a moment m (3,) at r (3,) from a reading, in place; returns the square
    of that field, T^2."""
    square, along, field_square = 1e-4, 0.0, 0.0
    for i in range(3):
        square += r[i] * r[i]
        along += r[i] * m[i]
    for i in range(3):
        own = MU0_4PI * (3 * along * r[i] - square * m[i]) / square**2.5
        field_square += own * own
        reading[i] -= own
    return field_square
