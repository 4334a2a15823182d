"""What the initial pose was missed by: the part that gravity in all sensors tells, given how far sensors are usually misaligned.

In      a Calibration from a pose, with the nominal mounting that the pose was compared with; covariance of misalignments and of the pose's angles
Out     the Calibration with the likeliest pose and mounting; the covariance of what is left of both
Source  ours: a linear Gaussian model of gravity in all sensors. Unknown sizes of the misalignments and of what a person misses a pose by: Bayesian model averaging (Hoeting et al. 1999,
        Stat Sci 14:382) with log-normal priors around the options
Limits  first order in the angles; gravity tells nothing about turns about the vertical; the pose's size is told by few joints, so the option counts for much
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np

from handscope.estimators.alignment.initial_pose import PoseErrorParams
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.finger_ekf.sensor_to_segment import SensorToSegmentParams
from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import IS_DOF, JOINTS, SEGMENT, SEGMENTS
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


def prior_covariance(
    params: SensorToSegmentParams, calibration: Calibration, pose_sd: Array
) -> Array:
    """Covariance (SIZE, SIZE) rad^2 before gravity is looked at: mountings from a functional calibration, else by the option."""
    calibrated = [SEGMENT[s] for s in calibration.q_BS_sd]
    sd = misalignment_sd(params, calibration)
    covariance = np.diag(np.concatenate([np.full(MOUNTINGS, sd**2), pose_sd.ravel() ** 2]))
    places = (3 * np.array(calibrated, int)[:, None] + np.arange(3)).ravel()
    covariance[np.ix_(places, places)] = calibration.mounting_covariance()
    return covariance


def pose_angles_sd(params: PoseErrorParams, calibration: Calibration) -> Array:
    """Standard deviations (joints, 3) of the pose's angles, rad: as they were measured, else as a person takes the pose."""
    sd = measured_pose_sd(calibration)
    return np.asarray(np.where(np.isnan(sd), np.radians(params.pose_sd), sd) * IS_DOF)


def measured_pose_sd(calibration: Calibration) -> Array:
    """Standard deviations (joints, 3) of angles that were measured in the pose, rad; NaN elsewhere."""
    return np.array([calibration.pose_sd.get(j.name, (np.nan,) * 3) for j in JOINTS])


def misalignment_sd(params: SensorToSegmentParams, calibration: Calibration) -> float:
    """Standard deviation of a sensor's turn about each axis, rad: as the option says, or as those
    about the two level axes that the pose has seen."""
    seen = np.array([q.misalignment for q in calibration.quality.values()])
    return max(
        float(np.radians(params.misalignment)),
        float(np.sqrt((seen**2).mean() / 2)) if len(seen) else 0.0,
    )


@dataclass(frozen=True)
class Seen:
    """Gravity of all sensors in the hand's frame, as the nominal mounting and the pose have it."""

    up: Array  # (3,) what most of them agree in
    residual: Array  # (3 n,) of each sensor
    H: Array  # (3 n, 3 + SIZE) its derivative by the hand's tilt and the errors


def can_infer(calibration: Calibration) -> bool:
    """Whether the pose alone tells how the sensors sit, and the nominal mounting is known."""
    found_otherwise = calibration.q_BS_sd or calibration.is_functional
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
    on_hand = segments_on_hand(calibration)
    seen = gravity_seen(calibration, on_hand)
    known = np.zeros(pose_sd.shape, bool) if measured is None else measured
    error, P = posterior(Asked.of(seen, pose_sd, known), mounting_sd, gravity_sd)
    up = quat.rotate(quat.exp(error[:3]), seen.up)
    return posed(calibration, on_hand, up, error[3 + MOUNTINGS :].reshape(-1, 3)), P[3:, 3:]


@dataclass(frozen=True)
class Asked:
    """What is asked of a pose, by the content of its arrays: answers are kept by it."""

    up: bytes
    residual: bytes
    H: bytes
    pose_sd: bytes
    measured: bytes

    @classmethod
    def of(cls, seen: Seen, pose_sd: Array, measured: Bools) -> "Asked":
        return cls(*(a.tobytes() for a in (seen.up, seen.residual, seen.H, pose_sd, measured)))

    @property
    def arrays(self) -> tuple[Seen, Array, Bools]:
        """What the sensors see, the standard deviations (joints, 3) of the pose's angles, and which were measured."""
        up, residual, H, pose_sd = map(
            np.frombuffer, (self.up, self.residual, self.H, self.pose_sd)
        )
        measured = np.frombuffer(self.measured, bool)
        seen = Seen(up, residual, H.reshape(-1, 3 + SIZE))
        return seen, pose_sd.reshape(-1, 3), measured.reshape(-1, 3)


@lru_cache(maxsize=4)
def posterior(asked: Asked, mounting_sd: float, gravity_sd: float) -> tuple[Array, Array]:
    """The likeliest errors (3 + SIZE,) and their covariance, kept: a recording is processed backwards and forwards from the same pose."""
    seen, angles_sd, known = asked.arrays
    fits = _fits(seen, mounting_sd, angles_sd, gravity_sd, known)
    error = _mean([(f.weight, f.mean) for f in fits if f.pose_scale == 1.0])
    P = _mean([(f.weight, f.covariance + np.outer(f.mean - error, f.mean - error)) for f in fits])
    for shared in (error, P):
        shared.setflags(write=False)
    return error, P


def second_moment(
    calibration: Calibration,
    mounting_sd: float,
    pose_sd: Array,
    gravity_sd: float,
    measured: Bools | None = None,
) -> Array:
    """Mean square (SIZE, SIZE) rad^2 of the errors of a method that takes the pose as asked for; arguments as of `infer`."""
    seen = gravity_seen(calibration, segments_on_hand(calibration))
    fits = _fits(seen, mounting_sd, pose_sd, gravity_sd, measured)
    return _mean([(f.weight, f.covariance + np.outer(f.mean, f.mean)) for f in fits])[3:, 3:]


@dataclass(frozen=True)
class _Fit:
    """Tilt of the hand, mountings and pose for one pair of sizes."""

    pose_scale: float
    weight: float
    mean: Array  # (3 + SIZE,) rad
    covariance: Array


def _fits(
    seen: Seen, mounting_sd: float, pose_sd: Array, gravity_sd: float, measured: Bools | None
) -> list[_Fit]:
    """For every pair of sizes that is likely enough, and for all with the option's size of the pose."""
    known = np.zeros(pose_sd.shape, bool) if measured is None else measured
    pairs = [*sizes(SCALES, POSE_SCALES, mounting_sd, pose_sd, known)]
    logs = np.array([_log_likelihood(seen, p.variance, gravity_sd) + p.log_prior for p in pairs])
    weights = np.exp(logs - logs.max())
    return [
        _Fit(p.pose_scale, weight, *_condition(seen, p.variance, gravity_sd))
        for p, weight in zip(pairs, weights)
        if weight > UNLIKELY or p.pose_scale == 1.0
    ]


@dataclass(frozen=True)
class Sizes:
    """One pair of sizes of the misalignments and of the pose's errors."""

    pose_scale: float
    variance: Array  # (3 + SIZE,) rad^2, of tilt, mountings and angles
    log_prior: float


def sizes(
    scales: Array, pose_scales: Array, mounting_sd: float, pose_sd: Array, measured: Bools
) -> Iterator[Sizes]:
    """Every pair of scales; angles that were measured keep their standard deviation."""
    scaled = np.concatenate([np.zeros(3 + MOUNTINGS, bool), ~measured.ravel()])
    tilt, mountings = np.full(3, HAND_TILT_SD), np.full(MOUNTINGS, mounting_sd)
    usual = np.concatenate([tilt, mountings, pose_sd.ravel()])
    for scale, pose_scale in product(scales, pose_scales):
        sd = np.where(scaled, pose_scale * usual, usual)
        sd[3 : 3 + MOUNTINGS] *= scale
        prior = (np.log(scale) / SCALE_SD) ** 2 + (np.log(pose_scale) / POSE_SCALE_SD) ** 2
        yield Sizes(float(pose_scale), sd**2, float(-0.5 * prior))


def _mean(weighted: Sequence[tuple[float, Array]]) -> Array:
    """Mean of values with their weights."""
    whole = sum(weight for weight, _ in weighted)
    return np.asarray(np.sum([weight / whole * value for weight, value in weighted], axis=0))


def _log_likelihood(seen: Seen, variance: Array, gravity_sd: float) -> float:
    """Of what the sensors see, the errors averaged over."""
    S = (seen.H * variance) @ seen.H.T + gravity_sd**2 * np.eye(len(seen.H))
    root = np.linalg.cholesky(S)
    white = np.linalg.solve(root, seen.residual)
    return float(-np.log(np.diag(root)).sum() - 0.5 * white @ white)


def _condition(seen: Seen, variance: Array, gravity_sd: float) -> tuple[Array, Array]:
    """Mean and covariance of the errors."""
    HP = seen.H * variance
    S = HP @ seen.H.T + gravity_sd**2 * np.eye(len(HP))
    gain = np.linalg.solve(S, HP).T
    return gain @ seen.residual, np.diag(variance) - gain @ HP


def segments_on_hand(calibration: Calibration) -> Array:
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


def missed_orientations(on_hand: Array) -> Array:
    """Derivative (segments, 3, SIZE) of the segments' orientations, in the hand's frame, by the errors of the pose's angles."""
    missed = np.zeros((len(SEGMENTS), 3, SIZE))
    axes = joint_angles.axes(joint_angles.of_segments(on_hand))
    for j, joint in enumerate(JOINTS):
        p, c, own = SEGMENT[joint.parent], SEGMENT[joint.child], MOUNTINGS + 3 * j
        if joint.name == "wrist":
            missed[p, :, own : own + 3] = -axes[j]
        else:
            missed[c] = missed[p]
            missed[c, :, own : own + 3] += quat.matrix(on_hand[c]) @ axes[j]
    return missed


def gravity_seen(calibration: Calibration, on_hand: Array) -> Seen:
    """A sensor whose mounting errs by m, on a segment that the pose misses by r, sees gravity turned by m - r."""
    missed = missed_orientations(on_hand)
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
    return Seen(up, (seen - up).ravel(), H.reshape(-1, 3 + SIZE))


def _up_on_hand(calibration: Calibration, on_hand: Array, segment: str) -> Array:
    """Upwards (3,) in the hand's frame as one sensor has it with its nominal mounting."""
    up = quat.rotate(quat.conjugate(calibration.q_GS[segment]), VERTICAL)
    q_HS = quat.multiply(on_hand[SEGMENT[segment]], calibration.nominal[segment])
    return np.asarray(quat.rotate(q_HS, up))


def posed(calibration: Calibration, on_hand: Array, up: Array, angles: Array) -> Calibration:
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
