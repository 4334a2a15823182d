"""Measurement model of the magnetometers: predicted readings, Jacobians, innovations; compiled.

In      state x and covariance P (state.py), kinematics (latency.py); readings (magnetometers, 3) in the
        base's axes
Out     predicted readings (3,), Jacobians (3, errors), innovations with their noise
Source  Kortier, thesis ch. 5, (5.7)-(5.15), (5.24)
"""

import math
from typing import NamedTuple

import numpy as np

from handscope.estimators.magnet.tracker.latency import (
    Kinematics,
    map_jacobian_to_now,
    state_at_reading,
)
from handscope.estimators.magnet.tracker.state import ERROR, OWN, STATE, NoiseModel
from handscope.estimators.numerics.constants import MU0_4PI
from handscope.estimators.numerics.jit import inlined
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


@inlined
def magnetometers(x: Array) -> int:
    """Number of magnetometers in a state."""
    return (len(x) - STATE.residuals - 1) // 6


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
    """What readings of all magnetometers have in common at one state."""
    R, R_gb = (
        rotation_matrix(x[STATE.q_bt : STATE.q_bt + 4]),
        rotation_matrix(x[STATE.q_gb : STATE.q_gb + 4]),
    )
    moment, lever = (
        x[STATE.moment : STATE.moment + 3],
        x[STATE.lever : STATE.lever + 3],
    )
    S = field_gradient(x[STATE.gradients : STATE.gradients + 5])
    S_b = multiply_matrices(transpose(R_gb), multiply_matrices(S, R_gb))
    return CommonTerms(
        R,
        R_gb,
        multiply_vector(R, moment),
        multiply_vector(R, lever),
        multiply_transposed(R_gb, x[STATE.B_g : STATE.B_g + 3]),
        S_b,
        multiply_matrices(R, skew(lever)),
        multiply_matrices(R, skew(moment)),
    )


@inlined
def field_gradient(g: Array) -> Array:
    """Gradient (3, 3) of the ambient field, global axes, of its five values: xy, xz, yz, then
    xx - yy, xx + yy - 2 zz."""
    S = np.empty((3, 3))
    S[0, 1], S[0, 2], S[1, 2] = TWO * g[0], TWO * g[1], TWO * g[2]
    S[0, 0], S[1, 1], S[2, 2] = TWO * g[3] + SIX * g[4], SIX * g[4] - TWO * g[3], -2 * SIX * g[4]
    S[1, 0], S[2, 0], S[2, 1] = S[0, 1], S[0, 2], S[1, 2]
    return S


@inlined
def predict_reading(x: Array, at: CommonTerms, k: int, H: Array) -> Array:
    """Predicted reading of magnetometer k, base axes (3,); fills its Jacobian H (3, errors).
    (5.7)-(5.15), (5.24)"""
    residual, place = STATE.residuals + 3 * k, STATE.residuals + 3 * (magnetometers(x) + k)
    r = np.empty(3)
    for i in range(3):
        r[i] = x[STATE.p_bt + i] + at.arm[i] - x[place + i]
    J, D = dipole_derivatives(r, at.moment)
    clear(H)
    block(1.0, D, 0, ERROR.p_bt, H)
    slopes, room = room_field(x, at, x[place : place + 3], H)
    by_lever, by_moment = multiply_matrices(D, at.by_lever), multiply_matrices(J, at.by_moment)
    reads: Array = multiply_vector(J, at.moment)
    for i in range(3):
        H[i, OWN + residual - STATE.moment + i] = 1.0
        for j in range(3):
            H[i, OWN + place - STATE.moment + j] = slopes[i, j] - D[i, j]
            H[i, ERROR.th_bt + j] = -by_lever[i, j] - by_moment[i, j]
            H[i, ERROR.B_g + j] = at.R_gb[j, i]
        reads[i] += room[i] + x[residual + i]
    block(1.0, multiply_matrices(J, at.R), 0, ERROR.moment, H)
    block(1.0, multiply_matrices(D, at.R), 0, ERROR.lever, H)
    return reads


@inlined
def dipole_derivatives(r: Array, m: Array) -> tuple[Array, Array]:
    """Of the field of a moment m (3,) at r (3,) from the magnetometer, by moment and by position
    (3, 3), (3, 3). (5.7)"""
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
    return J, D


@inlined
def room_field(x: Array, at: CommonTerms, place: Array, H: Array) -> tuple[Array, Array]:
    """Gradient (3, 3) and value (3,) of the ambient field at a magnetometer, base axes; fills its
    Jacobian by trunk orientation and gradients."""
    steep_b, calibration = np.zeros((3, 6)), x[STATE.gradients + 5]
    product(transpose(at.R_gb), field_by_gradients(multiply_vector(at.R_gb, place)), steep_b)
    block(1.0, steep_b, 0, ERROR.gradients, H)
    field_change, carried, field, slopes = (
        multiply_vector(at.S_b, place),
        multiply_matrices(at.S_b, skew(place)),
        np.empty(3),
        at.S_b.copy(),
    )
    turning, about = skew(at.B_b), skew(field_change)
    for i in range(3):
        field[i] = at.B_b[i] + field_change[i] + calibration * place[i]
        for j in range(3):
            H[i, ERROR.th_gb + j] = turning[i, j] + about[i, j] - carried[i, j]
        slopes[i, i] += calibration
    return slopes, field


@inlined
def field_by_gradients(p: Array) -> Array:
    """Derivative (3, 6) of the ambient field at p (3,), global axes. A field without curl and
    divergence has five gradients; calibrations add one."""
    steep = np.zeros((3, 6))
    steep[0, 0], steep[1, 0] = TWO * p[1], TWO * p[0]
    steep[0, 1], steep[2, 1] = TWO * p[2], TWO * p[0]
    steep[1, 2], steep[2, 2] = TWO * p[2], TWO * p[1]
    steep[0, 3], steep[1, 3] = TWO * p[0], -TWO * p[1]
    steep[0, 4], steep[1, 4], steep[2, 4] = SIX * p[0], SIX * p[1], -2 * SIX * p[2]
    for i in range(3):
        steep[i, 5] = p[i]
    return steep


@inlined
def predict_delayed_reading(x: Array, kinematics: Kinematics, k: int, H: Array) -> Array:
    """Predicted reading (3,) of magnetometer k at the instant of its sample; fills the Jacobian H
    (3, errors) by the errors of now."""
    then, since = state_at_reading(x, kinematics, kinematics.age[k])
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
    kinematics: Kinematics,
    mag: Array,
    variance_scale: float,
    H: Array,
    innovation: Array,
    noise: Array,
) -> None:
    """Fill innovations (m,), Jacobian (m, errors) with zeros where a magnetometer did not answer,
    and noise (m, m) of variance_scale times the magnetometers' variance."""
    age = kinematics.age[0]
    then, since = state_at_reading(x, kinematics, age)
    at = common_terms(then)
    for k in range(len(mag)):
        rows = H[3 * k : 3 * k + 3]
        for i in range(3):
            noise[3 * k + i, 3 * k + i], innovation[3 * k + i] = variance_scale * s.mag**2, 0.0
        if math.isnan(mag[k, 0] + mag[k, 1] + mag[k, 2]):
            clear(rows)
            continue
        if kinematics.age[k] != age:
            age = kinematics.age[k]
            then, since = state_at_reading(x, kinematics, age)
            at = common_terms(then)
        reads = predict_reading(then, at, k, rows)
        map_jacobian_to_now(since, rows)
        for i in range(3):
            innovation[3 * k + i] = mag[k, i] - reads[i]
