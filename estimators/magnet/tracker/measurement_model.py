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
)
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
    """What readings of all magnetometers have in common at one state."""
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
