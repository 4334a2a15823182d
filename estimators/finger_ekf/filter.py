"""Joint rotations of the fingers, the biases of their gyroscopes and how the sensors sit: an error-state filter a chain, all chains one batch.

In      what the four sensors of a chain (for a finger hand, proximal, middle, distal; for the wrist forearm and hand) turned by since the sample before,
        and which way is up, both in sensor frames that the calibration has turned to the segments'
Out     rotations of the true joints at every sample, with the covariance of their errors: q_true = q exp(d)
Source  Kortier, thesis ch. 2: state (2.3), (2.5); errors (2.15)-(2.22); his q^{ij} is our q_pc with i = p, j = c. Between updates the turns of the
        sensors are summed up with their change by the biases, as in Forster et al. 2017 (IEEE Trans Robot 33:1), exactly for piecewise constant rates.
        Ours: seats (sensor against segment) and skin (how far a seat turns as its joint bends) are estimated, where the thesis trusts a calibration
Limits  noise that is correlated in time is taken as white noise that is larger; the chains each know the hand's sensor for themselves
"""

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.finger_ekf import (
    inclination_noise,
    joint_compliance,
    magnetic_heading,
    preintegration,
    sensor_to_segment,
    zero_rate_update,
)
from handscope.estimators.finger_ekf import measurements as finger_ekf_measurements
from handscope.estimators.finger_ekf.magnetic_heading import MagnetometerParams
from handscope.estimators.finger_ekf.measurements import IS_FREE, LIMITS, RATE_GATE, UpdateParams
from handscope.estimators.finger_ekf.preintegration import MAG_ERROR
from handscope.estimators.finger_ekf.sensor_to_segment import (
    FIELD_DIFFERENCE,
    SIZE,
    SensorToSegmentParams,
    SensorToSegmentPrior,
    inject_error,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import inlined, rowwise
from handscope.estimators.numerics.kalman import correct
from handscope.estimators.numerics.small_matrices import put, spread
from handscope.estimators.numerics.typing import Array, Bools, Indices

UPDATED = (  # fields of a state that an update changes, in the order of its kernel
    *("q_pc", "bias", "q_SB", "soft_tissue_gain", "field_difference", "P", "up", "rest_time"),
    *("rest_rotation", "previous_rest_rate", "rest_rate_scatter", "mean_square_rate"),
    *("initial_vertical", "current_vertical", "compliance_stats"),
)
MUCH = math.radians(0.5) ** 2  # rad^2 that a sensor may have missed since the update


@dataclass(frozen=True, kw_only=True)
class FilterParams(UpdateParams, SensorToSegmentParams, MagnetometerParams):
    update: float = option(
        0.2,
        "s",
        "time between two updates; the gyroscopes count at every sample",
        "ours: what they correct is slower",
        least=0.01,
    )
    gyr_noise: float = option(
        0.03,
        "deg/s/sqrt(Hz)",
        "white noise density of a gyroscope axis",
        "LSM330DLC data sheet; Kortier's Table 2.1 has 5e-4 rad/s at 200 Hz, a tenth of it",
        least=1e-6,
    )
    gyr_scale: float = option(
        0.003,
        "1",
        "scale error of a gyroscope axis",
        "ours: left after a calibration on a turntable",
    )
    bias_walk: float = option(
        0.001,
        "deg/s/sqrt(s)",
        "random walk of a gyroscope's bias",
        "ours: consumer MEMS, 10 deg/h; Kortier's Table 2.1 has 1e-4 rad/s",
    )
    bias_sd: float = option(
        0.01,
        "deg/s",
        "what the pose leaves of a gyroscope's bias beside what its samples' scatter tells: turning that is the same all the time",
        "0.009 fits 16 sensors on a person who stands still best (qmt's full-body example): docs/decisions/0009-sizes-of-errors.md",
        least=1e-6,
    )


@dataclass(frozen=True)
class Samples:
    """Aligned samples of F chains."""

    t: Array  # (n,) s
    turn: Array  # (n, F, 4, 3) rad, rotation since the sample before as a vector in the sensor's frame; 0 where nothing is known
    bias_time: Array  # (n, F, 4) s of the gyroscope's bias that is in `turn`
    acc: Array  # (n, F, 4, 3) m/s^2, specific force, or gravity as the sensor's own fusion sees it; NaN where it must not be used
    rotation_variance: Array  # (n, F, 4) rad^2, variance of what `turn` may have missed
    known: Bools  # (n, F, 3) both segments of the joint are measured
    q_first: Array  # (n, F, 3, 4) q_pc to start a joint from that was not known before
    mag: Array | None = (
        None  # (n, F, 2, 3) uT, fields at the chain's first and last sensor, NaN where not known; None: not asked for
    )

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True)
class State:
    """Everything the next step needs: save it, copy it, start again from it."""

    q_pc: Array  # (F, 3, 4) between the frames of two sensors, at the newest update
    bias: Array  # (F, 4, 3) rad/s
    q_SB: Array  # (F, 4, 4) takes vectors from the segment to its sensor's frame while the joint is straight
    soft_tissue_gain: Array  # (F, 3, 3) rad per rad of the joint's flexion that the child's sensor turns by on its segment
    field_difference: Array  # (F, 2) uT by which the field at the chain's end differs from that at its beginning, across it; how often that was unlikely
    P: Array  # (F, 43, 43) covariance of the errors [dth_1..3, db_1..4, dm_1..4, dk_1..3, da] of the five above, q_true = q exp(dth), m alike
    known: Bools  # (F, 3) the joint has a rotation
    free: Bools  # (F, 3, 3) the joint has flexion, deviation, pronation
    limits: Array  # (F, 3, 3, 2) rad
    prior: SensorToSegmentPrior  # before they moved
    t: float  # s, newest update; -inf before the first sample
    newest: float  # s, newest sample
    delta_q: Array  # (F, 4, 4) what the sensors have turned by since the update
    J_bias: Array  # (F, 4, 3, 3) how that changes with their biases: T(b + db) = T exp(J db)
    bias_time: Array  # (F, 4) s of the biases that is in it
    rotation_variance: Array  # (F, 4) rad^2, variance of what it may have missed
    rest_time: Array  # (F, 4) s, how long each sensor has hardly turned
    rest_rotation: (
        Array  # (F, 4, 3) rad that it has seemed to turn by in that time, its bias included
    )
    previous_rest_rate: Array  # (F, 4, 3) rad/s, so at the rest before; NaN before the first
    rest_rate_scatter: (
        Array  # (F, 2) half the squared differences between such rates, (rad/s)^2, and their number
    )
    up: Array  # (F, 4, 3) the vertical over a long time, zero where not known
    mean_square_rate: (
        Array  # (F, 4) (rad/s)^2, rates squared over the time that errors of the vertical last
    )
    initial_vertical: Array  # (F, 4, 3) the vertical at first, zero where not known
    current_vertical: Array  # (F, 4, 3) the vertical over the time that its errors last
    compliance_stats: Array  # (F, 3, 2) what the joints have seemed to give, rad^2, weighted, and the sum of the weights


@dataclass(frozen=True)
class Estimate:
    q_joint: Array  # (n, F, 3, 4) rotations of the true joints
    update_rows: Indices  # (u,) rows from which on a covariance holds
    P: Array  # (u, F, 9, 9) rad^2, of the three joints' errors


def start(
    bias_sd: Array,
    prior: SensorToSegmentPrior,
    free: Bools = IS_FREE,
    limits: Array = LIMITS,
    field_difference_sd: float = 0.0,
) -> State:
    """Nothing known but the size of the biases, bias_sd (F, 4) rad/s, how sensors may sit and by what (uT) fields may differ; the first sample with a
    joint's two segments starts it."""
    chains = len(free)
    P = np.zeros((chains, SIZE, SIZE))
    P[:, range(9, 21), range(9, 21)] = np.repeat(bias_sd**2, 3, axis=1)
    P[:, FIELD_DIFFERENCE, FIELD_DIFFERENCE] = field_difference_sd**2
    q_pc, still = np.tile(quat.IDENTITY, (chains, 3, 1)), _identity_rotations(chains)
    known, nothing = np.zeros((chains, 3), bool), np.zeros((chains, 4, 3))
    ended = (-np.inf, -np.inf, still, *_zero_window(chains))
    return State(
        q_pc,
        nothing,
        still,
        np.zeros((chains, 3, 3)),
        np.zeros((chains, 2)),
        P,
        known,
        free,
        limits,
        prior,
        *ended,
        np.zeros((chains, 4)),
        nothing,
        np.full((chains, 4, 3), np.nan),
        np.zeros((chains, 2)),
        nothing,
        np.zeros((chains, 4)),
        nothing,
        nothing,
        np.zeros((chains, 3, 2)),
    )


def step(params: FilterParams, state: State, samples: Samples) -> tuple[State, Estimate]:
    """Advance by samples of any number, 0 included: nothing depends on where they are cut."""
    kernel_params, update_rows, P, first = _pack_params(params), [], [], 0
    q_joint, known = np.empty((len(samples), *state.q_pc.shape)), samples.known.astype(float)
    while first < len(samples):
        last, closes = _find_window_end(
            state.t + params.update - 1e-9,
            first,
            samples.t,
            samples.rotation_variance,
            state.rotation_variance,
            known,
            state.known,
        )
        if last == first:
            state = _start_joints(params, kernel_params, state, samples, first)
            update_rows.append(first)
            P.append(
                _joint_covariance(
                    state.q_pc, state.q_SB, state.soft_tissue_gain, state.P, np.zeros(9)
                )
            )
            continue
        state, q_joint[first : int(last)] = _accumulate(state, samples, first, int(last))
        first = int(last)
        if closes:
            mag = (
                np.full((len(state.q_pc), 2, 3), np.nan)
                if samples.mag is None
                else samples.mag[first - 1]
            )
            state, q_joint[first - 1], P_joints = _close_window(
                kernel_params, state, samples.acc[first - 1], mag
            )
            update_rows.append(first - 1)
            P.append(P_joints)
    return state, Estimate(
        q_joint, np.array(update_rows, np.intp), np.array(P).reshape(-1, len(state.q_pc), 9, 9)
    )


@rowwise("(),(),(n),(n,f,s),(f,s),(n,f,j),(f,j)->(),()")
def _find_window_end(
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
    """From row `first` up to which row the window goes on before it closes or a joint appears or goes, and whether it closes with the last of them.

    It closes at once where much may have been missed: the covariance must not tell for the rest of the window what was known before.
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
                ends = ends or missed_variance[f, s] > MUCH
        if ends or not same_joints:
            last[0], closes[0] = (k + 1, 1.0) if same_joints else (k, 0.0)
            break


def _accumulate(state: State, samples: Samples, first: int, last: int) -> tuple[State, Array]:
    """Add the turns of rows first..last to the open window; the true joints after each of them (rows, F, 3, 4)."""
    turn, bias_time, rotation_variance = (
        x[first:last].swapaxes(0, 1)
        for x in (samples.turn, samples.bias_time, samples.rotation_variance)
    )
    window = state.delta_q, state.J_bias, state.bias_time, state.rotation_variance
    q_joint, *grown = _extend_window(
        turn,
        bias_time,
        rotation_variance,
        state.bias,
        *window,
        state.q_pc,
        state.q_SB,
        state.soft_tissue_gain,
    )
    ended = dict(zip(("delta_q", "J_bias", "bias_time", "rotation_variance"), grown))
    return replace(state, newest=float(samples.t[last - 1]), **ended), q_joint.swapaxes(0, 1)


def _close_window(
    kernel_params: Array, state: State, acc: Array, mag: Array
) -> tuple[State, Array, Array]:
    """The window's end becomes the state, a new window opens; what sensors and joints tell at that end (2.15); the true joints (F, 3, 4) now, the
    covariance (F, 9, 9) of their errors as the joints were seen before."""
    window = (
        _span(state),
        state.delta_q,
        state.J_bias,
        state.bias_time,
        state.rotation_variance,
        acc,
        mag,
    )
    *found, q_joint, P_joints = _update_chain(
        kernel_params,
        *window,
        state.known,
        state.free,
        state.limits,
        *(getattr(state, name) for name in UPDATED),
        np.zeros(9),
    )
    return replace(state, **_open_window(state), **dict(zip(UPDATED, found))), q_joint, P_joints


@rowwise(
    "(n,s,v),(n,s),(n,s),(s,v),(s,q),(s,v,v),(s),(s),(j,q),(s,q),(j,v)->(n,j,q),(s,q),(s,v,v),(s),(s)"
)
def _extend_window(
    turn: Array, time: Array, added_variance: Array, bias: Array, delta_q: Array, J_bias: Array, bias_time: Array, rotation_variance: Array,
    q_pc: Array, q_SB: Array, soft_tissue_gain: Array,
    q_joint: Array, T: Array, J: Array, time_new: Array, variance_new: Array,
) -> None:  # fmt: skip
    """The window goes on over all rows; where the joints are after each of them."""
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
    """Magnetometers of hand and tip, where they are asked for, both sensors have all their samples and neither turns fast."""
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
def _update_chain(
    p: Array, span: float, delta_q: Array, J_bias: Array, bias_time: Array, rotation_variance: Array, acc: Array, mag: Array,
    known: Array, free: Array, limits: Array,
    q_pc: Array, bias: Array, q_SB: Array, soft_tissue_gain: Array, field_difference: Array, P: Array, up: Array, rest_time: Array, rest_rotation: Array,
    previous_rest_rate: Array, rest_rate_scatter: Array, mean_square_rate: Array, initial_vertical: Array, current_vertical: Array, compliance_stats: Array, row: Array,
    q_pc_new: Array, bias_new: Array, q_SB_new: Array, soft_tissue_gain_new: Array, field_difference_new: Array, P_new: Array, up_new: Array, rest_time_new: Array,
    rest_rotation_new: Array, previous_rest_rate_new: Array, rest_rate_scatter_new: Array, mean_square_rate_new: Array, initial_vertical_new: Array, current_vertical_new: Array, compliance_stats_new: Array, q_true: Array, P_joints: Array,
) -> None:  # fmt: skip
    """A window's end: the vertical as neighbours see it and what joints cannot do, then the biases of sensors at rest."""
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
    for s in range(4):  # what opens now has not turned
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
def _joint_covariance(
    q_pc: Array, q_SB: Array, soft_tissue_gain: Array, P: Array, row: Array, P_joints: Array
) -> None:
    """That of the true joints' errors."""
    q_joint, A = np.empty((3, 4)), np.zeros((9, SIZE))
    sensor_to_segment.joint_jacobian_row(
        q_pc.copy(), q_SB.copy(), soft_tissue_gain.copy(), q_joint, A
    )
    spread(A, P.copy(), P_joints)


def _span(state: State) -> float:
    """Seconds since the newest update, 0 before the first."""
    return state.newest - state.t if np.isfinite(state.t) else 0.0


def _start_joints(
    params: FilterParams, kernel_params: Array, state: State, samples: Samples, row: int
) -> State:
    """Joints that were not known before begin where the samples put them, as sure as a pose leaves them; the open window is settled first."""
    if state.newest > state.t:
        state = _commit_window(kernel_params, state)
    fresh = samples.known[row] & ~state.known
    q_pc, P = np.where(fresh[..., None], samples.q_first[row], state.q_pc), state.P.copy()
    posed = sensor_to_segment.covariance_after_pose(
        params, q_pc, np.nan_to_num(samples.acc[row]), state.free, state.prior
    )
    for f in np.flatnonzero(fresh.any(axis=1)):
        own = _error_rows(fresh[f], first=bool(not state.known[f].any()))
        P[np.ix_([f], own, np.arange(SIZE))] = 0.0
        P[np.ix_([f], np.arange(SIZE), own)] = 0.0
        P[np.ix_([f], own, own)] = posed[np.ix_([f], own, own)]
    return replace(state, q_pc=q_pc, P=P, known=samples.known[row].copy())


def _error_rows(fresh: Bools, first: bool) -> Indices:
    """Error states of the joints that begin: their rotations, seats and skins; the chain's first seat with the first of them."""
    own = np.concatenate([fresh, np.zeros(4, bool), [first], fresh, fresh])
    return np.flatnonzero(np.repeat(own, 3))


def _commit_window(kernel_params: Array, state: State) -> State:
    """The open window's end becomes the state; the covariance goes along."""
    q_pc, P = preintegration.propagate(
        kernel_params,
        _span(state),
        state.delta_q,
        state.J_bias,
        state.rotation_variance,
        state.q_pc,
        state.P,
    )
    field_difference = np.stack(
        [
            state.field_difference[:, 0]
            * preintegration.field_correlation(kernel_params, state.delta_q),
            state.field_difference[:, 1],
        ],
        axis=1,
    )
    return replace(state, **_open_window(state), q_pc=q_pc, field_difference=field_difference, P=P)


def _open_window(state: State) -> dict[str, Any]:
    """A new window begins with the newest sample."""
    J_bias, bias_time, rotation_variance = _zero_window(len(state.q_pc))
    return {
        "t": state.newest,
        "delta_q": _identity_rotations(len(state.q_pc)),
        "J_bias": J_bias,
        "bias_time": bias_time,
        "rotation_variance": rotation_variance,
    }


def _identity_rotations(chains: int) -> Array:
    """Sensors that have not turned (F, 4, 4)."""
    delta_q = np.zeros((chains, 4, 4))
    delta_q[..., 0] = 1.0
    return delta_q


def _zero_window(chains: int) -> tuple[Array, Array, Array]:
    return np.zeros((chains, 4, 3, 3)), np.zeros((chains, 4)), np.zeros((chains, 4))


@cache
def _pack_params(params: FilterParams) -> Array:
    """Options as the kernels take them."""
    of_gyr = np.radians(params.gyr_noise), params.gyr_scale, np.radians(params.bias_walk)
    return np.concatenate(
        [finger_ekf_measurements.pack_params(params), of_gyr, magnetic_heading.pack_params(params)]
    )
