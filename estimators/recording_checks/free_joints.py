"""Joints as the sensors alone have them, with nothing that keeps them within their limits: where a joint would go beyond what joints do, a sensor of it is wrong.

In      a recording, and calibrations from its initial poses
Out     suspicions: which joint, how far beyond, when; two sensors of the finger that are exchanged where that alone explains it
Source  limits: hand/anatomy.py; orientations: methods/m2.py without constraints, its headings kept by the pose
Limits  joints that a pose had bent, as gravity shows them, are taken as bent. What stays within the limits is not seen; people whose joints go farther are asked, too. A sensor that was turned in the pose: alignment/mounting_checks.py
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import log_ndtr

from handscope.estimators.data import trajectory
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import Block, Recording, RecordingView, Stream
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.fault_detection.finding import Message, Suspicion
from handscope.estimators.fault_detection.single_sensors.significance import FALSE_ALARMS
from handscope.estimators.finger_ekf.pose_error import bent_joints
from handscope.estimators.finger_ekf.sensor_to_segment import SensorToSegmentParams
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import (
    ANGLES,
    CHAINS,
    FLEXION,
    HINGES,
    IS_DOF,
    JOINTS,
    LIMITS,
    SEGMENT,
)
from handscope.estimators.methods import m2
from handscope.estimators.numerics.typing import Array
from handscope.estimators.orientation.given_orientations import with_orientations
from handscope.estimators.pipeline.recording_calibration import calibrate
from handscope.estimators.pipeline.run import run
from handscope.estimators.recording_checks.anatomy import check_anatomy
from handscope.estimators.recording_checks.finger_order import UNSURE, check_order

BEYOND = np.radians(15.0)  # of flexion: skin, mounting and a pose that is 5 deg off leave up to 8
SIDEWAYS = np.radians(
    40.0
)  # of what is no freedom of a hinge, and as far as FALSE_ALARMS asks: mounting known from one pose leaves up to 25, in one person of 20 more
WITHIN = np.radians(8.0)
SHARE = 0.02  # of the time that counts
ANGLE_SD = np.radians(4.0)  # of flexion; that of the rest is as much larger as SIDEWAYS is


@dataclass(frozen=True)
class Excess:
    """How far one angle of one joint goes beyond its limit."""

    joint: int
    angle: int
    far: float  # rad, for SHARE of the time
    limit: float  # rad
    span: tuple[float, float]  # s


def check_joints(recording: Recording, calibrations: Sequence[Calibration]) -> list[Suspicion]:
    """What joints would do that joints cannot.

    Parameters
    ----------
    recording : Recording
        Inertial streams, or orientations of a device, in SI units.
    calibrations : sequence of Calibration
        In order of time; without an initial pose nothing is known of the joints' angles.

    Returns
    -------
    list of Suspicion
        `joint.beyond_reach`, or `sensors.exchanged_angles` where two sensors of the finger in each other's place would stay within, or
        `sensors.exchanged_bending` (finger_order.py); then questions about freedoms of other joints (severity `info`).
    """
    if not calibrations or not all(c.source.is_pose for c in calibrations):
        return []
    recording = with_orientations(True, recording)
    params = SensorToSegmentParams()
    bent = [bent_joints.with_bent(c, bent_joints.find(params, c)) for c in calibrations]
    free = move_freely(recording, bent)
    angles = joint_angles.of_segments(free.q_GS)
    found, by_finger = [], dict[str, list[Excess]]()
    for excess in excesses(free, angles):
        by_finger.setdefault(JOINTS[excess.joint].name.partition("_")[0], []).append(excess)
    for finger, beyond in by_finger.items():
        found.append(_exchanged(recording, finger, beyond) or _beyond(max(beyond, key=_surely)))
    found += [
        s for s in check_order(free, angles) if s.sensors[0].partition("_")[0] not in by_finger
    ]
    asked = [s for s in check_anatomy(free, angles) if s.message.values["joint"] not in HINGES]
    return [*found, *asked]


def move_freely(recording: Recording, calibrations: Sequence[Calibration]) -> Trajectory:
    """The hand as its sensors have it, without what joints can and cannot do."""
    params = m2.Params(constraints=False)
    return trajectory.join(list(run(m2, params, calibrations, recording)), recording.hand)


def excesses(free: Trajectory, angles: Array) -> Iterator[Excess]:
    """Angles (n, joints, 3) of hinges that are beyond their limits for more than SHARE of the time."""
    sure = (free.flags & UNSURE) == 0
    for k, joint in enumerate(JOINTS):
        known = sure[:, SEGMENT[joint.parent]] & sure[:, SEGMENT[joint.child]]
        if joint.name not in HINGES or not known.any():
            continue
        for a in range(3):
            if a == FLEXION or not IS_DOF[k, a]:
                yield from _excess(free.t[known], angles[known, k, a], k, a)


def _excess(t: Array, angle: Array, joint: int, a: int) -> Iterator[Excess]:
    least = BEYOND if IS_DOF[joint, a] else SIDEWAYS
    for sign, limit in zip((-1.0, 1.0), LIMITS[joint, a]):
        off = sign * (angle - limit)
        off = off[np.isfinite(off)]
        if off.max(initial=-np.inf) <= least:
            continue
        if (far := float(np.quantile(off, 1 - SHARE))) > least:
            there = t[np.isfinite(angle)][off > 0.5 * least]
            excess = Excess(joint, a, far, float(limit), (float(there[0]), float(there[-1])))
            if IS_DOF[joint, a] or _p_value(excess) < FALSE_ALARMS:
                yield excess


def _surely(excess: Excess) -> float:
    """In standard deviations."""
    is_freedom = IS_DOF[excess.joint, excess.angle]
    return float(excess.far / (ANGLE_SD * (1.0 if is_freedom else SIDEWAYS / BEYOND)))


def _p_value(excess: Excess) -> float:
    return float(min(1.0, 2 * 3 * len(HINGES) * np.exp(log_ndtr(-_surely(excess)))))


def _beyond(excess: Excess) -> Suspicion:
    joint = JOINTS[excess.joint]
    values: dict[str, float | str] = {
        "joint": joint.name,
        "angle": ANGLES[excess.angle],
        "beyond_deg": float(np.degrees(excess.far)),
        "limit_deg": float(np.degrees(excess.limit)),
        "start": excess.span[0],
        "stop": excess.span[1],
    }
    sensors, p = (joint.parent, joint.child), _p_value(excess)
    return Suspicion(Message("joint.beyond_reach", values, "warning"), sensors, (excess.span,), p)


def _exchanged(recording: Recording, finger: str, beyond: Sequence[Excess]) -> Suspicion | None:
    """The one exchange of two sensors of the finger under which all its joints stay within their limits."""
    present = {s for b in recording.streams for s in b.sensors}
    flexed = [e for e in beyond if e.angle == FLEXION]
    fits = [
        pair
        for pair in itertools.combinations((s for s in CHAINS[finger] if s in present), 2)
        if flexed and _stays_within(Exchanged(recording, dict((pair, pair[::-1]))), finger)
    ]
    if len(fits) != 1:
        return None
    (pair,) = fits
    p, span = min(_p_value(e) for e in flexed), (-np.inf, np.inf)
    far = float(np.degrees(max(e.far for e in flexed)))
    values: dict[str, float | str] = {"first": pair[0], "second": pair[1], "beyond_deg": far}
    message = Message("sensors.exchanged_angles", values, "warning")
    return Suspicion(message, pair, (span,), p, {"exchange": pair})


def _stays_within(recording: "Exchanged", finger: str) -> bool:
    try:
        calibrations, _ = calibrate(m2.Params(), recording)
    except InputError:
        return False
    free = move_freely(recording, calibrations)
    own = [k for k, j in enumerate(JOINTS) if j.child in CHAINS[finger] and j.name in HINGES]
    angle = joint_angles.of_segments(free.q_GS)[:, own, FLEXION]
    low, high = LIMITS[own, FLEXION].T
    off = np.nanquantile(np.maximum(low - angle, angle - high), 1 - SHARE, axis=0)
    return bool((off < WITHIN).all())


@dataclass(frozen=True)
class Exchanged(RecordingView):
    """A recording in which sensors are read as those of other segments."""

    to: Mapping[str, str]  # name by name that is written

    @property
    def streams(self) -> tuple[Stream, ...]:
        return tuple(self._read(s) for s in self.recording.streams)

    def blocks(self) -> Iterator[Block]:
        """All samples, under the other names."""
        return (replace(b, stream=self._read(b.stream)) for b in self.recording.blocks())

    def _read(self, stream: Stream) -> Stream:
        return replace(stream, sensors=tuple(self.to.get(s, s) for s in stream.sensors))
