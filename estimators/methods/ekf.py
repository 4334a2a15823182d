"""EKF: an error-state filter for each finger, with standard deviations; the mounting is estimated while the hand moves.

In      inertial blocks of any subset of sensors, a Calibration from the initial pose, or from that
        and the movements of a functional calibration
Out     Trajectory: joint angles, segment orientations, fingertips in the wrist frame, with the
        standard deviations of angles and tips
Source  Kortier, thesis ch. 2, finger filter (2.3)-(2.32); vertical of each sensor: VQF, Laidig & Seel 2023; mounting and soft tissue: sensor_to_segment.py, ours
Limits  the hand's own orientation is that of its fusion; a sensor whose samples are not at the
        instants of the rows (another rate or clock) counts by its orientation from the fusion,
        interpolated; standard deviations are those of the newest update, up to 0.2 s ago
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.alignment import accelerometer_bias, functional_movements
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.contact_constraint import ContactParams
from handscope.estimators.data.held_contact import ContactOutcome
from handscope.estimators.data.mounting_change import MountingChange
from handscope.estimators.data.options import option
from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.data.trajectory import Flag, Trajectory, empty, join
from handscope.estimators.finger_ekf import filter as finger_ekf_filter
from handscope.estimators.finger_ekf import (
    output_covariance,
    sample_alignment,
)
from handscope.estimators.finger_ekf.filter import FilterParams
from handscope.estimators.finger_ekf.mounting_change import SENSORS
from handscope.estimators.finger_ekf.output_covariance import JOINTS_OF
from handscope.estimators.finger_ekf.pose_error import bent_joints, pose_inference
from handscope.estimators.finger_ekf.samples import Samples
from handscope.estimators.finger_ekf.sensor_to_segment import SensorToSegmentPrior
from handscope.estimators.hand import joint_angles, length_covariance
from handscope.estimators.hand import pose as hand_pose
from handscope.estimators.hand.anatomy import FINGERS, JOINTS, SEGMENT, SEGMENTS
from handscope.estimators.hand.forward_kinematics import CHAIN_SEGMENTS
from handscope.estimators.hand.pose import Pose
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.methods import ekf_contacts
from handscope.estimators.methods.ekf_contacts import HandState, Pending
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import rowwise, rowwise_bool
from handscope.estimators.numerics.typing import Array, Bools
from handscope.estimators.orientation import fusion as orientation_fusion
from handscope.estimators.orientation import resampling
from handscope.estimators.pipeline.method import Capabilities
from handscope.estimators.sensors import magnetometer_resampling

TITLE = phrase("method_title.ekf")
CAPABILITIES = Capabilities(
    needs_pose=True,
    gives_covariance=True,
    notices_mounting_changes=True,
    uses_contacts=True,
    subtracts_acc_bias=True,
    couples_chains=True,
)
LOST, _FOREARM, _HAND = np.uint8(Flag.HEADING_LOST), SEGMENT["forearm"], SEGMENT["hand"]


@dataclass(frozen=True, kw_only=True)
class Params(
    FilterParams,
    orientation_fusion.FusionParams,
    functional_movements.FunctionalParams,
    ContactParams,
):
    """Options of EKF."""

    constraints: bool = option(
        True,
        "",
        "zero the angles that are no freedom of their joint and clip the rest to the permitted range",
        "Salchow-Hoemmen 2019, 2.4.3",
    )
    heading_known: float = option(
        10.0,
        "deg",
        "a joint of larger standard deviation counts as of lost heading",
        "ours, as in m2",
    )
    length_sd: float = option(
        0.03,
        "1",
        "how far a length of the hand that was not measured, or its share of one that was, may be from the model's; part of the tips' standard deviation",
        "Salchow-Hoemmen 2019, 5: ratios vary from subject to subject by a few percents; size ours",
    )


@dataclass(frozen=True)
class OutputUncertainty:
    """Output uncertainty between two updates."""

    angles_sd: Array  # (joints, 3) rad
    tips_sd: Array  # (5, 3) m
    lost: Bools  # (segments,) the heading is not known


@dataclass(frozen=True)
class State:
    """Everything the next step needs."""

    calibration: Calibration
    q_SB: Array  # (segments, 4) segment-to-sensor rotations
    sensors: Mapping[str, orientation_fusion.StreamState]  # by stream
    rows: resampling.State
    raw: sample_alignment.State  # samples that wait for their rows
    chains: finger_ekf_filter.State
    uncertainty: OutputUncertainty
    of_lengths: Array  # (5, 6, 6) covariance of the lengths: length_covariance.py
    magnetic: magnetometer_resampling.State | None = None  # None: magnetometers are not asked for
    contacts: tuple[Pending, ...] = ()  # still to be used
    contact_outcomes: tuple[ContactOutcome, ...] = ()


def start(params: Params, calibration: Calibration, streams: tuple[Stream, ...]) -> State:
    """Begin at the calibration's moment."""
    calibration, prior = _sensor_to_segment_prior(params, calibration)
    q_SB = np.tile(quat.IDENTITY, (len(SEGMENTS), 1))
    for name, q_BS in calibration.q_BS.items():
        q_SB[SEGMENT[name]] = quat.conjugate(q_BS)
    inertial = [s for s in streams if s.inertial]
    sensors = {
        s.name: _start_fusion(calibration, _inertial(s) if params.magnetometers else s)
        for s in inertial
    }
    magnetic, field_difference_sd = (
        (magnetometer_resampling.start(streams), math.sqrt(2) * params.mag_error)
        if params.magnetometers
        else (None, 0.0)
    )
    chains = finger_ekf_filter.start(
        _bias_sd(params, calibration)[SENSORS],
        prior,
        field_difference_sd=field_difference_sd,
        is_hand=True,
    )
    uncertainty = OutputUncertainty(
        np.full((len(JOINTS), 3), np.nan),
        np.full((len(FINGERS), 3), np.nan),
        np.zeros(len(SEGMENTS), bool),
    )
    return State(
        calibration,
        q_SB,
        sensors,
        resampling.start(inertial),
        sample_alignment.start(calibration, math.radians(params.gyr_noise)),
        chains,
        uncertainty,
        length_covariance.covariance(
            calibration.geometry, params.length_sd, calibration.lengths_sd
        ),
        magnetic,
        ekf_contacts.pending_contacts(params, calibration.contacts),
    )


def _bias_sd(params: Params, calibration: Calibration) -> Array:
    """What the pose leaves of each sensor's bias (segments,), rad/s: as its rates scatter in the
    pose, noise as well as swaying.

    Quarters of a second tell how well their mean is known where each errs for itself; of a hand
    that sways more slowly the farthest of three one-second means does.
    """
    qualities = [calibration.quality.get(s) for s in SEGMENTS]
    scatter = [
        max(q.rate_wander / 3.0, q.bias_sd or 0.0) if q else np.radians(params.pose_rate)
        for q in qualities
    ]
    return np.asarray(np.hypot(np.radians(params.bias_sd), scatter))


def _sensor_to_segment_prior(
    params: Params, calibration: Calibration
) -> tuple[Calibration, SensorToSegmentPrior]:
    """The calibration with what gravity tells of pose and mounting, and how well both are known: from a functional calibration, else by the options."""
    calibrated = [SEGMENT[s] for s in calibration.q_BS_sd]
    bent = bent_joints.find(params, calibration) if params.pose_inference else ()
    calibration = bent_joints.with_bent(calibration, bent)
    pose_sd, known = bent_joints.pose_angles_sd(params, calibration, bent)
    covariance = pose_inference.prior_covariance(params, calibration, pose_sd)
    if params.pose_inference and pose_inference.can_infer(calibration):
        calibration, covariance = pose_inference.infer(
            calibration,
            math.radians(params.misalignment),
            pose_sd,
            math.radians(params.angle_sd),
            known,
        )
    mountings = (3 * SENSORS[..., None] + np.arange(3)).reshape(len(SENSORS), 12)
    joints = (3 * JOINTS_OF.astype(int)[..., None] + np.arange(3)).reshape(len(SENSORS), 9)
    chains = np.concatenate([mountings, pose_inference.MOUNTINGS + joints], axis=1)
    aligned = np.array(
        [params.alignment != "heading" and k not in calibrated for k in range(len(SEGMENTS))]
    )
    return calibration, SensorToSegmentPrior(
        covariance[chains[:, :, None], chains[:, None, :]], aligned[SENSORS]
    )


def _start_fusion(calibration: Calibration, stream: Stream) -> orientation_fusion.StreamState:
    return orientation_fusion.start(
        stream,
        calibration.q_GS,
        calibration.gyr_bias,
        calibration.end,
        rate=calibration.rates.get(stream.name),
    )


def step(params: Params, state: State, *blocks: Block) -> tuple[State, Trajectory]:
    """Advance by blocks of any length, 0 included, of any streams; those of streams that the method
    does not use change nothing."""
    sound = [accelerometer_bias.subtract(b, state.calibration.acc_bias) for b in blocks]
    if state.magnetic is None:
        return _fuse(params, state, [b for b in sound if b.stream.inertial])
    magnetic, ready = magnetometer_resampling.step(state.magnetic, *sound)
    return _fuse(params, replace(state, magnetic=magnetic), ready)


def release(params: Params, state: State, patience: float) -> tuple[State, Trajectory]:
    """For a live view: give out what is older than `patience` s without waiting for a strip or
    magnetometer that is silent."""
    state, pieces = _without_waiting(params, state, patience)
    rows, given = resampling.release(state.rows, patience)
    state, piece = _hand(params, replace(state, rows=rows), given)
    return state, join([*pieces, piece], state.calibration.hand)


def mounting_changes(state: State) -> tuple[MountingChange, ...]:
    """Sensors that were found to have turned on their segments since the state began."""
    return state.chains.mounting_changes


def contact_outcomes(state: State) -> tuple[ContactOutcome, ...]:
    """What became of the contacts that were held since the calibration."""
    return state.contact_outcomes


def finish(params: Params, state: State) -> tuple[State, Trajectory]:
    """Give out what was held back: nothing more will come."""
    state, pieces = _without_waiting(params, state, -np.inf)
    sensors, rows, given = resampling.drain(params, state.sensors, state.rows)
    state, piece = _hand(params, replace(state, sensors=sensors, rows=rows), given)
    return state, join([*pieces, piece], state.calibration.hand)


def _without_waiting(
    params: Params, state: State, patience: float
) -> tuple[State, list[Trajectory]]:
    """Inertial samples that wait for magnetometers go on without them."""
    if state.magnetic is None:
        return state, []
    magnetic, blocks = magnetometer_resampling.release(state.magnetic, patience)
    state, piece = _fuse(params, replace(state, magnetic=magnetic), blocks)
    return state, [piece]


def _fuse(params: Params, state: State, blocks: Sequence[Block]) -> tuple[State, Trajectory]:
    """Orientations of the blocks' sensors, and the hand at every instant that is complete."""
    sensors, oriented = dict(state.sensors), []
    for k, block in enumerate(blocks):
        inertial = (
            block
            if state.magnetic is None
            else Block(_inertial(block.stream), block.t, block.values[..., :6])
        )
        fusion = sensors.get(block.stream.name)
        if (
            fusion is None or fusion.stream != inertial.stream
        ):  # plugged in later, or with another rate or other sensors than before
            if k:  # first what the blocks before it complete
                state, early = _fuse(params, state, blocks[:k])
                state, late = _fuse(params, state, blocks[k:])
                return state, join([early, late], state.calibration.hand)
            fusion = _start_fusion(state.calibration, inertial.stream)
        sensors[block.stream.name], fused = orientation_fusion.step(params, fusion, inertial)
        oriented.append((inertial.stream, fused))
    rows, given = resampling.step(state.rows, *oriented)
    raw = sample_alignment.buffer_blocks(state.raw, blocks, state.calibration, state.q_SB)
    return _hand(params, replace(state, sensors=sensors, rows=rows, raw=raw), given)


def _inertial(stream: Stream) -> Stream:
    """The stream without its magnetometers: fusions here go without."""
    return replace(stream, quantities=(GYR, ACC))


def _hand(params: Params, state: State, rows: resampling.Rows) -> tuple[State, Trajectory]:
    """Pose of the hand: its orientation from the fusion, wrist and fingers from their filters."""
    if not len(rows.t):
        return state, empty(state.calibration.hand)
    q_GB = quat.multiply(rows.q_GS, state.q_SB)
    raw, samples = sample_alignment.align_samples(
        state.raw,
        rows,
        q_GB,
        params.gyr_reading == "instant",
        params.vertical == "fused",
        params.joint_acceleration,
    )
    pieces, first = [], 0
    while (pending := _next_due(state, samples.t[-1])) is not None:
        row = int(samples.t.searchsorted(pending.due))
        state, piece = _pose_rows(params, state, rows, q_GB, samples, slice(first, row))
        pieces.append(piece)
        state, first = _look_at_contact(params, state, pending), row
    state, piece = _pose_rows(params, state, rows, q_GB, samples, slice(first, len(rows.t)))
    return replace(state, raw=raw), join([*pieces, piece], state.calibration.hand)


def _next_due(state: State, until: float) -> Pending | None:
    """The contact that is to be looked at next, up to a time (s)."""
    first = min(state.contacts, key=lambda p: p.due, default=None)
    return first if first is not None and first.due <= until else None


def _look_at_contact(params: Params, state: State, pending: Pending) -> State:
    """The state with what a contact tells of joints, mounting and lengths, once it was held."""
    others = tuple(p for p in state.contacts if p is not pending)
    if pending.q_before is None:
        at_rest = replace(pending, q_before=state.chains.q_pc)
        return replace(state, contacts=(*others, at_rest))
    geometry = state.calibration.geometry
    used = [o.held.contacts for o in state.contact_outcomes if o.used]
    missed = sum(o.outcome == "missed" for o in state.contact_outcomes)
    hand, outcome = ekf_contacts.apply(
        params,
        HandState(state.chains, geometry, state.of_lengths),
        replace(
            pending,
            times=used.count(pending.held.contacts),
            looked_at=len(used) + missed,
            missed=missed,
        ),
    )
    return replace(
        state,
        chains=hand.chains,
        of_lengths=hand.of_lengths,
        calibration=replace(state.calibration, geometry=hand.geometry),
        contacts=others,
        contact_outcomes=(*state.contact_outcomes, outcome),
    )


def _pose_rows(
    params: Params,
    state: State,
    every: resampling.Rows,
    every_q_GB: Array,
    every_sample: Samples,
    part: slice,
) -> tuple[State, Trajectory]:
    """Filters and pose of a part of the rows."""
    rows, q_GB = every.between(part), every_q_GB[part]
    samples = every_sample.between(part)
    if not len(rows.t):
        return state, empty(state.calibration.hand)
    chains, estimate = finger_ekf_filter.step(params, state.chains, samples)
    q_pc = _by_joint(JOINTS_OF, estimate.q_joint, samples.known, np.zeros(len(JOINTS)))
    pose = hand_pose.pose_hand(q_pc, q_GB, state.calibration.geometry, params.constraints)
    uncertainty = _output_uncertainty(params, state, estimate, pose)
    newest = estimate.update_rows.searchsorted(np.arange(len(rows.t)), side="right")
    lost = uncertainty.lost[newest] & ((rows.flags & LOST) != 0)
    trajectory = Trajectory(
        state.calibration.hand,
        rows.t,
        pose.freedoms,
        pose.q_GS,
        pose.tips,
        (rows.flags & ~LOST) | LOST * lost,
        np.where(np.isnan(pose.angles), np.nan, uncertainty.angles_sd[newest]),
        np.where(np.isnan(pose.tips), np.nan, uncertainty.tips_sd[newest]),
    )
    last = OutputUncertainty(
        uncertainty.angles_sd[-1], uncertainty.tips_sd[-1], uncertainty.lost[-1]
    )
    return replace(state, chains=chains, uncertainty=last), trajectory


@rowwise("(c,k),(c,k,q),(c,k),(j)->(j,q)")
def _by_joint(joints: Array, q_chains: Array, known: Array, row: Array, q_pc: Array) -> None:
    """Rotations of all joints of those that the chains have of theirs, NaN where not known."""
    for j in range(q_pc.shape[0]):
        for a in range(4):
            q_pc[j, a] = math.nan
    for c in range(joints.shape[0]):
        for k in range(joints.shape[1]):
            for a in range(4 if known[c, k] > 0 else 0):
                q_pc[int(joints[c, k]), a] = q_chains[c, k, a]


def _output_uncertainty(
    params: Params, state: State, estimate: finger_ekf_filter.Estimate, pose: Pose
) -> OutputUncertainty:
    """Standard deviations and lost headings from each covariance on, (u + 1, ...): the first as the
    step before left them."""
    before = OutputUncertainty(
        state.uncertainty.angles_sd[None],
        state.uncertainty.tips_sd[None],
        state.uncertainty.lost[None],
    )
    if not len(estimate.update_rows):
        return before
    angles, q_pc = pose.angles[estimate.update_rows], pose.q_pc[estimate.update_rows]
    geometry = state.calibration.geometry
    of_lengths = state.of_lengths + length_covariance.of_palm(geometry)
    angles_sd, tips_sd, largest = output_covariance.of_hand(
        angles, q_pc, estimate.P, geometry, of_lengths
    )
    return OutputUncertainty(
        np.concatenate([before.angles_sd, joint_angles.mask_non_freedoms(angles_sd)]),
        np.concatenate([before.tips_sd, tips_sd]),
        np.concatenate(
            [
                before.lost,
                _lost(
                    CHAIN_SEGMENTS,
                    largest,
                    math.radians(params.heading_known) ** 2,
                    np.zeros(len(SEGMENTS)),
                ),
            ]
        ),
    )


@rowwise_bool("(f,k),(c,k),(),(s)->(s)")
def _lost(segments: Array, largest: Array, most: float, row: Array, lost: Bools) -> None:
    """Which segments are not known against the hand, of the largest variances of the chains'
    joints: an unsure joint stands between them."""
    for f in range(segments.shape[0]):
        unsure = False
        for k in range(segments.shape[1]):
            unsure = unsure or largest[f, k] > most
            lost[int(segments[f, k])] = unsure
    lost[_FOREARM], lost[_HAND] = largest[segments.shape[0], 0] > most, False
