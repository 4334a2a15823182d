"""What the initial pose was missed by: the part that gravity in all sensors tells, given how far sensors are usually misaligned.

In      a Calibration from a pose, with the nominal mounting that the pose was compared with; covariance of misalignments and of the pose's angles
Out     the Calibration with the likeliest pose and mounting; the covariance of what is left of both
Source  ours: a linear Gaussian model of gravity in all sensors. Unknown sizes of the misalignments and of what a person misses a pose by: Bayesian model averaging (Hoeting et al. 1999,
        Stat Sci 14:382) with log-normal priors around the options
Limits  first order in the angles; gravity tells nothing about turns about the vertical; the pose's size is told by few joints, so the option counts for much
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import JOINTS, SEGMENT, SEGMENTS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Bools
from handscope.estimators.orientation.fusion import make_upright

MOUNTINGS = 3 * len(SEGMENTS)  # errors of the mountings come first, then those of the joints
SIZE = MOUNTINGS + 3 * len(JOINTS)
HAND_TILT_SD = np.radians(30.0)  # of the hand in the pose: hardly known
SCALES = 2.0 ** np.arange(-2.0, 2.01, 0.25)  # of the misalignments against the option
SCALE_SD = np.log(2.0)  # of the logarithm of that scale
POSE_SCALES = 2.0 ** np.arange(-1.5, 2.01, 0.5)  # of the pose's errors against the option
POSE_SCALE_SD = 0.5  # of its logarithm: most people between 0.6 and 1.6 of it
UNLIKELY = 1e-6  # weight of a pair of scales, against the likeliest, that counts for nothing
VERTICAL = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class _Seen:
    """Gravity of all sensors in the hand's frame, as the nominal mounting and the pose have it."""

    up: Array  # (3,) what most of them agree in
    residual: Array  # (3 n,) of each sensor
    H: Array  # (3 n, 3 + SIZE) its derivative by the hand's tilt and the errors


def can_infer(calibration: Calibration) -> bool:
    """Whether the pose alone tells how the sensors sit, and the nominal mounting is known."""
    found_otherwise = calibration.q_BS_sd or calibration.is_functional or calibration.from_prior
    return bool(calibration.nominal) and not found_otherwise


def infer(
    calibration: Calibration,
    mounting_sd: float,
    pose_sd: Array,
    gravity_sd: float,
    measured: Bools | None = None,
) -> tuple[Calibration, Array]:
    """The likeliest pose if the pose's size is the option's, and the covariance (SIZE, SIZE) rad^2 of its errors, whatever that size is: mountings by segment, angles by joint.

    `mounting_sd` rad about each axis, `pose_sd` (joints, 3) rad, 0 where the joint has no such freedom, `gravity_sd` rad; `measured` (joints, 3): the
    standard deviation is that of a measurement, and its size is known.
    """
    on_hand = _on_hand(calibration)
    seen = _gravity_seen(calibration, on_hand)
    known = np.zeros(pose_sd.shape, bool) if measured is None else measured
    scaled = np.concatenate([np.zeros(3 + MOUNTINGS, bool), ~known.ravel()])
    usual = np.concatenate(
        [np.full(3, HAND_TILT_SD), np.full(MOUNTINGS, mounting_sd), pose_sd.ravel()]
    )
    scales, variances, logs = [*product(SCALES, POSE_SCALES)], [], []
    for scale, pose_scale in scales:
        sd = np.where(scaled, pose_scale * usual, usual)
        sd[3 : 3 + MOUNTINGS] *= scale
        prior = (np.log(scale) / SCALE_SD) ** 2 + (np.log(pose_scale) / POSE_SCALE_SD) ** 2
        variances.append(sd**2)
        logs.append(_log_likelihood(seen, sd**2, gravity_sd) - 0.5 * prior)
    weights = np.exp(np.array(logs) - max(logs))
    fits = {
        k: _condition(seen, variances[k], gravity_sd)
        for k, (_, pose_scale) in enumerate(scales)
        if weights[k] > UNLIKELY or pose_scale == 1.0
    }
    of_option = {k: weights[k] for k in fits if scales[k][1] == 1.0}
    error = _mean({k: fits[k][0] for k in of_option}, of_option)
    squares = {k: C + np.outer(m - error, m - error) for k, (m, C) in fits.items()}
    P = _mean(squares, {k: weights[k] for k in fits})
    up = quat.rotate(quat.exp(error[:3]), seen.up)
    return _posed(calibration, on_hand, up, error[3 + MOUNTINGS :].reshape(-1, 3)), P[3:, 3:]


def _mean(values: Mapping[int, Array], weights: Mapping[int, float]) -> Array:
    whole = sum(weights.values())
    return np.asarray(np.sum([weights[k] / whole * v for k, v in values.items()], axis=0))


def _log_likelihood(seen: _Seen, variance: Array, gravity_sd: float) -> float:
    """Of what the sensors see, the errors averaged over."""
    S = (seen.H * variance) @ seen.H.T + gravity_sd**2 * np.eye(len(seen.H))
    root = np.linalg.cholesky(S)
    white = np.linalg.solve(root, seen.residual)
    return float(-np.log(np.diag(root)).sum() - 0.5 * white @ white)


def _condition(seen: _Seen, variance: Array, gravity_sd: float) -> tuple[Array, Array]:
    """Mean and covariance of the errors."""
    HP = seen.H * variance
    S = HP @ seen.H.T + gravity_sd**2 * np.eye(len(HP))
    gain = np.linalg.solve(S, HP).T
    return gain @ seen.residual, np.diag(variance) - gain @ HP


def _on_hand(calibration: Calibration) -> Array:
    """Orientations (segments, 4) on the hand in the pose; a segment without a sensor is straight on its parent."""
    q_GB = {
        s: quat.multiply(q, quat.conjugate(calibration.q_BS[s]))
        for s, q in calibration.q_GS.items()
    }
    found = np.tile(quat.IDENTITY, (len(SEGMENTS), 1))
    for joint in JOINTS:
        inwards = joint.name == "wrist"
        segment, neighbour = (joint.parent, "hand") if inwards else (joint.child, joint.parent)
        found[SEGMENT[segment]] = (
            quat.relative(q_GB["hand"], q_GB[segment])
            if segment in q_GB
            else found[SEGMENT[neighbour]]
        )
    return found


def _gravity_seen(calibration: Calibration, on_hand: Array) -> _Seen:
    """A sensor whose mounting errs by m, on a segment that the pose misses by r, sees gravity turned by m - r."""
    missed = np.zeros((len(SEGMENTS), 3, SIZE))  # (segments) r by the errors, in the hand's frame
    axes = joint_angles.axes(joint_angles.of_segments(on_hand))
    for j, joint in enumerate(JOINTS):
        p, c, own = SEGMENT[joint.parent], SEGMENT[joint.child], MOUNTINGS + 3 * j
        if joint.name == "wrist":
            missed[p, :, own : own + 3] = -axes[j]
        else:
            missed[c] = missed[p]
            missed[c, :, own : own + 3] += quat.matrix(on_hand[c]) @ axes[j]
    names = [SEGMENT[s] for s in calibration.q_GS]
    seen = np.array([_up_on_hand(calibration, on_hand, s) for s in calibration.q_GS])
    up = np.median(seen[[s != "forearm" for s in calibration.q_GS]], axis=0)
    up /= np.linalg.norm(up)
    turned = np.zeros((len(names), 3, 3 + SIZE))
    turned[:, :, :3] = np.eye(3)
    turned[:, :, 3:] = -missed[names]
    for k, s in enumerate(names):
        turned[k, :, 3 + 3 * s : 6 + 3 * s] += quat.matrix(on_hand[s])
    H = np.cross(turned, up, axisa=1, axisc=1)
    return _Seen(up, (seen - up).ravel(), H.reshape(-1, 3 + SIZE))


def _up_on_hand(calibration: Calibration, on_hand: Array, segment: str) -> Array:
    """Upwards (3,) in the hand's frame as one sensor has it with its nominal mounting."""
    up = quat.rotate(quat.conjugate(calibration.q_GS[segment]), VERTICAL)
    q_HS = quat.multiply(on_hand[SEGMENT[segment]], calibration.nominal[segment])
    return np.asarray(quat.rotate(q_HS, up))


def _posed(calibration: Calibration, on_hand: Array, up: Array, angles: Array) -> Calibration:
    """The pose with its joints turned on by `angles` (joints, 3), upwards in the hand's frame being `up`."""
    q_pc = joint_angles.compose(joint_angles.of_segments(on_hand) + angles)
    on = forward_kinematics.segments_on(quat.IDENTITY, q_pc)
    q_GH = make_upright(
        quat.multiply(calibration.q_GS["hand"], quat.conjugate(calibration.q_BS["hand"])), up
    )
    q_GS, q_BS = {}, {}
    for s, before in calibration.q_GS.items():
        q_GB = quat.multiply(q_GH, on[SEGMENT[s]])
        nominal = quat.multiply(q_GB, calibration.nominal[s])
        q_GS[s] = make_upright(nominal, quat.rotate(quat.conjugate(before), VERTICAL))
        q_BS[s] = quat.relative(q_GB, q_GS[s])
    return replace(calibration, q_GS=q_GS, q_BS=q_BS)
