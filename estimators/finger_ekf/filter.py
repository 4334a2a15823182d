"""Error-state Kalman filter of each finger: joint rotations, gyroscope biases, sensor mounting.

In      rotations of the four sensors of a chain since the previous sample (finger: hand, proximal, middle, distal; wrist: forearm and hand) and their vertical, in sensor frames that the calibration has aligned with the segments
Out     joint rotations at every sample with the covariance of their errors d: q_true = q exp(d)
Source  Kortier, thesis ch. 2: state (2.3), (2.5); errors (2.15)-(2.22); his q^{ij} is our q_pc with
        i = p, j = c. Between updates the sensors' rotations are preintegrated with their derivatives by the biases (Forster et al. 2017, IEEE Trans Robot 33:1), exactly for piecewise constant rates. Ours: the sensor-to-segment rotation q_SB and the soft-tissue gain are estimated, where the thesis trusts a calibration
Limits  time-correlated noise is modelled as larger white noise; every chain estimates the hand's sensor for itself; of its bias the thumb's, of its mounting also the wrist's gets what the fingers have gained (between_chains/)
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import TypeVar

import numpy as np

from handscope.estimators.data.mounting_change import MountingChange
from handscope.estimators.data.options import option
from handscope.estimators.finger_ekf import mean_rest, mounting_change, sensor_to_segment
from handscope.estimators.finger_ekf.between_chains import hand_bias, hand_mounting
from handscope.estimators.finger_ekf.between_chains.chain_estimates import Estimates
from handscope.estimators.finger_ekf.chain_state import ChainState, Joints, Window
from handscope.estimators.finger_ekf.joint_acceleration import block_sums, heading_update
from handscope.estimators.finger_ekf.joint_acceleration.block_sums import Readings
from handscope.estimators.finger_ekf.joint_acceleration.heading_update import (
    JointAcceleration,
    Noise,
)
from handscope.estimators.finger_ekf.kernel_params import KernelParams
from handscope.estimators.finger_ekf.magnetic_heading import MagnetometerParams
from handscope.estimators.finger_ekf.measurements import IS_FREE, LIMITS, UpdateParams
from handscope.estimators.finger_ekf.samples import Samples
from handscope.estimators.finger_ekf.sensor_to_segment import (
    ERROR,
    SIZE,
    SensorToSegmentParams,
    SensorToSegmentPrior,
)
from handscope.estimators.finger_ekf.update_kernels import (
    MAX_GAP_VARIANCE,
    extend_windows,
    find_window_end,
    joint_covariance,
    propagate_chains,
    update_chains,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Bools, Indices

R = TypeVar("R", ChainState, Window)


@dataclass(frozen=True, kw_only=True)
class FilterParams(UpdateParams, SensorToSegmentParams, MagnetometerParams):
    """Options of the finger filter."""

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
    mounting_walk: float = option(
        0.05,
        "deg/sqrt(s)",
        "random walk of a sensor's turn on its segment about the two axes that a hinge does not bend about",
        "ours: docs/decisions/0030-a-mounting-that-walks.md",
        least=0.0,
    )
    bias_sd: float = option(
        0.01,
        "deg/s",
        "what the pose leaves of a gyroscope's bias beside what its samples' scatter tells: turning that is the same all the time",
        "0.009 fits 16 sensors on a person who stands still best (qmt's full-body example): docs/decisions/0009-sizes-of-errors.md",
        least=1e-6,
    )
    mounting_changes: bool = option(
        True,
        "",
        "notice a sensor that turns on its segment, and count its mounting as unknown by as much from then on",
        "ours: docs/decisions/0018-turned-sensors.md",
    )
    shared_bias: bool = option(
        True,
        "",
        "tell the thumb's filter what those of the other fingers learn of the bias of the hand's gyroscope",
        "ours: docs/decisions/0015-drift-of-the-thumbs-base.md",
    )
    shared_mounting: bool = option(
        True,
        "",
        "tell the filters of thumb and wrist what those of the other fingers learn of how the hand's sensor sits",
        "ours: docs/decisions/0021-shared-mounting.md",
    )
    joint_acceleration: bool = option(
        True,
        "",
        "hold the thumb's heading against the hand by the acceleration that both feel at their joint",
        "Kok et al. 2014; Weygers & Kok 2020; ours: docs/decisions/0025-accelerations-at-the-thumbs-base.md",
    )
    joint_acceleration_noise: float = option(
        0.05,
        "m/s^2/sqrt(Hz)",
        "how much these accelerations differ, beyond what lever arms, biases and scales explain; more where a recording shows more",
        "ours: docs/decisions/0025-accelerations-at-the-thumbs-base.md",
        least=1e-4,
    )


@dataclass(frozen=True)
class State:
    """Everything the next step needs."""

    q_pc: Array  # (F, 3, 4) between the frames of two sensors, at the newest update
    bias: Array  # (F, 4, 3) rad/s
    # (F, 4, 4) segment to sensor while the joint is straight
    q_SB: Array
    # (F, 3, 3) rotation of the child's sensor on its segment, rad per rad of flexion
    soft_tissue_gain: Array
    # (F, 2) horizontal difference of the fields at tip and hand, uT; share of rejected readings
    field_difference: Array
    # (F, 43, 43) covariance of the errors [dth_1..3, db_1..4, dm_1..4, dk_1..3, da] of the five above, q_true = q exp(dth), q_SB likewise
    P: Array
    known: Bools  # (F, 3) the joint has a rotation
    free: Bools  # (F, 3, 3) the joint has flexion, deviation, pronation
    limits: Array  # (F, 3, 3, 2) rad
    prior: SensorToSegmentPrior  # of q_SB
    t: float  # s, newest update; -inf before the first sample
    newest: float  # s, newest sample
    delta_q: Array  # (F, 4, 4) rotation of each sensor since the update
    J_bias: Array  # (F, 4, 3, 3) its derivative by the bias: T(b + db) = T exp(J db)
    bias_time: Array  # (F, 4) s, time over which the biases are in it
    rotation_variance: Array  # (F, 4) rad^2, variance from gaps
    rest_time: Array  # (F, 4) s, time at rest so far
    # (F, 4, 3) rad, rotation in that time, bias included
    rest_rotation: Array
    previous_rest_rate: (
        Array  # (F, 4, 3) rad/s, mean rate of the previous rest; NaN before the first
    )
    # (F, 2) half the squared differences of successive rest rates, (rad/s)^2, and their number
    rest_rate_scatter: Array
    # (F, 4) s, since when the chain stays where it is; begin of the window, its newest sample (NaN: none), halves of short windows in it
    stay_clock: Array
    stay_rotation: Array  # (F, 4, 4) of the sensors since the window began, biases included
    stay_time: Array  # (F, 4) s of it in which the bias is; -inf: seen at rest meanwhile
    stay_sums: Array  # (F, 4, 3, 3) rad/s, mean rates over the long window and the two short ones
    up: Array  # (F, 4, 3) vertical, low-passed over SETTLED, zero where unknown
    # (F, 4) (rad/s)^2, squared rate, low-passed over the correlation time of the vertical's errors
    mean_square_rate: Array
    initial_vertical: Array  # (F, 4, 3) first vertical, zero where unknown
    current_vertical: (
        Array  # (F, 4, 3) vertical, low-passed over the correlation time of its errors
    )
    # (F, 3, 2) weighted squared residuals of the forbidden axes, rad^2, and the sum of weights
    compliance_stats: Array
    reference_compliance: Array  # (F, 3, 2) the same as it was before a step that is looked for
    # (F, 4, 3) rad^-1 and (F, 4, 3, 3) rad^-2, of a step in each sensor's mounting, since the last block
    mounting_score: Array
    mounting_information: Array
    is_hand: bool = False  # the chains are the thumb, the four fingers and the wrist of one hand
    reported: hand_bias.Reported | None = None  # None: nothing yet
    shared_mounting: hand_mounting.Shared | None = None  # None: nothing yet
    joint_acceleration: JointAcceleration | None = None  # None: nothing yet
    history: mounting_change.History | None = None  # None: nothing yet
    mounting_changes: tuple[MountingChange, ...] = ()


@dataclass(frozen=True)
class Estimate:
    """Joint rotations of every finger with their covariance, rad^2."""

    q_joint: Array  # (n, F, 3, 4) rotations of the true joints
    update_rows: Indices  # (u,) rows from which each covariance holds
    P: Array  # (u, F, 9, 9) rad^2, of the three joints' errors


def start(
    bias_sd: Array,
    prior: SensorToSegmentPrior,
    free: Bools = IS_FREE,
    limits: Array = LIMITS,
    field_difference_sd: float = 0.0,
    is_hand: bool = False,
) -> State:
    """Initial state from bias_sd (F, 4) rad/s, the mounting prior and the sd (uT) of field differences. A joint starts at the first sample with both its segments."""
    chains = len(free)
    P = np.zeros((chains, SIZE, SIZE))
    of_bias = range(ERROR.bias, ERROR.q_SB)
    P[:, of_bias, of_bias] = np.repeat(bias_sd**2, 3, axis=1)
    P[:, ERROR.field_difference, ERROR.field_difference] = field_difference_sd**2
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
        np.full((chains, 4), np.nan),
        still,
        np.zeros((chains, 4)),
        np.zeros((chains, 4, 3, 3)),
        nothing,
        np.zeros((chains, 4)),
        nothing,
        nothing,
        np.zeros((chains, 3, 2)),
        np.zeros((chains, 3, 2)),
        np.zeros((chains, 4, 3)),
        np.zeros((chains, 4, 3, 3)),
        is_hand,
    )


def step(params: FilterParams, state: State, samples: Samples) -> tuple[State, Estimate]:
    """Advance by any number of samples, 0 included; the result does not depend on how they are cut."""
    kernel_params, update_rows, P, first = pack_params(params), [], [], 0
    q_joint, known = np.empty((len(samples), *state.q_pc.shape)), samples.known.astype(float)
    state = _owned(state)
    while first < len(samples):
        last, closes = find_window_end(
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
                joint_covariance(
                    state.q_pc, state.q_SB, state.soft_tissue_gain, state.P, np.zeros(9)
                )
            )
            continue
        _accumulate(kernel_params, state, samples, slice(first, int(last)), q_joint)
        if (block := state.joint_acceleration) is not None and samples.at_joint is not None:
            at_joint = _rows(samples.at_joint, slice(first, int(last)))
            block_sums.accumulate(at_joint, block.unknowns, block.sums)
        first = int(last)
        newest = float(samples.t[first - 1])
        if not closes:
            state = replace(state, newest=newest)
            continue
        state = _interrupt_after_gap(state)
        if state.history is not None:
            history = mounting_change.count_missed(state.history, state.rotation_variance)
            state = replace(state, history=history)
        P.append(_close_window(kernel_params, state, samples, first - 1, q_joint))
        update_rows.append(first - 1)
        state = replace(state, newest=newest, t=newest)
        if params.shared_bias and state.is_hand:
            state = _share_bias(params, state)
        if params.shared_mounting and state.is_hand:
            state = _share_mounting(params, state)
        if samples.at_joint is not None and state.is_hand:
            state = _hold_thumb(params, state, _rows(samples.at_joint, slice(first - 1, first)))
        if params.mounting_changes and state.is_hand:
            state = _look_for_mounting_change(state)
    return state, Estimate(
        q_joint, np.array(update_rows, np.intp), np.array(P).reshape(-1, len(state.q_pc), 9, 9)
    )


def _owned(state: State) -> State:
    """With arrays of its own, contiguous floats, where kernels fill arrays: what they write does not reach the state that `step` was given."""
    window, chains = Window(*_copies(state, Window)), ChainState(*_copies(state, ChainState))
    block = state.joint_acceleration
    return replace(
        state,
        **window._asdict(),
        **chains._asdict(),
        joint_acceleration=None if block is None else heading_update.copied(block),
    )


def _accumulate(
    kernel_params: KernelParams, state: State, samples: Samples, rows: slice, q_joint: Array
) -> None:
    """Add rows to the open windows in place, and fill the joints (n, F, 3, 4) after each row."""
    t, turn, bias_time, variance = (
        np.ascontiguousarray(x[rows])
        for x in (samples.t, samples.turn, samples.bias_time, samples.rotation_variance)
    )
    mean_rest.accumulate(t, turn, bias_time, kernel_params.rest_rate, _of(state, ChainState))
    extend_windows(
        turn,
        bias_time,
        variance,
        state.bias,
        state.q_pc,
        state.q_SB,
        state.soft_tissue_gain,
        _of(state, Window),
        q_joint[rows],
    )


def _close_window(
    kernel_params: KernelParams, state: State, samples: Samples, row: int, q_joint: Array
) -> Array:
    """Propagate to the window's end, update (2.15) and open a new window, in place; fill the joints of the row. Returns the covariance (F, 9, 9) of their errors."""
    chains = len(state.q_pc)
    P_joints, window = np.empty((chains, 9, 9)), _of(state, Window)
    mag = np.full((chains, 2, 3), np.nan) if samples.mag is None else samples.mag[row]
    update_chains(
        kernel_params,
        _span(state, float(samples.t[row])),
        window,
        np.ascontiguousarray(samples.acc[row]),
        np.ascontiguousarray(mag),
        Joints(*_copies(state, Joints)),
        _of(state, ChainState),
        q_joint[row],
        P_joints,
    )
    _empty_window(window)
    return P_joints


def _share_bias(params: FilterParams, state: State) -> State:
    """Tell the thumb's chain what the fingers have learnt of the hand's gyroscope, if it is time."""
    reported = state.reported
    if reported is not None and state.t - reported.t < hand_bias.EVERY - 1e-9:
        return state
    now = hand_bias.ask(state.t, state.bias, state.P, state.previous_rest_rate)
    state = replace(state, reported=now)
    if reported is None:
        return state
    gained = hand_bias.gained(reported, now, np.radians(params.bias_walk))
    chains = Estimates(*_copies(state, Estimates))
    thumb = Estimates(*(of_all[hand_bias.THUMB] for of_all in chains))
    for of_all, of_thumb in zip(chains, hand_bias.corrected(thumb, *gained)):
        of_all[hand_bias.THUMB] = of_thumb
    return replace(state, **chains._asdict())


def _share_mounting(params: FilterParams, state: State) -> State:
    """Tell the thumb's and the wrist's chain what the fingers have learnt of the hand's mounting, if it is time."""
    shared = state.shared_mounting
    if shared is None:
        return replace(state, shared_mounting=hand_mounting.begin(state.t, state.q_SB, state.P))
    if state.t - shared.t < hand_mounting.EVERY - 1e-9:
        return state
    shared = hand_mounting.aged(shared, state.t, np.radians(params.mounting_walk))
    found = hand_mounting.gained_since(
        shared, state.q_SB, state.P, state.known, np.radians(params.dimension_noise)
    )
    chains = Estimates(*_copies(state, Estimates))
    for k, (chain, _) in enumerate(hand_mounting.RECEIVERS):
        if state.known[chain, 0]:
            own = Estimates(*(of_all[chain] for of_all in chains))
            shared, own = hand_mounting.report(shared, state.t, k, own, *found)
            for of_all, of_own in zip(chains, own):
                of_all[chain] = of_own
    return replace(state, shared_mounting=shared._replace(t=state.t), **chains._asdict())


def _rows(readings: Readings, part: slice) -> Readings:
    """Some of the rows, as kernels take them."""
    return Readings(*(np.ascontiguousarray(of_rows[part]) for of_rows in readings))


def _interrupt_after_gap(state: State) -> State:
    """No block of accelerations goes over a gap that has cost a fusion its heading."""
    block = state.joint_acceleration
    if block is None or state.rotation_variance[hand_bias.THUMB, :2].max() <= MAX_GAP_VARIANCE:
        return state
    return replace(state, joint_acceleration=heading_update.interrupted(block))


def _hold_thumb(params: FilterParams, state: State, newest: Readings) -> State:
    """Correct the heading of the thumb's metacarpal by a block of accelerations, if one is over, and begin the next."""
    block, thumb, q_EB = state.joint_acceleration, hand_bias.THUMB, newest.q_EB[0]
    if not state.known[thumb, 0] or not np.isfinite(q_EB).all():
        return state
    if block is not None and state.t - block.begun < heading_update.EVERY - 1e-9:
        return state
    if block is not None:
        up = state.up[thumb, 1]
        chains = Estimates(*_copies(state, Estimates))
        own = Estimates(*(of_all[thumb] for of_all in chains))
        block, corrected = heading_update.close(
            Noise(params.joint_acceleration_noise, params.correlation),
            block,
            own,
            up,
            q_EB,
            state.t,
        )
        for of_all, of_thumb in zip(chains, corrected):
            of_all[thumb] = of_thumb
        state = replace(state, **chains._asdict())
    begun = heading_update.begin(state.t, state.q_pc[thumb, 0], q_EB, block)
    return replace(state, joint_acceleration=begun)


def _look_for_mounting_change(state: State) -> State:
    """Close a block of what tells of turned sensors, if it is time, and widen the mounting of one that has turned."""
    history = state.history
    if history is None:
        return replace(state, history=mounting_change.begin(state.t))
    if state.t < history.end + mounting_change.BLOCK - 1e-9:
        return state
    history = mounting_change.extend(
        history,
        state.t,
        state.mounting_score,
        state.mounting_information,
        state.compliance_stats,
    )
    before, change = mounting_change.compliance_before(history), mounting_change.find(history)
    state = replace(
        state,
        history=history,
        reference_compliance=before,
        mounting_score=np.zeros_like(state.mounting_score),
        mounting_information=np.zeros_like(state.mounting_information),
    )
    if change is None:
        return state
    return replace(
        state,
        P=mounting_change.widen(change, state.P),
        compliance_stats=before.copy(),
        shared_mounting=None,  # what the fingers know from now on
        history=mounting_change.begin(state.t),
        mounting_changes=(*state.mounting_changes, change),
    )


def _copies(
    state: State, record: type[ChainState | Joints | Window | Estimates]
) -> Iterator[Array]:
    """Copies of the state's arrays that a record has, as contiguous floats: what a kernel writes does not reach the state."""
    return (np.array(getattr(state, name), float, order="C") for name in record._fields)


def _of(state: State, record: type[R]) -> R:
    """The state's arrays that a record has."""
    return record(*(getattr(state, name) for name in record._fields))


def _span(state: State, newest: float) -> float:
    """Seconds since the newest update, 0 before the first."""
    return newest - state.t if np.isfinite(state.t) else 0.0


def _start_joints(
    params: FilterParams, kernel_params: KernelParams, state: State, samples: Samples, row: int
) -> State:
    """Start joints that are new in this row, with the covariance that a pose leaves; the open window is committed first."""
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
    block = state.joint_acceleration
    state = replace(
        state,
        q_pc=q_pc,
        P=P,
        known=samples.known[row].copy(),
        shared_mounting=None,
        joint_acceleration=None if block is None else heading_update.interrupted(block),
    )
    return _owned(state)


def _error_rows(fresh: Bools, first: bool) -> Indices:
    """Error states of new joints: rotation, q_SB and soft-tissue gain; the chain's first q_SB with the first joint."""
    own = np.concatenate([fresh, np.zeros(4, bool), [first], fresh, fresh])
    return np.flatnonzero(np.repeat(own, 3))


def _commit_window(kernel_params: KernelParams, state: State) -> State:
    """Propagate state and covariance, in place, to the end of the open window."""
    window = _of(state, Window)
    propagate_chains(kernel_params, _span(state, state.newest), window, _of(state, ChainState))
    _empty_window(window)
    return replace(state, t=state.newest)


def _empty_window(window: Window) -> None:
    """A new window begins without rotation."""
    window.delta_q[...] = quat.IDENTITY
    for of_window in (window.J_bias, window.bias_time, window.rotation_variance):
        of_window[...] = 0.0


def _identity_rotations(chains: int) -> Array:
    """Identity rotations of the sensors (F, 4, 4)."""
    delta_q = np.zeros((chains, 4, 4))
    delta_q[..., 0] = 1.0
    return delta_q


def _zero_window(chains: int) -> tuple[Array, Array, Array]:
    return np.zeros((chains, 4, 3, 3)), np.zeros((chains, 4)), np.zeros((chains, 4))


@cache
def pack_params(params: FilterParams) -> KernelParams:
    """Options as the kernels take them; every number is a float, for which they are translated."""
    numbers = {
        "inclination": np.radians(params.inclination),
        "inclination_time": params.inclination_time,
        "acc_noise": params.acc_noise,
        "acc_error": params.acc_error,
        "acc_gate": params.acc_gate,
        "rate_gate": params.rate_gate,
        "lever": params.lever,
        "dimension_noise": np.radians(params.dimension_noise),
        "correlation": params.correlation,
        "rest_rate": np.radians(params.rest_rate),
        "creeping": np.radians(params.creeping),
        "inclination_by_rate": params.inclination_by_rate,
        "acc_bias": params.acc_bias,
        "gyr_noise": np.radians(params.gyr_noise),
        "gyr_scale": params.gyr_scale,
        "bias_walk": np.radians(params.bias_walk),
        "mounting_walk": np.radians(params.mounting_walk),
        "mag_noise": params.mag_noise,
        "mag_error": params.mag_error if params.magnetometers else 0.0,
        "mag_gate": params.mag_gate,
    }
    return KernelParams(
        fused=params.vertical == "fused",
        dimensions=params.dimensions,
        **{name: float(number) for name, number in numbers.items()},
    )
