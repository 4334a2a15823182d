"""Compiled kernels of the finger filter: end of a window, preintegration, update of one chain.

In      arrays of one chain, in the order of filter.State; options packed by filter.py
Out     filled in place: preintegrated window, updated state, covariance of the joints
Source  as filter.py, whose State holds these arrays for all chains
"""

import math

import numpy as np

from handscope.estimators.finger_ekf import (
    inclination_noise,
    joint_compliance,
    magnetic_heading,
    preintegration,
    sensor_to_segment,
    zero_rate_update,
)
from handscope.estimators.finger_ekf import measurements as finger_ekf_measurements
from handscope.estimators.finger_ekf.measurements import RATE_GATE
from handscope.estimators.finger_ekf.preintegration import MAG_ERROR
from handscope.estimators.finger_ekf.sensor_to_segment import (
    SIZE,
    inject_error,
)
from handscope.estimators.numerics.jit import inlined, rowwise
from handscope.estimators.numerics.kalman import correct
from handscope.estimators.numerics.small_matrices import put, spread
from handscope.estimators.numerics.typing import Array

MAX_GAP_VARIANCE = (
    math.radians(0.5) ** 2
)  # rad^2, rotation variance from gaps since the update that closes the window


@rowwise("(),(),(n),(n,f,s),(f,s),(n,f,j),(f,j)->(),()")
def find_window_end(
    due: float,
    first: float,
    t: Array,
    rotation_variance: Array,
    variance_before: Array,
    known: Array,
    known_now: Array,
    last: Array,
    closes: Array,
) -> None:
    """End row of the window that begins at `first`, and whether an update follows there. A window ends when an update is due or a joint appears or disappears.

    It closes at once after a gap that adds much rotation variance, so that the covariance shows it.
    """
    missed_variance = variance_before.copy()
    last[0], closes[0] = t.shape[0], 0.0
    for k in range(int(first), t.shape[0]):
        same_joints, ends = True, t[k] >= due
        for f in range(missed_variance.shape[0]):
            for j in range(known_now.shape[1]):
                same_joints = same_joints and known[k, f, j] == known_now[f, j]
            for s in range(missed_variance.shape[1]):
                missed_variance[f, s] += rotation_variance[k, f, s]
                ends = ends or missed_variance[f, s] > MAX_GAP_VARIANCE
        if ends or not same_joints:
            last[0], closes[0] = (k + 1, 1.0) if same_joints else (k, 0.0)
            break


@rowwise(
    "(n,s,v),(n,s),(n,s),(s,v),(s,q),(s,v,v),(s),(s),(j,q),(s,q),(j,v)->(n,j,q),(s,q),(s,v,v),(s),(s)"
)
def extend_window(
    turn: Array, time: Array, added_variance: Array, bias: Array, delta_q: Array, J_bias: Array, bias_time: Array, rotation_variance: Array,
    q_pc: Array, q_SB: Array, soft_tissue_gain: Array,
    q_joint: Array, T: Array, J: Array, time_new: Array, variance_new: Array,
) -> None:  # fmt: skip
    """Preintegrate all rows; fill the joints after each of them."""
    after, q_now, q_SB_now, gain_now = (
        np.empty((turn.shape[0], 4, 4)),
        q_pc.copy(),
        q_SB.copy(),
        soft_tissue_gain.copy(),
    )
    preintegration.preintegrate_row(
        turn,
        time,
        added_variance,
        bias,
        delta_q,
        J_bias,
        bias_time,
        rotation_variance,
        after,
        J,
        time_new,
        variance_new,
    )
    for row in range(turn.shape[0]):
        sensor_to_segment.true_joints_row(q_now, q_SB_now, gain_now, after[row], q_joint[row])
        put(after[row], T)


@inlined
def _update_heading(
    p: Array, mag: Array, up: Array, rates: Array, known: Array, vector_valid: Array,
    q: Array, bias: Array, q_SB: Array, soft_tissue_gain: Array, field_difference: Array, P: Array,
) -> None:  # fmt: skip
    """Heading update from the magnetometers of hand and tip, if both sensors are complete and slow."""
    seen = (
        known[0] > 0
        and known[1] > 0
        and known[2] > 0
        and math.isfinite(mag[0, 0] + mag[0, 1] + mag[0, 2] + mag[1, 0] + mag[1, 1] + mag[1, 2])
    )
    if (
        p[MAG_ERROR] > 0
        and seen
        and vector_valid[0] > 0
        and vector_valid[3] > 0
        and max(rates[0], rates[3]) < p[RATE_GATE]
    ):
        innovation, H, noise, dx = (
            np.zeros(1),
            np.zeros((1, SIZE)),
            np.zeros((1, 1)),
            np.empty(SIZE),
        )
        if magnetic_heading.heading_row(
            p, q, mag.copy(), up, field_difference, P, innovation, H, noise
        ):
            correct(P, innovation, H, noise, dx)
            inject_error(q, bias, q_SB, soft_tissue_gain, field_difference, dx)


@rowwise(
    "(p),(),(s,q),(s,v,v),(s),(s),(s,v),(m,v),(j),(j,v),(j,v,w),(j,q),(s,v),(s,q),(j,v),(o),(e,e),(s,v),(s),(s,v),(s,v),(o),(s),(s,v),(s,v),(j,o),(d)"
    "->(j,q),(s,v),(s,q),(j,v),(o),(e,e),(s,v),(s),(s,v),(s,v),(o),(s),(s,v),(s,v),(j,o),(j,q),(d,d)"
)
def update_chain(
    p: Array, span: float, delta_q: Array, J_bias: Array, bias_time: Array, rotation_variance: Array, acc: Array, mag: Array,
    known: Array, free: Array, limits: Array,
    q_pc: Array, bias: Array, q_SB: Array, soft_tissue_gain: Array, field_difference: Array, P: Array, up: Array, rest_time: Array, rest_rotation: Array,
    previous_rest_rate: Array, rest_rate_scatter: Array, mean_square_rate: Array, initial_vertical: Array, current_vertical: Array, compliance_stats: Array, row: Array,
    q_pc_new: Array, bias_new: Array, q_SB_new: Array, soft_tissue_gain_new: Array, field_difference_new: Array, P_new: Array, up_new: Array, rest_time_new: Array,
    rest_rotation_new: Array, previous_rest_rate_new: Array, rest_rate_scatter_new: Array, mean_square_rate_new: Array, initial_vertical_new: Array, current_vertical_new: Array, compliance_stats_new: Array, q_true: Array, P_joints: Array,
) -> None:  # fmt: skip
    """Update at a window's end: shared vertical, joint constraints, heading, zero rates."""
    q, C, T, correlation = np.empty((3, 4)), np.empty(P.shape), delta_q.copy(), np.empty(1)
    bias_now, q_SB_now, gain_now, difference_now, rest_time_now, rest_rotation_now = (
        bias.copy(),
        q_SB.copy(),
        soft_tissue_gain.copy(),
        field_difference.copy(),
        rest_time.copy(),
        rest_rotation.copy(),
    )
    rest_rate_now, rest_scatter_now, square_rate_now, initial_now, vertical_now, compliance_now = (
        previous_rest_rate.copy(),
        rest_rate_scatter.copy(),
        mean_square_rate.copy(),
        initial_vertical.copy(),
        current_vertical.copy(),
        compliance_stats.copy(),
    )
    preintegration.field_correlation_row(p, T, correlation)
    difference_now[0] *= correlation[0]
    preintegration.propagate_row(
        p, span, T, J_bias.copy(), rotation_variance, q_pc.copy(), P.copy(), q, C
    )
    vertical, q_joint, A = up.copy(), np.empty((3, 4)), np.zeros((9, SIZE))
    sensor_to_segment.joint_jacobian_row(q, q_SB_now, gain_now, q_joint, A)
    if span > 0:
        seen, vector_valid, rates, both_sensors_valid, dx = (
            np.zeros((4, 3)),
            np.empty(4),
            np.empty(4),
            np.empty(3),
            np.empty(SIZE),
        )
        inclination_variance, compliance_variance = np.empty(4), np.empty(3)
        for s in range(4):
            vector_valid[s] = (
                1.0
                if math.isfinite(acc[s, 0])
                and math.isfinite(acc[s, 1])
                and math.isfinite(acc[s, 2])
                else 0.0
            )
            rates[s] = (
                2
                * math.atan2(math.sqrt(T[s, 1] ** 2 + T[s, 2] ** 2 + T[s, 3] ** 2), abs(T[s, 0]))
                / span
            )
            for a in range(3):
                seen[s, a] = acc[s, a] if vector_valid[s] > 0 else 0.0
        for j in range(3):
            both_sensors_valid[j] = known[j] * vector_valid[j] * vector_valid[j + 1]
        finger_ekf_measurements.smoothed_vertical_row(
            up.copy(), T, seen, vector_valid, span, vertical
        )
        innovation, H, noise = np.zeros(18), np.zeros((18, SIZE)), np.zeros((18, 18))
        inclination_noise.track_motion_row(
            p, span, seen, vector_valid, rates, square_rate_now, initial_now, vertical_now
        )
        inclination_noise.inclination_variance_row(p, square_rate_now, inclination_variance)
        finger_ekf_measurements.vectors_row(
            p,
            q,
            seen,
            vertical,
            inclination_variance,
            rates,
            both_sensors_valid,
            span,
            innovation,
            H,
            noise,
        )
        joint_compliance.compliance_variance_row(p, compliance_now, compliance_variance)
        finger_ekf_measurements.joint_constraints_row(
            p, q_joint, A, C, compliance_variance, free, limits, known, span, innovation, H, noise
        )
        joint_compliance.update_compliance_row(
            p, q_pc, q, C, free, compliance_variance, span, innovation, H, noise, compliance_now
        )
        correct(C, innovation, H, noise, dx)
        inject_error(q, bias_now, q_SB_now, gain_now, difference_now, dx)
        _update_heading(
            p,
            mag,
            vertical,
            rates,
            known,
            vector_valid,
            q,
            bias_now,
            q_SB_now,
            gain_now,
            difference_now,
            C,
        )
        zero_rate_update.zero_rate_update_row(
            p,
            T,
            bias_time,
            span,
            rates,
            q,
            bias_now,
            q_SB_now,
            gain_now,
            difference_now,
            C,
            rest_time_now,
            rest_rotation_now,
            rest_rate_now,
            rest_scatter_now,
        )
    spread(A, C, P_joints)
    inclination_noise.add_accelerometer_biases_row(p, q_joint, initial_now, vertical_now, P_joints)
    for s in range(4):  # the new window begins without rotation
        T[s, 0], T[s, 1], T[s, 2], T[s, 3] = 1.0, 0.0, 0.0, 0.0
    sensor_to_segment.true_joints_row(q, q_SB_now, gain_now, T, q_joint)
    put(q_joint, q_true)
    put(q, q_pc_new)
    put(bias_now, bias_new)
    put(q_SB_now, q_SB_new)
    put(gain_now, soft_tissue_gain_new)
    field_difference_new[0], field_difference_new[1] = difference_now[0], difference_now[1]
    put(C, P_new)
    put(vertical, up_new)
    put(rest_rotation_now, rest_rotation_new)
    put(rest_rate_now, previous_rest_rate_new)
    rest_rate_scatter_new[0], rest_rate_scatter_new[1] = rest_scatter_now[0], rest_scatter_now[1]
    put(initial_now, initial_vertical_new)
    put(vertical_now, current_vertical_new)
    put(compliance_now, compliance_stats_new)
    for s in range(4):
        rest_time_new[s], mean_square_rate_new[s] = rest_time_now[s], square_rate_now[s]


@rowwise("(j,q),(s,q),(j,v),(e,e),(d)->(d,d)")
def joint_covariance(
    q_pc: Array, q_SB: Array, soft_tissue_gain: Array, P: Array, row: Array, P_joints: Array
) -> None:
    """Covariance (9, 9) of the true joints' errors."""
    q_joint, A = np.empty((3, 4)), np.zeros((9, SIZE))
    sensor_to_segment.joint_jacobian_row(
        q_pc.copy(), q_SB.copy(), soft_tissue_gain.copy(), q_joint, A
    )
    spread(A, P.copy(), P_joints)
