"""Joints that were bent in the initial pose, as those of a finger that cannot be straightened: what gravity in all sensors tells of them.

In      a Calibration from a pose, with the nominal mounting that the pose was compared with; standard deviations of misalignments and of the pose's angles
Out     the joints whose flexion was far from what was asked for, with the angle; the pose with them bent
Source  ours: marginal likelihoods (Kass & Raftery 1995, J Am Stat Assoc 90:773) of sets of joints that are bent and sensors that sit turned, in the linear Gaussian model of
        pose_inference.py. Beyond a bent joint the finger points elsewhere as a whole, a sensor that sits turned does so alone
Limits  first order in the angles. One last joint that is bent looks like its sensor that sits turned, all MCP joints alike like the hand's: these show from larger angles on, if at all.
        The thumb's CMC joint and the wrist are not asked
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from handscope.estimators.alignment.initial_pose import PoseErrorParams
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.finger_ekf.pose_error import pose_inference
from handscope.estimators.finger_ekf.pose_error.pose_inference import MOUNTINGS, Asked, Seen
from handscope.estimators.finger_ekf.sensor_to_segment import SensorToSegmentParams
from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import (
    FINGERS,
    FLEXION,
    HINGES,
    JOINT,
    JOINTS,
    SEGMENT,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Bools

BENT_SD = np.radians(25.0)  # of the flexion of a joint that is bent
TURNED_SD = np.radians(25.0)  # about each axis, of a sensor that sits turned
RARE = np.log(0.01)  # of a set of joints that are bent, or of a sensor that sits turned, by itself
SURE = np.log(20.0)  # how much likelier than the best explanation without a bent joint
SCALES = 2.0 ** np.arange(-2.0, 2.01, 0.5)  # of the misalignments against the option
POSE_SCALES = 2.0 ** np.arange(-1.0, 2.01, 0.5)  # of the pose's errors against the option
MOST = 8  # explanations that a pose may have
HINGED = tuple(JOINT[j] for j in HINGES)
LONG = FINGERS[1:]
LEVELS = (("mcp",), ("pip",), ("dip",), ("pip", "dip"), ("mcp", "pip", "dip"))
TOGETHER = [[JOINT[f"{f}_{level}"] for f in LONG for level in levels] for levels in LEVELS] + [
    [JOINT[f"{f}_{level}"] for level in LEVELS[-1]] for f in LONG
]  # joints that a hand bends alike: a row of all fingers, or a finger

Explanation = frozenset[int]  # of joints, and of sensors behind them: len(JOINTS) + their segment


@dataclass(frozen=True)
class BentJoint:
    """A joint that was bent in the pose."""

    joint: str
    angle: float  # rad of flexion, beyond what was asked for
    sd: float  # rad


def find(params: SensorToSegmentParams, calibration: Calibration) -> tuple[BentJoint, ...]:
    """Joints that a pose had bent, the proximal ones first; none where how sensors sit is known otherwise."""
    if not pose_inference.can_infer(calibration):
        return ()
    seen = pose_inference.gravity_seen(calibration, pose_inference.segments_on_hand(calibration))
    pose_sd = pose_inference.pose_angles_sd(params, calibration)
    measured = ~np.isnan(pose_inference.measured_pose_sd(calibration))
    mounting_sd, gravity_sd = map(float, np.radians([params.misalignment, params.angle_sd]))
    worn = tuple(SEGMENT[s] for s in calibration.q_GS if s != "forearm")
    return _found(Asked.of(seen, pose_sd, measured), mounting_sd, gravity_sd, worn)


def with_bent(calibration: Calibration, bent: Sequence[BentJoint]) -> Calibration:
    """The pose with these joints bent, upwards being what the sensors agree in then."""
    if not bent:
        return calibration
    on_hand, turned = pose_inference.segments_on_hand(calibration), np.zeros((len(JOINTS), 3))
    for b in bent:
        turned[JOINT[b.joint], FLEXION] = b.angle
    q_pc = joint_angles.compose(joint_angles.of_segments(on_hand) + turned)
    on_bent = forward_kinematics.segments_on(quat.IDENTITY, q_pc)
    up = pose_inference.gravity_seen(calibration, on_bent).up
    return pose_inference.posed(calibration, on_hand, up, turned)


def pose_angles_sd(
    params: PoseErrorParams, calibration: Calibration, bent: Iterable[BentJoint]
) -> tuple[Array, Bools]:
    """Standard deviations (joints, 3) of the pose's angles, rad, where some joints were bent; and of which angles that is known, rather than how exactly a person takes a pose."""
    sd = pose_inference.pose_angles_sd(params, calibration)
    known = ~np.isnan(pose_inference.measured_pose_sd(calibration))
    at = [JOINT[b.joint] for b in bent]
    sd[at, FLEXION], known[at, FLEXION] = BENT_SD, True
    return sd, known


@lru_cache(maxsize=8)
def _found(
    pose: Asked, mounting_sd: float, gravity_sd: float, worn: tuple[int, ...]
) -> tuple[BentJoint, ...]:
    """Kept: method, standard deviations and checks ask alike."""
    seen, angles_sd, known = pose.arrays
    asked = [j for j in HINGED if _is_between(j, worn) and not known[j, FLEXION]]
    evidence = _Evidence.of(seen, mounting_sd, angles_sd, gravity_sd, known, asked, worn)
    turned = [frozenset({len(JOINTS) + s}) for s in worn]
    bends = [frozenset({j}) for j in asked] + [frozenset(g) & {*asked} for g in TOGETHER]
    _, without = _explained(evidence, turned)
    best, likely = _explained(evidence, [*turned, *filter(None, bends)])
    if likely - without < SURE:
        return ()
    return tuple(evidence.bends(best))


def _is_between(joint: int, worn: Collection[int]) -> bool:
    return {SEGMENT[JOINTS[joint].parent], SEGMENT[JOINTS[joint].child]} <= {*worn}


def _explained(evidence: "_Evidence", by: Sequence[Explanation]) -> tuple[Explanation, float]:
    """What explains the pose best, one thing after the other, and the logarithm of its probability."""
    best, likely = Explanation(), evidence.log(Explanation())
    for count in range(1, MOST + 1):
        more = [best | one for one in by if not one <= best]
        logs = [evidence.log(each) + count * RARE for each in more]
        if not logs or max(logs) <= likely:
            break
        best, likely = more[int(np.argmax(logs))], max(logs)
    return best, likely


@dataclass(frozen=True)
class _Evidence:
    """How well explanations fit what the sensors see, for every pair of sizes (K) of misalignments and pose errors.

    Each direction that an explanation frees has a standard deviation of its own; what else errs is averaged over.
    """

    columns: dict[int, list[int]]  # of `products`, of every joint and sensor
    sd: Array  # (C,) rad, of what they free
    products: Array  # (K, C + 1, C + 1) of these directions, the residual last, in standard deviations of what else errs
    logs: Array  # (K,) of the pose's probability without an explanation
    known: dict[Explanation, float]  # logarithms, so far

    @classmethod
    def of(
        cls,
        seen: Seen,
        mounting_sd: float,
        pose_sd: Array,
        gravity_sd: float,
        known: Bools,
        joints: Sequence[int],
        worn: Sequence[int],
    ) -> "_Evidence":
        turned = [3 + 3 * s + axis for s in worn for axis in range(3)]
        at = [3 + MOUNTINGS + 3 * j + FLEXION for j in joints]
        sd = np.repeat([BENT_SD, TURNED_SD], [len(at), len(turned)])
        directions = np.column_stack([seen.H[:, [*at, *turned]] * sd, seen.residual])
        products, logs = [], []
        for pair in pose_inference.sizes(SCALES, POSE_SCALES, mounting_sd, pose_sd, known):
            S = (seen.H * pair.variance) @ seen.H.T + gravity_sd**2 * np.eye(len(seen.H))
            root = np.linalg.cholesky(S)
            white = np.linalg.solve(root, directions)
            products.append(white.T @ white)
            likelihood = -np.log(np.diag(root)).sum() - 0.5 * products[-1][-1, -1]
            logs.append(likelihood + pair.log_prior)
        columns = {j: [k] for k, j in enumerate(joints)}
        for k, s in enumerate(worn):
            columns[len(JOINTS) + s] = [len(at) + 3 * k + axis for axis in range(3)]
        return cls(columns, sd, np.array(products), np.array(logs), {})

    def log(self, explanation: Explanation) -> float:
        """Logarithm of the pose's probability by an explanation."""
        if explanation not in self.known:
            logs = self._fitted(explanation)[2]
            self.known[explanation] = float(logs.max() + np.log(np.exp(logs - logs.max()).sum()))
        return self.known[explanation]

    def bends(self, explanation: Explanation) -> list[BentJoint]:
        """How far the joints of an explanation are bent by it."""
        if not explanation:
            return []
        mean, covariance, logs = self._fitted(explanation)
        share = np.exp(logs - logs.max()) / np.exp(logs - logs.max()).sum()
        at = [c for one in sorted(explanation) for c in self.columns[one]]
        angle = share @ mean
        variance = np.diagonal(covariance, axis1=1, axis2=2) + (mean - angle) ** 2
        angle, sd = self.sd[at] * angle, self.sd[at] * np.sqrt(share @ variance)
        joints = sorted(explanation & {*HINGED})  # they come before the sensors
        return [BentJoint(JOINTS[j].name, float(a), float(s)) for j, a, s in zip(joints, angle, sd)]

    def _fitted(self, explanation: Explanation) -> tuple[Array, Array, Array]:
        """What is freed (K, c), in its standard deviations, its covariance, and the logarithms (K,)."""
        at = np.array([c for one in sorted(explanation) for c in self.columns[one]], int)
        information = self.products[:, at[:, None], at] + np.eye(len(at))
        by = self.products[:, at, -1]
        covariance: Array = np.linalg.inv(information).astype(float)
        mean = (covariance @ by[..., None])[..., 0]
        logs = self.logs - 0.5 * np.linalg.slogdet(information)[1] + 0.5 * (by * mean).sum(axis=1)
        return mean, covariance, np.asarray(logs, float)
