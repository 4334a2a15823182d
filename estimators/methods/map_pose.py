"""The initial pose tells `map` how the sensors of hand and forearm sit, and the last phalanges' about their hinges, as far as a person takes it as asked.

In      the recording with its poses, the movement as it was found; of a pose's calibration the angles that were asked for or measured count
Out     the errors that no movement tells (map_unobserved.py), and their covariance
Source  ours: a linear Gaussian model of the angles of all joints in the pose, as `ekf` has it of gravity (finger_ekf/pose_error/pose_inference.py). Joints between sensors that movement tells show
        how exactly the person took the pose: its size is averaged over (Hoeting et al. 1999) with the same prior
Limits  first order in the errors; joints are missed each for itself: of a hand that is bent in all MCP joints alike the hand's sensor is believed to sit askew;
        the pose nearest to the stretch of movement counts; headings walk in between (option `heading_walk`)
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.alignment.initial_pose import PoseParams
from handscope.estimators.data import trajectory
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.options import part_of
from handscope.estimators.data.samples import Block, Recording, Stream
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.finger_ekf.measurements import UpdateParams
from handscope.estimators.finger_ekf.pose_error import bent_joints, pose_inference
from handscope.estimators.finger_ekf.sensor_to_segment import SensorToSegmentParams
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import CHAINS, IS_DOF, JOINTS, SEGMENT, SEGMENTS
from handscope.estimators.methods import m2
from handscope.estimators.methods.map_options import Params
from handscope.estimators.methods.map_result import sensor_orientations
from handscope.estimators.methods.map_unobserved import (
    COUNT,
    STEP,
    Z,
    columns_of,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Bools
from handscope.estimators.pipeline import recording_calibration
from handscope.estimators.pipeline.run import run
from handscope.estimators.self_calibration.result import Finger

# rad, turn of a joint about an axis that is no freedom of it
NO_FREEDOM_SD = np.radians(UpdateParams().dimension_noise)


@dataclass(frozen=True)
class PoseSeen:
    """An initial pose as the sensors show it."""

    asked: Calibration  # with the angles that were asked for or measured
    q_GS: Array  # (segments, 4) of the segments, as they were found from movement; NaN: not known
    drift: float  # rad, of headings against each other


@dataclass(frozen=True)
class _Window:
    """A recording's samples between two instants (s)."""

    recording: Recording
    start: float
    stop: float

    @property
    def streams(self) -> tuple[Stream, ...]:
        return self.recording.streams

    def blocks(self) -> Iterator[Block]:
        return (b.between(self.start, self.stop) for b in self.recording.blocks())


def find_pose(
    params: Params,
    recording: Recording,
    movement: Trajectory,
    calibration: Calibration,
    fingers: Sequence[Finger],
) -> tuple[PoseSeen | None, list[str]]:
    """The initial pose nearest to the stretch that `calibration` was found from, None without any, and why others are refused."""
    if not recording_calibration.initial_poses(recording.events):
        return None, []
    try:
        poses, refused = recording_calibration.calibrate(part_of(params, PoseParams), recording)
    except InputError as problem:
        return None, [str(problem)]
    start, stop = calibration.span

    def away(pose: Calibration) -> float:
        return max(start - pose.t, pose.end - stop, 0.0)

    taken = [c for c in reversed(poses) if c.source.is_pose]  # of a row the last, the mean of all
    if not taken:
        return None, refused
    pose = min(taken, key=away)
    if away(pose) > 0.0:
        movement = _track(params, recording, calibration, fingers, pose)
    rows = movement.between(pose.t, pose.end)
    if not len(rows):
        return None, refused
    drift = np.radians(params.heading_walk) * np.sqrt(away(pose))
    return PoseSeen(pose, _mean_orientations(rows.q_GS), float(drift)), refused


def unseated(params: Params) -> Params:
    """Options of tracking as long as it is not known how the hand's sensor sits: what joints cannot do corrects nothing."""
    return replace(params, heading_correction=False, constraints=False)


def _track(
    params: Params,
    recording: Recording,
    calibration: Calibration,
    fingers: Sequence[Finger],
    pose: Calibration,
) -> Trajectory:
    """The movement in a pose before or after the stretch, tracked from that end of it."""
    start, stop = calibration.span
    end = 0 if pose.t < start else -1
    at = (start, stop)[end]
    begun = replace(calibration, t=at, end=at, q_GS=sensor_orientations(fingers, end))
    window = _Window(recording, min(at, pose.t), max(at, pose.end))
    pieces = run(m2, unseated(params), [begun], window)
    during = (piece.between(pose.t, pose.end) for piece in pieces)
    return trajectory.join((piece for piece in during if len(piece)), recording.hand)


def condition(
    params: Params, fingers: Sequence[Finger], seen: PoseSeen, before: Array
) -> tuple[Array, Array]:
    """Errors (COUNT,) that no movement tells, and their covariance (COUNT, COUNT), of those `before` the pose is looked at."""
    joints = _known_joints(fingers)
    bent = bent_joints.find(SensorToSegmentParams(), seen.asked)
    taken = bent_joints.with_bent(seen.asked, bent)
    expected = joint_angles.of_segments(pose_inference.segments_on_hand(taken))[joints]

    def missed(errors: Array, q_GS: Array) -> Array:
        return quat.wrapped(
            joint_angles.of_segments(_corrected(q_GS, errors))[joints] - expected
        ).ravel()

    none, q_GS = np.zeros(COUNT), seen.q_GS
    away = missed(none, q_GS)
    H = np.stack([(missed(e, q_GS) - away) / STEP for e in STEP * np.eye(COUNT)], axis=1)
    slopes = np.zeros((len(away), len(SEGMENTS), 3))  # by turns of the segments
    for s, axis in np.ndindex(slopes.shape[1:]):
        turned = q_GS.copy()
        turned[s] = quat.multiply(quat.exp(STEP * np.eye(3)[axis]), turned[s])
        slopes[:, s, axis] = (missed(none, turned) - away) / STEP
    turns_sd = np.full(3, np.radians(params.angle_sd))
    turns_sd[2] = np.hypot(turns_sd[2], seen.drift / np.sqrt(2))  # of two sensors
    D = (slopes * turns_sd).reshape(len(away), -1)
    noise = D @ D.T + np.diag(np.where(IS_DOF[joints], 0.0, NO_FREEDOM_SD**2).ravel())
    of_angles, is_known = bent_joints.pose_angles_sd(params, seen.asked, bent)
    sd, measured = of_angles[joints].ravel(), is_known[joints].ravel()
    k = np.flatnonzero(np.isfinite(away))
    return _average_over_sizes(away[k], H[k], noise[np.ix_(k, k)], sd[k], measured[k], before)


def _known_joints(fingers: Sequence[Finger]) -> list[int]:
    """Joints of which everything that movement leaves open is among the errors."""
    known = {"hand"}
    for f in fingers:
        chain = CHAINS.get(f.name, (f.name,))
        known |= set(chain if chain[-1] in f.segments.q_BS else ())
    return [j for j, joint in enumerate(JOINTS) if {joint.parent, joint.child} <= known]


def _mean_orientations(q_GS: Array) -> Array:
    """Of each segment (segments, 4) over rows (n, segments, 4), NaN where one is not known."""
    return np.stack(
        [quat.mean(q) if np.isfinite(q).all() else q.mean(axis=0) for q in q_GS.swapaxes(0, 1)]
    )


def _corrected(q_GS: Array, errors: Array) -> Array:
    """Orientations (segments, 4) with the sensors turned by what they sit otherwise."""
    turns = np.zeros((len(SEGMENTS), 3))
    turns[SEGMENT["hand"]], turns[SEGMENT["forearm"]] = errors[:3], errors[columns_of("forearm")]
    for name, chain in CHAINS.items():
        turns[SEGMENT[chain[-1]]] = errors[columns_of(name).start] * Z
    return np.asarray(quat.multiply(q_GS, quat.exp(-turns)))


def _average_over_sizes(
    away: Array, H: Array, noise: Array, sd: Array, measured: Bools, before: Array
) -> tuple[Array, Array]:
    """Errors and covariance where the angles miss what was asked for by `away` (m,) with the standard deviations `sd` (m,), times an unknown size where they were not measured."""
    found, logs = [], []
    for size in pose_inference.POSE_SCALES:
        S = H @ before @ H.T + noise + np.diag(np.where(measured, sd, size * sd) ** 2)
        gain = np.linalg.solve(S, H @ before).T
        found.append((-gain @ away, before - gain @ H @ before))
        prior = (np.log(size) / pose_inference.POSE_SCALE_SD) ** 2
        likelihood = away @ np.linalg.solve(S, away) + np.linalg.slogdet(S)[1]
        logs.append(-0.5 * (prior + likelihood))
    shares = np.exp(np.array(logs) - max(logs))
    shares /= shares.sum()
    errors = sum(w * e for w, (e, _) in zip(shares, found))
    P = sum(w * (P + np.outer(e - errors, e - errors)) for w, (e, P) in zip(shares, found))
    return np.asarray(errors), np.asarray(P)
