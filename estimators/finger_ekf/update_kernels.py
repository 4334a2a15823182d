"""Compiled kernels of the finger filter: end of a window, preintegration, update of the chains.

In      records of all chains (chain_state.py); options packed by filter.py
Out     filled in place: preintegrated window, updated state, joints and their covariance
Source  as filter.py, whose State holds these arrays
"""

import math

import numpy as np

from handscope.estimators.finger_ekf import (
    inclination_noise,
    joint_compliance,
    magnetic_heading,
    mean_rest,
    mounting_change,
    preintegration,
    sensor_to_segment,
    zero_rate_update,
)
from handscope.estimators.finger_ekf import measurements as finger_ekf_measurements
from handscope.estimators.finger_ekf.chain_state import (
    ChainState,
    Joints,
    Window,
    chain_of,
    joints_of,
    window_of,
)
from handscope.estimators.finger_ekf.kernel_params import KernelParams
from handscope.estimators.finger_ekf.sensor_to_segment import (
    SIZE,
    inject_error,
)
from handscope.estimators.numerics.jit import inlined, looped, rowwise
from handscope.estimators.numerics.kalman import correct
from handscope.estimators.numerics.small_matrices import put, spread, variance_of
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


@looped
def extend_windows(
    turn: Array, time: Array, added_variance: Array,
    bias: Array, q_pc: Array, q_SB: Array, soft_tissue_gain: Array,
    window: Window, q_joint: Array,
) -> None:  # fmt: skip
    """Preintegrate all rows (n, F, 4, ...) into the window; fill the joints (n, F, 3, 4) after each of them."""
    rows, buffers = turn.shape[0], sensor_to_segment.joint_buffers()
    after = np.empty((rows, 4, 4))
    for f in range(turn.shape[1]):
        preintegration.preintegrate_row(
            turn[:, f],
            time[:, f],
            added_variance[:, f],
            bias[f],
            window.delta_q[f],
            window.J_bias[f],
            window.bias_time[f],
            window.rotation_variance[f],
            after,
            window.J_bias[f],
            window.bias_time[f],
            window.rotation_variance[f],
        )
        put(after[rows - 1], window.delta_q[f])
        for row in range(rows):
            sensor_to_segment.true_joints_row(
                q_pc[f], q_SB[f], soft_tissue_gain[f], after[row], buffers, q_joint[row, f]
            )


@inlined
def _update_heading(
    p: KernelParams,
    mag: Array,
    rates: Array,
    vector_valid: Array,
    joints: Joints,
    chain: ChainState,
) -> None:
    """Heading update from the magnetometers of hand and tip, if both sensors are complete and slow."""
    known = joints.known
    seen = (
        known[0] > 0
        and known[1] > 0
        and known[2] > 0
        and math.isfinite(mag[0, 0] + mag[0, 1] + mag[0, 2] + mag[1, 0] + mag[1, 1] + mag[1, 2])
    )
    if (
        p.mag_error > 0
        and seen
        and vector_valid[0] > 0
        and vector_valid[3] > 0
        and max(rates[0], rates[3]) < p.rate_gate
    ):
        innovation, H, noise, dx = (
            np.zeros(1),
            np.zeros((1, SIZE)),
            np.zeros((1, 1)),
            np.empty(SIZE),
        )
        if magnetic_heading.heading_row(
            p,
            chain.q_pc,
            mag.copy(),
            chain.up,
            chain.field_difference,
            chain.P,
            innovation,
            H,
            noise,
        ):
            correct(chain.P, innovation, H, noise, dx)
            inject_error(
                chain.q_pc,
                chain.bias,
                chain.q_SB,
                chain.soft_tissue_gain,
                chain.field_difference,
                dx,
            )


@looped
def propagate_chains(p: KernelParams, span: float, window: Window, chains: ChainState) -> None:
    """Propagate each of F chains to a window's end, without any update."""
    for f in range(window.delta_q.shape[0]):
        _propagate_chain(p, span, window_of(window, f), chain_of(chains, f))


@inlined
def _propagate_chain(p: KernelParams, span: float, window: Window, chain: ChainState) -> None:
    """Propagate rotations, covariance and the field difference over a window."""
    chain.field_difference[0] *= preintegration.field_correlation(p, window.delta_q)
    preintegration.propagate_row(
        p,
        span,
        window.delta_q,
        window.J_bias,
        window.rotation_variance,
        chain.q_pc.copy(),
        chain.P,
        chain.q_pc,
        chain.P,
    )


@looped
def update_chains(
    p: KernelParams, span: float, window: Window, acc: Array, mag: Array, joints: Joints,
    chains: ChainState, q_joint: Array, P_joints: Array,
) -> None:  # fmt: skip
    """`_update_chain` for each of F chains: all arrays but the options have their axis first."""
    for f in range(acc.shape[0]):
        _update_chain(
            p,
            span,
            window_of(window, f),
            acc[f],
            mag[f],
            joints_of(joints, f),
            chain_of(chains, f),
            q_joint[f],
            P_joints[f],
        )


@inlined
def _update_chain(
    p: KernelParams, span: float, window: Window, acc: Array, mag: Array, joints: Joints,
    chain: ChainState, q_joint: Array, P_joints: Array,
) -> None:  # fmt: skip
    """Update at a window's end: shared vertical, joint constraints, heading, zero rates. Fills the true joints (3, 4) and their covariance (9, 9)."""
    q_before = chain.q_pc.copy()
    _propagate_chain(p, span, window, chain)
    A = np.zeros((9, SIZE))
    sensor_to_segment.joint_jacobian_row(chain.q_pc, chain.q_SB, chain.soft_tissue_gain, q_joint, A)
    if span > 0:
        _correct_chain(p, span, window, acc, mag, joints, chain, q_before, q_joint, A)
    spread(A, chain.P, P_joints)
    inclination_noise.add_accelerometer_biases_row(
        p, q_joint, chain.initial_vertical, chain.current_vertical, P_joints
    )
    still = np.zeros((4, 4))  # the new window begins without rotation
    for s in range(4):
        still[s, 0] = 1.0
    sensor_to_segment.true_joints_row(
        chain.q_pc,
        chain.q_SB,
        chain.soft_tissue_gain,
        still,
        sensor_to_segment.joint_buffers(),
        q_joint,
    )


@inlined
def _correct_chain(
    p: KernelParams, span: float, window: Window, acc: Array, mag: Array, joints: Joints,
    chain: ChainState, q_before: Array, q_joint: Array, A: Array,
) -> None:  # fmt: skip
    """The measurement updates of a window of `span` seconds, of joints q_joint (3, 4) with the Jacobian A (9, 43)."""
    seen, vector_valid, rates, both_sensors_valid, dx = (
        np.zeros((4, 3)),
        np.empty(4),
        np.empty(4),
        np.empty(3),
        np.empty(SIZE),
    )
    inclination_variance, compliance_variance = np.empty(4), np.empty(3)
    T, lasts = window.delta_q, mean_rest.joint_correlation(p, span, chain.stay_clock)
    for s in range(4):
        vector_valid[s] = (
            1.0
            if math.isfinite(acc[s, 0]) and math.isfinite(acc[s, 1]) and math.isfinite(acc[s, 2])
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
        both_sensors_valid[j] = joints.known[j] * vector_valid[j] * vector_valid[j + 1]
    finger_ekf_measurements.smoothed_vertical_row(chain.up, T, seen, vector_valid, span, chain.up)
    innovation, H, noise = np.zeros(18), np.zeros((18, SIZE)), np.zeros((18, 18))
    inclination_noise.track_motion_row(
        p,
        span,
        seen,
        vector_valid,
        rates,
        chain.mean_square_rate,
        chain.initial_vertical,
        chain.current_vertical,
    )
    inclination_noise.inclination_variance_row(p, chain.mean_square_rate, inclination_variance)
    finger_ekf_measurements.vectors_row(
        p,
        chain.q_pc,
        seen,
        chain.up,
        inclination_variance,
        rates,
        both_sensors_valid,
        span,
        innovation,
        H,
        noise,
    )
    joint_compliance.compliance_variance_row(p, chain.compliance_stats, compliance_variance)
    finger_ekf_measurements.joint_constraints_row(
        p,
        q_joint,
        A,
        chain.P,
        compliance_variance,
        joints.free,
        joints.limits,
        joints.known,
        lasts,
        innovation,
        H,
        noise,
    )
    own_variance = np.zeros(9)
    for row in range(9):
        if joints.free[row // 3, row % 3] == 0:
            own_variance[row] = variance_of(H[9 + row], chain.P)
    mounting_change.accumulate_row(
        p,
        own_variance,
        chain.reference_compliance,
        joints.free,
        span,
        innovation,
        H,
        chain.mounting_score,
        chain.mounting_information,
    )
    joint_compliance.update_compliance_row(
        p,
        q_before,
        chain.q_pc,
        own_variance,
        joints.free,
        compliance_variance,
        lasts,
        innovation,
        noise,
        chain.compliance_stats,
    )
    correct(chain.P, innovation, H, noise, dx)
    inject_error(
        chain.q_pc, chain.bias, chain.q_SB, chain.soft_tissue_gain, chain.field_difference, dx
    )
    _update_heading(p, mag, rates, vector_valid, joints, chain)
    zero_rate_update.zero_rate_update_row(p, T, window.bias_time, span, rates, chain)
    mean_rest.mean_rest_row(p, chain)


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
