"""Error of the vertical: larger after fast turns, and from accelerometer biases once a sensor lies differently.

In      verticals in the sensors' frames, angular rates
Out     variances of the verticals, and the joint covariance caused by accelerometer biases
Source  a bias b tilts the vertical u of a sensor by u x b / g. The pose attributes this tilt to the mounting, so it cancels while the sensor lies as in the pose; later (u - u_0) x b / g remains. Growth with the rate: measured on real trials, docs/decisions/0009-sizes-of-errors.md
Limits  mountings count as straight here; scale errors of accelerometers count as biases
"""

import numpy as np

from handscope.estimators.finger_ekf.kernel_params import KernelParams
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.small_matrices import spread
from handscope.estimators.numerics.typing import Array


@inlined
def track_motion_row(
    p: KernelParams,
    span: float,
    acc: Array,
    vector_valid: Array,
    rates: Array,
    mean_square_rate: Array,
    initial_vertical: Array,
    current_vertical: Array,
) -> None:
    """Low-pass squared rates (4,) and verticals (4, 3) over the correlation time; `initial_vertical` (4, 3) is the first, 0 before it."""
    weight = span / max(span, p.inclination_time)
    for s in range(4):
        mean_square_rate[s] += weight * (rates[s] ** 2 - mean_square_rate[s])
        size = np.sqrt(acc[s, 0] ** 2 + acc[s, 1] ** 2 + acc[s, 2] ** 2)
        first = (
            initial_vertical[s, 0] == 0
            and initial_vertical[s, 1] == 0
            and initial_vertical[s, 2] == 0
        )
        for a in range(3 if vector_valid[s] > 0 and size > 0 else 0):
            if first:
                initial_vertical[s, a] = current_vertical[s, a] = acc[s, a] / size
            else:
                current_vertical[s, a] += weight * (acc[s, a] / size - current_vertical[s, a])


@inlined
def inclination_variance_row(p: KernelParams, mean_square_rate: Array, variance: Array) -> None:
    """Variance of each axis of the vertical in every sensor (4,), rad^2."""
    for s in range(4):
        variance[s] = p.inclination**2 + p.inclination_by_rate**2 * mean_square_rate[s]


@inlined
def add_accelerometer_biases_row(
    p: KernelParams,
    q_joint: Array,
    initial_vertical: Array,
    current_vertical: Array,
    P_joints: Array,
) -> None:
    """Add to the joint covariance (9, 9) what accelerometer biases cause in sensors that lie differently from the start.

    (u - u_0) x b of the child's sensor, -R_cp of its parent's: neighbours share a sensor.
    """
    biases, G, R, added, u = (
        np.zeros((12, 12)),
        np.zeros((9, 12)),
        np.empty((3, 3)),
        np.empty((9, 9)),
        np.empty(3),
    )
    size = (p.acc_bias / GRAVITY) ** 2
    for s in range(4):
        for a in range(3):
            u[a] = current_vertical[s, a] - initial_vertical[s, a]
        squared = u[0] ** 2 + u[1] ** 2 + u[2] ** 2
        for a in range(3):
            for b in range(3):
                biases[3 * s + a, 3 * s + b] = size * ((squared if a == b else 0.0) - u[a] * u[b])
    for j in range(3):
        quat.matrix_row(q_joint[j], u, R)
        for a in range(3):
            G[3 * j + a, 3 * j + 3 + a] = 1.0
            for b in range(3):
                G[3 * j + a, 3 * j + b] = -R[b, a]
    spread(G, biases, added)
    for i in range(9):
        for k in range(9):
            P_joints[i, k] += added[i, k]
