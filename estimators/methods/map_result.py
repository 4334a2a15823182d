"""Calibration and trajectory of a MAP solution: what the fingers share, and standard deviations.

In      solved fingers (self_calibration/result.py), the trajectory that m2 tracks with them
Out     one Calibration; the Trajectory with the solution in its interval and standard deviations
Source  ours
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.alignment import initial_pose
from handscope.estimators.data.calibration import Calibration, CalibrationSource
from handscope.estimators.data.samples import Recording
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.hand import forward_kinematics, joint_angles, length_covariance
from handscope.estimators.hand.anatomy import (
    CHAINS,
    CHILDREN,
    DEVIATION,
    FINGERS,
    FLEXION,
    IS_DOF,
    JOINT,
    PARENTS,
    SEGMENT,
    SEGMENTS,
    side_sign,
)
from handscope.estimators.hand.geometry import HandGeometry, root_joint, with_finger_lengths
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.methods.map_options import Params
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import result as self_calibration_result
from handscope.estimators.self_calibration.problem import (
    parameter_columns,
)
from handscope.estimators.self_calibration.result import Finger

TRIED = phrase("map.simulated_only")


# standard deviation of an angle of which nothing is known: what joints can do at all
UNKNOWN = np.radians(60.0)


UNKNOWN_TIP = 0.05  # m, the same of a fingertip, which moves about over a decimetre


def join_fingers(
    params: Params, recording: Recording, fingers: Sequence[Finger], worn: set[str]
) -> Calibration:
    """One calibration of all fingers: they share the hand's orientation, that of the first."""
    first = fingers[0]
    known = initial_pose.uncalibrated(
        recording.hand,
        recording.geometry,
        recording.mounting,
        sorted(worn & set(SEGMENTS)),
        float(first.t[0]),
    )
    q_BS = dict(known.q_BS)
    for finger in fingers:
        q_BS |= finger.segments.q_BS
    geometry = _with_lengths(params, recording.geometry, fingers)
    nearest = sorted(fingers, key=lambda f: float(np.linalg.norm(_end(f, geometry))))
    return replace(
        known,
        q_GS=sensor_orientations(fingers, 0),
        q_BS=q_BS,
        gyr_bias={
            n: f.solution.at.bias_gyr[s]
            for f in reversed(fingers)
            for s, n in enumerate(f.solution.problem.chain.sensors)
        },
        geometry=geometry,
        source=CalibrationSource.SELF_CALIBRATION,
        stretch=(max(float(f.t[0]) for f in fingers), min(float(f.t[-1]) for f in fingers)),
        warnings=(TRIED,),
        p_BS=_first_of(nearest, lambda f: _known_places(params, f, _places(f, geometry))),
        acc_bias={
            n: f.solution.at.bias_acc[s]
            for f in reversed(fingers)
            for s, n in enumerate(f.solution.problem.chain.sensors)
        },
        q_BS_sd=_first_of(fingers, lambda f: f.sure.q_BS),
        p_BS_sd=_first_of(
            nearest, lambda f: _known_places(params, f, _places_sd(params, f, geometry))
        ),
        gyr_bias_sd=_first_of(
            fingers, lambda f: _bias_sd(f, parameter_columns(f.solution.problem.chain).bias_gyr)
        ),
        acc_bias_sd=_first_of(
            fingers, lambda f: _bias_sd(f, parameter_columns(f.solution.problem.chain).bias_acc)
        ),
        lengths_sd={
            s: sd
            for f in fingers
            for s, sd in f.segments.lengths_sd.items()
            if self_calibration_result.is_length_known(params, f, s)
        },
    )


def sensor_orientations(fingers: Sequence[Finger], row: int) -> dict[str, Array]:
    """Orientations of the sensors (4,) in a row of the stretch, by segment; the hand's is that of the first finger."""
    hand = fingers[0].solution.at.q_GS[row, 0]
    found: dict[str, Array] = {}
    for finger in fingers:
        q_GS = finger.solution.at.q_GS[row]
        onto = quat.multiply(hand, quat.conjugate(q_GS[0]))
        found |= {
            s: quat.multiply(onto, q) for s, q in zip(finger.solution.problem.chain.sensors, q_GS)
        }
    return found | {"hand": hand}


def _first_of(
    fingers: Sequence[Finger], known: Callable[[Finger], Mapping[str, Array]]
) -> dict[str, Array]:
    """By segment; of the hand as the first of these fingers has it."""
    return {s: value for f in reversed(fingers) for s, value in known(f).items()}


def _bias_sd(finger: Finger, where: slice) -> dict[str, Array]:
    sd = np.sqrt(np.diag(finger.solution.factor.covariance)[where]).reshape(-1, 3)
    return dict(zip(finger.solution.problem.chain.sensors, sd))


def _known_places(params: Params, finger: Finger, known: Mapping[str, Array]) -> dict[str, Array]:
    """The sensors whose places movement determined."""
    return {
        s: value
        for s, value in known.items()
        if self_calibration_result.is_placed(params, finger, s)
    }


def _places(finger: Finger, geometry: HandGeometry) -> dict[str, Array]:
    """Where the sensors sit from their segments' origins: the hand's is MCP 3, a last phalanx' the
    end of its bone, the forearm's the wrist."""
    found = dict(finger.segments.p_BS)
    found["hand"] = found["hand"] + _end(finger, geometry)
    if finger.name in CHAINS:
        last = finger.solution.problem.chain.sensors[-1]
        # a joint that no sensor shows
        along = geometry.lengths[last] if last == CHAINS[finger.name][-1] else np.nan
        found[last] = found[last] - side_sign(geometry.hand) * np.array([0.0, along, 0.0])
    return {s: p for s, p in found.items() if np.isfinite(p).all()}


def _end(finger: Finger, geometry: HandGeometry) -> Array:
    """Where a finger, or the forearm, hangs on the hand (3,) m, from the hand's origin."""
    ends = (
        geometry.joint_positions[root_joint(finger.name)]
        if finger.name in CHAINS
        else (0.0, 0.0, 0.0)
    )
    return np.subtract(ends, geometry.joint_positions["middle_mcp"])


def _places_sd(params: Params, finger: Finger, geometry: HandGeometry) -> dict[str, Array]:
    """(3,) m; the hand's is counted from MCP 3, the last phalanx' from an end that no movement
    shows."""
    off = params.length_guess * float(np.linalg.norm(_end(finger, geometry)))
    sds = {**finger.sure.p_BS, "hand": np.hypot(finger.sure.p_BS["hand"], off)}
    if finger.name in CHAINS:
        last = finger.solution.problem.chain.sensors[-1]
        sds[last] = np.hypot(sds[last], [0.0, params.length_guess * geometry.lengths[last], 0.0])
    return {s: sds[s] for s in _places(finger, geometry)}


def _with_lengths(
    params: Params, geometry: HandGeometry, fingers: Sequence[Finger]
) -> HandGeometry:
    """Geometry with the lengths found from movement."""
    for finger in fingers:
        known = {
            s: v
            for s, v in finger.segments.lengths.items()
            if self_calibration_result.is_length_known(params, finger, s)
        }
        geometry = with_finger_lengths(geometry, finger.name, known)
    return geometry


def with_solution(
    tracked: Trajectory, geometry: HandGeometry, fingers: Sequence[Finger]
) -> Trajectory:
    """The tracked movement with the stretch as self-calibration found it, fingers on the hand's
    tracked orientation."""
    q_GS, t = tracked.q_GS.copy(), tracked.t
    start, stop = max(f.t[0] for f in fingers), min(f.t[-1] for f in fingers)
    inside = (t >= start) & (t <= stop)
    hand = q_GS[inside, SEGMENT["hand"]]
    for finger in fingers:
        for name, q_GB in finger.segments.q_GB.items():
            if name != "hand":
                on_hand = quat.relative(finger.segments.q_GB["hand"], q_GB)
                q_GS[inside, SEGMENT[name]] = quat.multiply(hand, _at(t[inside], finger.t, on_hand))
    angles = tracked.angles.copy()
    free = joint_angles.constrain(joint_angles.of_segments(q_GS[inside]))
    angles[inside] = joint_angles.mask_non_freedoms(free)
    tips = tracked.tips.copy()
    tips[inside] = forward_kinematics.tips(joint_angles.compose(free), geometry)
    return replace(tracked, q_GS=q_GS, angles=angles, tips=tips)


def with_deviations(params: Params, movement: Trajectory, fingers: Sequence[Finger]) -> Trajectory:
    """Standard deviations of the stretch, larger before and after it; nothing is known of fingers
    that were not calibrated."""
    angles = np.where(np.isnan(movement.angles), np.nan, UNKNOWN)
    tips = np.where(np.isnan(movement.tips), np.nan, UNKNOWN_TIP)
    outside = (movement.t < max(f.t[0] for f in fingers)) | (
        movement.t > min(f.t[-1] for f in fingers)
    )
    drift = np.where(outside, np.radians(params.tracked), 0.0)
    for finger in fingers:
        knots, sure = finger.t[finger.sure.rows], finger.sure
        for j, a in zip(*np.nonzero(np.isfinite(sure.angles).all(axis=0) & IS_DOF)):
            angles[:, j, a] = np.hypot(np.interp(movement.t, knots, sure.angles[:, j, a]), drift)
        reach = sum(finger.segments.lengths.values())
        for axis in range(3 if finger.name in CHAINS else 0):
            tips[:, FINGERS.index(finger.name), axis] = np.hypot(
                np.interp(movement.t, knots, sure.tip[:, axis]), drift * reach
            )
    lost = outside[:, None] & (movement.flags & np.uint8(Flag.HEADING_LOST) > 0)
    angles = np.where(
        (lost[:, PARENTS] | lost[:, CHILDREN])[..., None] & np.isfinite(angles), UNKNOWN, angles
    )
    on_fingers = np.stack(
        [lost[:, [SEGMENT[s] for s in links]].any(axis=1) for links in CHAINS.values()], axis=1
    )
    tips = np.where(on_fingers[..., None] & np.isfinite(tips), UNKNOWN_TIP, tips)
    return replace(movement, angles_sd=angles, tips_sd=tips)


def flag_uncalibrated(movement: Trajectory, fingers: Sequence[Finger]) -> None:
    """Flag (in place) the segments that are followed but were not calibrated: nothing is known of
    them."""
    known = {s for f in fingers for s in f.solution.problem.chain.sensors}
    for name in SEGMENTS:
        if name not in known and np.isfinite(movement.q_GS[:, SEGMENT[name], 0]).any():
            movement.flags[:, SEGMENT[name]] |= np.uint8(Flag.UNCALIBRATED)


def add_wrist_uncertainty(
    params: Params, movement: Trajectory, geometry: HandGeometry
) -> Trajectory:
    """Tips are given in the wrist's frame: they are as uncertain as its angles, where it is
    followed, and as the fingers' roots, which no movement determines."""
    assert movement.angles_sd is not None and movement.tips_sd is not None
    angles, tips = np.where(IS_DOF, movement.angles, 0.0), movement.tips_sd
    for axis in (FLEXION, DEVIATION):
        turned = angles.copy()
        turned[:, JOINT["wrist"], axis] += movement.angles_sd[:, JOINT["wrist"], axis]
        here, there = (
            forward_kinematics.tips(joint_angles.compose(a), geometry) for a in (angles, turned)
        )
        tips = np.hypot(tips, np.nan_to_num(there - here))  # an unknown wrist counts as neutral
    turn = quat.matrix(joint_angles.compose(np.nan_to_num(angles[:, JOINT["wrist"]])))
    of_hand = length_covariance.covariance(geometry, params.length_guess)
    of_roots = (of_hand + length_covariance.of_palm(geometry))[:, :3, :3]
    return replace(
        movement,
        tips_sd=np.hypot(tips, np.sqrt(np.einsum("nij,fjk,nik->nfi", turn, of_roots, turn))),
    )


def _at(t: Array, known: Array, q: Array) -> Array:
    """Orientations between those of `known` instants."""
    k = np.clip(np.searchsorted(known, t, side="right") - 1, 0, len(known) - 2)
    weight = np.clip((t - known[k]) / (known[k + 1] - known[k]), 0.0, 1.0)
    return quat.slerp(q[k], q[k + 1], weight)
