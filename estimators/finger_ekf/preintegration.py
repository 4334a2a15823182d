"""Preintegration of the gyroscopes between two updates, and propagation of state and covariance.

In      rotation of the four sensors at every sample, their biases, rotation variance from gaps
Out     preintegrated rotations with derivatives by the biases; q_pc and the covariance of the chain's error states at the end
Source  Kortier, thesis ch. 2: (2.3)-(2.5), (2.16), (2.20)-(2.22), two-sided; bias derivatives: Forster et al. 2017 (IEEE Trans Robot 33:1); exact for piecewise constant
        rates
"""

import math

import numpy as np

from handscope.estimators.finger_ekf import sensor_to_segment
from handscope.estimators.finger_ekf.kernel_params import KernelParams
from handscope.estimators.finger_ekf.sensor_to_segment import ERROR
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import inlined, rowwise
from handscope.estimators.numerics.kernels import right_jacobian_row
from handscope.estimators.numerics.small_matrices import block, product, put, spread
from handscope.estimators.numerics.typing import Array

BENDING = 2  # axis of a segment's frame about which a hinge bends: of that its forbidden angles tell nothing


@rowwise("(n,s,v),(n,s),(n,s),(s,v),(s,q),(s,v,v),(s),(s)->(n,s,q),(s,v,v),(s),(s)")
def preintegrate(
    turn: Array, time: Array, added_variance: Array, bias: Array, delta_q: Array, J_bias: Array, bias_time: Array, rotation_variance: Array,
    after: Array, J: Array, time_new: Array, variance_new: Array,
) -> None:  # fmt: skip
    """T <- T exp(w), and its derivative by the bias, J <- R(exp(w))' J - J_r(w) dt: Forster et al. 2017, (36)."""
    w, step, q, both = np.empty(3), np.empty(4), np.empty(4), np.empty(4)
    R, Jr, own, back = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for s in range(delta_q.shape[0]):
        put(J_bias[s], own)
        time_new[s], variance_new[s] = bias_time[s], rotation_variance[s]
        for a in range(4):
            q[a] = delta_q[s, a]
        for k in range(turn.shape[0]):
            for a in range(3):
                w[a] = turn[k, s, a] - bias[s, a] * time[k, s]  # (2.4)
            quat.exp_row(w, step, step)
            quat.multiply_row(q, step, both)
            for a in range(4):
                q[a], after[k, s, a] = both[a], both[a]
            quat.conjugate_row(step, both)
            quat.matrix_row(both, w, R)
            product(R, own, back)
            right_jacobian_row(w, Jr)
            for a in range(3):
                for b in range(3):
                    own[a, b] = back[a, b] - Jr[a, b] * time[k, s]
            time_new[s] += time[k, s]
            variance_new[s] += added_variance[k, s]
        put(own, J[s])


preintegrate_row = preintegrate.row  # as other kernels call it


@inlined
def field_correlation(p: KernelParams, T: Array) -> float:
    """Correlation of the field difference before and after the sensors turn by T (4, 4): it decays over one radian."""
    w = min(abs(T[0, 0]), abs(T[3, 0]), 1.0)
    return math.exp(-2 * math.acos(w)) if p.mag_error > 0 else 1.0


@inlined
def propagate_row(
    p: KernelParams,
    span: float,
    T: Array,
    J: Array,
    rotation_variance: Array,
    q_pc: Array,
    P: Array,
    q: Array,
    P_new: Array,
) -> None:
    """Propagate rotations and covariance over a window. (2.16), (2.20)-(2.22), not linearised in dt

    With q_new = conj(T_p) q T_c and T(b + db) = T exp(J db): dth_new = R(T_c)' dth + J_c db_c -
    R(q_new)' J_p db_p, and a sensor's rotation error e adds e to the joint whose child it is, -R(q_new)' e to the joint whose parent it is.
    """
    F, G = np.zeros((9, ERROR.q_SB)), np.zeros((9, 12))
    back, R_cp, R_cs, by_parent, row = (
        np.empty(4),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty(3),
    )
    sensor_to_segment.propagate_joints_row(q_pc, T, q)
    for j in range(3):
        quat.conjugate_row(q[j], back)
        quat.matrix_row(back, row, R_cp)
        quat.conjugate_row(T[j + 1], back)
        quat.matrix_row(back, row, R_cs)
        product(R_cp, J[j], by_parent)
        block(1.0, R_cs, 3 * j, 3 * j, F)
        block(-1.0, by_parent, 3 * j, ERROR.bias + 3 * j, F)
        block(1.0, J[j + 1], 3 * j, ERROR.bias + 3 + 3 * j, F)
        block(-1.0, R_cp, 3 * j, 3 * j, G)
        for a in range(3):
            G[3 * j + a, 3 * j + 3 + a] = 1.0
    Q, across, of_noise = np.zeros((12, 12)), np.empty((9, P.shape[0])), np.empty((9, 9))
    for k in range(12):
        w, x, y, z = T[k // 3, 0], T[k // 3, 1], T[k // 3, 2], T[k // 3, 3]
        angle = 2 * math.atan2(math.sqrt(x * x + y * y + z * z), abs(w))
        Q[k, k] = p.gyr_noise**2 / 2 * span + (p.gyr_scale * angle) ** 2 + rotation_variance[k // 3]
    spread(G, Q, of_noise)
    product(F, P, across)
    put(P, P_new)
    for i in range(9):
        for k in range(P.shape[0]):
            P_new[i, k] = P_new[k, i] = across[i, k]
    for i in range(9):
        for k in range(i + 1):
            of_angles = 0.0
            for j in range(ERROR.q_SB):
                if F[k, j] != 0.0:
                    of_angles += across[i, j] * F[k, j]
            P_new[i, k] = P_new[k, i] = of_angles + of_noise[i, k]
    for k in range(ERROR.bias, ERROR.q_SB):
        P_new[k, k] += p.bias_walk**2 * span
    for k in range(ERROR.q_SB, ERROR.soft_tissue):
        if (k - ERROR.q_SB) % 3 != BENDING:
            P_new[k, k] += p.mounting_walk**2 * span
    if p.mag_error > 0:
        left = field_correlation(p, T)
        for k in range(P.shape[0]):
            P_new[ERROR.field_difference, k] *= left
            P_new[k, ERROR.field_difference] *= left
        P_new[ERROR.field_difference, ERROR.field_difference] += 2 * p.mag_error**2 * (1 - left**2)
