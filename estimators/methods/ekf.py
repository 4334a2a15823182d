"""EKF: joint rotations by a filter a finger that knows how sure it is, the hand and the forearm from gyroscope and accelerometer.

In      inertial blocks of any subset of sensors, a Calibration from the initial pose
Out     Trajectory: joint angles, segment orientations, fingertips in the wrist frame, with the standard deviations of fingers and tips
Source  Kortier, thesis ch. 2, finger filter (2.3)-(2.32); hand and forearm: as m2 (VQF, Laidig & Seel 2023)
Limits  magnetometers are not used; the wrist has no standard deviation and the tips' does not count it; a sensor whose samples are not at the instants
        of the rows (another rate or clock) counts by its orientation from the fusion, interpolated, and by its interpolated acceleration
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimators import ekf_alignment, finger_ekf, forward_kinematics, joint_angles, salchow, sensor_fusion, time_base
from estimators import quaternions as quat
from estimators.calibration import Calibration
from estimators.finger_ekf import FilterParams
from estimators.forward_kinematics import CHAIN_JOINTS
from estimators.hand_anatomy import DEVIATION, FLEXION, JOINTS, PRONATION, SEGMENT
from estimators.hand_geometry import HandGeometry
from estimators.options import option
from estimators.quaternions import Array
from estimators.samples import Block, Stream
from estimators.trajectory import Trajectory, empty

TITLE = "error-state Kalman filter a finger, one initial pose, standard deviations (Kortier 2018, ch. 2)"
NEEDS_POSE = True
STEEPEST = np.radians(80.0)  # at 90 deg of deviation flexion and pronation are one


@dataclass(frozen=True, kw_only=True)
class Params(FilterParams, salchow.Params):
    mounting_sd: float = option(
        2.0,
        "deg",
        "turn of a sensor on its segment since the pose, and of the pose against the one asked for; added to every standard deviation",
        "ours: skin that follows the joint turns a sensor by about this much",
    )
    length_sd: float = option(
        0.03,
        "1",
        "how far a phalanx, and the place of a knuckle, may be from the model's length; part of the tips' standard deviation",
        "Salchow-Hoemmen 2019, 5: ratios vary from subject to subject by a few percents; size ours",
    )


@dataclass(frozen=True)
class State:
    """Everything the next step needs: save it, copy it, start again from it."""

    calibration: Calibration
    q_SB: Array  # (segments, 4) segment-to-sensor rotations
    sensors: Mapping[str, sensor_fusion.StreamState]  # by stream
    rows: time_base.State
    raw: ekf_alignment.State  # samples that wait for their rows
    fingers: finger_ekf.State


def start(params: Params, calibration: Calibration, streams: tuple[Stream, ...]) -> State:
    """Begin at the calibration's moment."""
    begun = salchow.start(params, calibration, streams)
    return State(calibration, begun.q_SB, begun.sensors, begun.rows, ekf_alignment.start(), finger_ekf.start(params))


def step(params: Params, state: State, block: Block) -> tuple[State, Trajectory]:
    """Advance by one block of any length, 0 included; blocks of streams that the method does not use change nothing."""
    if not block.stream.inertial:
        return state, empty(state.calibration.hand)
    fusion = state.sensors.get(block.stream.name)
    if fusion is None or fusion.stream != block.stream:  # plugged in later, or with another rate or other sensors than before
        known = state.calibration
        fusion = sensor_fusion.start(block.stream, known.q_GS, known.gyr_bias, known.end)
    fusion, oriented = sensor_fusion.step(params, fusion, block)
    rows, given = time_base.step(state.rows, block.stream, oriented)
    raw = ekf_alignment.taken(state.raw, block, state.calibration, state.q_SB)
    sensors = {**state.sensors, block.stream.name: fusion}
    return _hand(params, replace(state, sensors=sensors, rows=rows, raw=raw), given)


def release(params: Params, state: State, patience: float) -> tuple[State, Trajectory]:
    """For a live view: give out what is older than `patience` s without waiting for a strip that is silent."""
    rows, given = time_base.release(state.rows, patience)
    return _hand(params, replace(state, rows=rows), given)


def finish(params: Params, state: State) -> tuple[State, Trajectory]:
    """Give out what was held back: nothing more will come."""
    sensors, rows, last = dict(state.sensors), state.rows, []
    for name, fusion in state.sensors.items():
        sensors[name], oriented = sensor_fusion.finish(params, fusion)
        rows, given = time_base.step(rows, fusion.stream, oriented)
        last.append(given)
    rows, given = time_base.finish(rows)
    return _hand(params, replace(state, sensors=sensors, rows=rows), time_base.join([*last, given]))


def _hand(params: Params, state: State, rows: time_base.Rows) -> tuple[State, Trajectory]:
    """Pose of the hand: wrist and hand from the fusion, the fingers from their filters."""
    if not len(rows.t):
        return state, empty(state.calibration.hand)
    q_GB = quat.multiply(rows.q_GS, state.q_SB)
    raw, samples = ekf_alignment.aligned(state.raw, rows, q_GB, params.gyr_reading == "instant", params.max_gap)
    fingers, found = finger_ekf.step(params, state.fingers, samples)
    angles = joint_angles.of_segments(q_GB)
    angles[:, CHAIN_JOINTS] = joint_angles.decompose(np.where(samples.known[..., None], found.q_pc, np.nan))
    if params.constraints:
        angles = joint_angles.constrained(angles)
    q_pc = joint_angles.compose(angles)
    chained = forward_kinematics.segments_on(q_GB[:, SEGMENT["hand"]], q_pc)
    q_GS = np.where(np.isnan(chained), q_GB, chained)
    q_GS[:, SEGMENT["forearm"]] = q_GB[:, SEGMENT["forearm"]]
    tips = forward_kinematics.tips(q_pc, state.calibration.geometry)
    P = found.P + np.radians(params.mounting_sd) ** 2 * np.eye(9)
    moved = Trajectory(
        state.calibration.hand,
        rows.t,
        joint_angles.only_freedoms(angles),
        q_GS,
        tips,
        rows.flags,
        _angles_sd(angles, P, samples.known),
        np.where(np.isnan(tips), np.nan, _tips_sd(params, q_pc, state.calibration.geometry, P)),
    )
    return replace(state, raw=raw, fingers=fingers), moved


def _angles_sd(angles: Array, P: Array, known: NDArray[np.bool_]) -> Array:
    """Standard deviations (n, joints, 3) of the fingers' angles from the covariances (n, 5, 9, 9) of their rotations."""
    found = np.full((len(angles), len(JOINTS), 3), np.nan)
    J = angle_jacobian(angles[:, CHAIN_JOINTS])
    for j in range(3):
        own = P[:, :, 3 * j : 3 * j + 3, 3 * j : 3 * j + 3]
        variance = np.stack([_quadratic(J[:, :, j, a], own) for a in range(3)], axis=-1)
        found[:, CHAIN_JOINTS[:, j]] = np.where(known[:, :, j, None], np.sqrt(variance), np.nan)
    return joint_angles.only_freedoms(found)


def angle_jacobian(angles: Array) -> Array:
    """How flexion, deviation and pronation (..., 3) change with dth, q_true = q exp(dth): (..., 3 angles, 3)."""
    deviation = np.minimum(np.maximum(angles[..., DEVIATION], -STEEPEST), STEEPEST)
    c, s, cd, td = np.cos(angles[..., PRONATION]), np.sin(angles[..., PRONATION]), np.cos(deviation), np.tan(deviation)
    J = np.zeros((*angles.shape, 3))
    J[..., FLEXION, 0], J[..., FLEXION, 2] = -s / cd, c / cd
    J[..., DEVIATION, 0], J[..., DEVIATION, 2] = c, s
    J[..., PRONATION, 0], J[..., PRONATION, 1], J[..., PRONATION, 2] = s * td, 1.0, -c * td
    return J


def _tips_sd(params: Params, q_pc: Array, geometry: HandGeometry, P: Array) -> Array:
    """Standard deviations (n, 5, 3) of the tips along the axes of WCS: of rotations and of lengths."""
    places = _places(q_pc, geometry)
    bones = np.concatenate([places[:, :, :1], np.diff(places, axis=2)], axis=2) ** 2
    of_lengths = params.length_sd**2 * (bones[:, :, 0] + bones[:, :, 1] + bones[:, :, 2] + bones[:, :, 3])
    J = tip_jacobian(q_pc, geometry)
    return np.asarray(np.sqrt(of_lengths + np.stack([_quadratic(J[:, :, a], P) for a in range(3)], axis=-1)))


def tip_jacobian(q_pc: Array, geometry: HandGeometry) -> Array:
    """How the tips in WCS change with the errors dth of their chain's joints: (n, 5, 3, 9). (23)-(27) of Salchow-Hoemmen 2019, differentiated"""
    places = _places(q_pc, geometry)
    q_WB = forward_kinematics.segments_on(_wrist(q_pc), q_pc)[:, forward_kinematics.CHAIN_SEGMENTS]
    J = np.empty((*places.shape[:2], 3, 9))
    for j in range(3):
        arm = quat.rotate(quat.conjugate(q_WB[:, :, j]), places[:, :, 3] - places[:, :, j])  # from the joint's centre to the tip
        J[..., 3 * j : 3 * j + 3] = _product(quat.matrix(q_WB[:, :, j]), -quat.skew(arm))
    return J


def _places(q_pc: Array, geometry: HandGeometry) -> Array:
    """Centres of each chain's joints and its tip (n, 5, 4, 3) in WCS."""
    roots = quat.rotate(_wrist(q_pc)[:, None], geometry.roots())
    return np.concatenate([roots[:, :, None], forward_kinematics.joint_places(q_pc, geometry)], axis=2)


def _wrist(q_pc: Array) -> Array:
    """From the hand to WCS (n, 4); an unknown wrist counts as neutral, as in forward kinematics."""
    q = q_pc[:, 0]
    return np.where(np.isnan(q), quat.IDENTITY, q)


def _product(a: Array, b: Array) -> Array:
    """Matrix products (..., 3, 3), elementwise over the leading axes."""
    return np.asarray(
        a[..., :, 0, None] * b[..., 0, None, :] + a[..., :, 1, None] * b[..., 1, None, :] + a[..., :, 2, None] * b[..., 2, None, :]
    )


def _quadratic(v: Array, P: Array) -> Array:
    """v' P v (...) of v (..., m) and P (..., m, m), elementwise over the leading axes."""
    total = np.zeros(v.shape[:-1])
    for i in range(v.shape[-1]):
        along = np.zeros(v.shape[:-1])
        for k in range(v.shape[-1]):
            along += P[..., i, k] * v[..., k]
        total += v[..., i] * along
    return np.maximum(total, 0.0)
