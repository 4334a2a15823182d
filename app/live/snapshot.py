"""A frozen view of a live station, and the snapshot of it that pages get: plain data, clinical words, deg and mm."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handscope.app.devices.glove import GloveState
from handscope.app.devices.ports import is_relay
from handscope.app.live.measured_pose import MeasuredPose
from handscope.app.live.readouts.angle_rows import angle_rows
from handscope.app.live.readouts.trial_review import UNCOUNTED
from handscope.app.live.setup import Setup
from handscope.app.live.wizard import machine
from handscope.app.live.wizard.machine import State, StationStatus, Wizard
from handscope.app.live.wizard.snapshot import wizard_snapshot
from handscope.app.results.quantity_curve import Curve
from handscope.estimators.alignment.functional_movements import CalibrationMovement
from handscope.estimators.alignment.quality import JointQuality
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import FORCE, Stream
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.fault_detection.finding import Suspicion
from handscope.estimators.fault_detection.words import sentence
from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.measures import repetitions, tapping
from handscope.sessions.wire.assembly import StreamCount
from handscope.sessions.wire.frame_losses import FrameLosses
from handscope.sessions.wire.messages import Identity, Status

SCALES = {"repetitions": 1.0} | dict.fromkeys(
    ("rate_wander", "tilt_change", "repeatability", "extent"), 180 / np.pi
)  # shares: per cent
DIGITS = {"rate_wander": 2, "tilt_change": 1}
LEAST = 8.0  # deg: a curve that goes less far shows no repetition


@dataclass(frozen=True, kw_only=True)
class GloveView:
    """The glove at one moment."""

    state: GloveState
    identity: Identity | None
    status: Status | None
    streams: Mapping[int, Stream]  # by stream number
    counts: Mapping[str, StreamCount]  # by stream name
    losses: FrameLosses
    corrupt: int  # frames
    decoding_failures: int
    skipped: int  # blocks that the tracker left out
    method_failures: int
    problem: str  # why this glove cannot be used; empty where it can
    row_age_ms: float | None  # age of the newest pose, from its samples to now


@dataclass(frozen=True, kw_only=True)
class StationView:
    """A live station at one moment, filled by the station under its lock."""

    name: str
    setup: Setup
    wizard: Wizard
    status: StationStatus
    glove: GloveView
    calibration: Calibration | None
    joints: Sequence[JointQuality]  # of that calibration
    movement: CalibrationMovement | None  # calibration movement under review
    self_calibration: Mapping[str, Any] | None  # as FreeMovement gives it
    curve_title: str
    curve_unit: str
    curve_quantity: str
    # of the newest attempt and shortly before: s, mm or deg
    curve_points: Sequence[tuple[float, float]]
    taps: int | None  # of the trial under review; None as long as it is not there
    hand_position: Mapping[str, Any] | None
    followed: bool  # whether the drawn hand is the tracked one
    mirrored: bool  # whether viewers see the hand as in a mirror
    replaying: bool  # whether the drawn hand repeats the trial under review
    trial: int  # number of the review that can be read, 0: none
    measured: str  # quantity of the task that is drawn on the hand; empty where there is none
    target: tuple[float, float] | None  # rad, band of it that the task asks for
    pose_fit: Sequence[Mapping[str, Any]]  # by palm and finger, while a pose is taken
    task_number: Mapping[str, Any] | None  # estimated for a task of UNCOUNTED
    measured_pose: MeasuredPose
    sensor_faults: Sequence[str]
    findings: Sequence[Suspicion]  # of the checks over what has come so far
    trackers: Sequence[Mapping[str, Any]]  # one row per tracked sensor
    ended: bool


def station_snapshot(view: StationView) -> dict[str, Any]:
    """The whole snapshot."""
    wizard = view.wizard
    return {
        "station": view.name,
        "session": view.setup.session,
        "hand": view.setup.hand,
        "continues": view.setup.continues,
        "trackers": list(view.trackers),
        "relayed": is_relay(view.setup.port),
        "wizard": wizard_snapshot(wizard, view.status),
        "glove": _glove(view.glove, view.status),
        "calibration": _calibration(view.calibration, view.joints),
        "step_quality": _quality(view.movement),
        "self_calibration": view.self_calibration,
        "curve": {
            "title": view.curve_title,
            "unit": view.curve_unit,
            "what": view.curve_quantity,
        },
        "sensor_faults": view.sensor_faults if wizard.state is State.CHECKED else [],
        "findings": [_finding(s) for s in view.findings],
        "protocol_faults": [{"reason": fault} for fault in view.setup.faults],
        "numbers": _numbers(view),
        "place": view.hand_position,
        "followed": view.followed,
        "mirrored": view.mirrored,
        "replaying": view.replaying,
        "trial": view.trial,
        "measured": view.measured,
        "target": None if view.target is None else np.degrees(view.target).round().tolist(),
        "pose_fit": list(view.pose_fit),
        "stiff_joints": view.measured_pose.to_json(view.calibration),
        "ended": view.ended,
    }


def station_pulse(
    latest: Trajectory | None, curve: Curve, since: float, row_age_ms: float | None
) -> dict[str, Any]:
    """The light message that follows every pose: newest row, points of the curve later than `since` s."""
    return {
        "angles": [] if latest is None else angle_rows(latest.angles[-1]),
        "points": curve.since(since),
        "what": curve.what,
        "row_age_ms": row_age_ms,
        "sent": time.monotonic(),
    }


def _glove(glove: GloveView, status: StationStatus) -> dict[str, Any]:
    return {
        "state": glove.state.state,
        "reason": glove.state.reason,
        "problem": glove.problem,
        "flowing": status.flowing,
        "name": glove.identity.name if glove.identity else None,
        "firmware": glove.identity.firmware if glove.identity else None,
        "battery": glove.status.battery_percent if glove.status else None,
        "strips": _strips(glove),
        "expected": _expected_streams(glove),
        "forces": _forces(glove),
        "measured": [s for s in SEGMENTS if s in status.measured],
        "frames_lost": glove.losses.wire,
        "frames_corrupt": glove.corrupt,
        "overruns": glove.losses.glove,
        "dropped_live": glove.state.dropped + glove.skipped,
        "method_failures": glove.method_failures,
        "decoding_failures": glove.decoding_failures,
        "recorded": round(status.t, 1) if np.isfinite(status.t) else 0.0,
        "row_age_ms": glove.row_age_ms,
        "sent": time.time(),
    }


def _finding(suspicion: Suspicion) -> dict[str, Any]:
    return {
        "code": suspicion.message.code,
        "severity": suspicion.message.severity,
        "sensors": list(suspicion.sensors),
        "sentence": sentence(suspicion.message),
    }


def _strips(glove: GloveView) -> list[dict[str, Any]]:
    none = StreamCount()
    return [
        {
            "stream": number,
            "name": stream.name,
            "sensors": len(stream.sensors),
            "rate": stream.rate,
            "samples": (count := glove.counts.get(stream.name, none)).samples,
            "lost": count.lost,
            "saturated": count.saturated,
        }
        for number, stream in sorted(glove.streams.items())
    ]


def _expected_streams(glove: GloveView) -> list[str]:
    """Names of streams that the glove declared or that gave samples in this session: a stream missing from these is a fault."""
    return sorted({s.name for s in glove.streams.values()} | set(glove.counts))


def _forces(glove: GloveView) -> list[dict[str, Any]]:
    """Fingers with a force sensor, and the standard deviation of its forces in per cent where it was calibrated."""
    sensors = [
        (s, point)
        for _, s in sorted(glove.streams.items())
        if FORCE in s.quantities
        for point in s.sensors
    ]
    shares = [(point.removesuffix("_tip_force"), s.scale_sd.get(point)) for s, point in sensors]
    return [
        {"finger": finger, "percent": None if share is None else float(f"{100 * share:.2g}")}
        for finger, share in shares
    ]


def _calibration(c: Calibration | None, joints: Sequence[JointQuality]) -> dict[str, Any] | None:
    if c is None:
        return None
    payload: dict[str, Any] = {
        "source": c.description,
        "steps": len(c.steps),
        "warnings": list(c.warnings),
        "joints": [_joint(j) for j in joints],
    }
    if c.quality:
        worst = max(c.quality, key=lambda s: c.quality[s].rate_wander)
        tilted = max(c.quality, key=lambda s: c.quality[s].misalignment)
        payload |= {
            "stillness_deg_s": round(float(np.degrees(c.quality[worst].rate_wander)), 2),
            "least_still": worst,
            "misalignment_deg": round(float(np.degrees(c.quality[tilted].misalignment)), 1),
            "most_misaligned": tilted,
        }
    return payload


def _joint(j: JointQuality) -> dict[str, Any]:
    return {
        "joint": j.joint,
        "grade": j.grade,
        "reason": j.reason,
        "segment": j.segment,
        "deg": round(float(np.degrees(j.value)), 1),
    }


def _quality(movement: CalibrationMovement | None) -> dict[str, float] | None:
    """What a calibration movement is judged by: deg, deg/s, shares in per cent."""
    if movement is None:
        return None
    return {
        name: round(value * SCALES.get(name, 100.0), DIGITS.get(name, 0))
        for name, value in movement.quality.items()
    }


def _numbers(view: StationView) -> list[dict[str, Any]]:
    """Live numbers of the task or calibration movement that runs or was just done."""
    w, points = view.wizard, view.curve_points
    if w.protocol is None or w.state not in (
        *machine.RUNNING,
        State.TASK_PAUSED,
        State.TASK_REVIEW,
        State.STEP_REVIEW,
    ):
        return []
    # free movement has its own meter; non-cyclic steps have no repetitions
    if w.state is State.FREE_RUN or (w.state in machine.STEPPING and not w.protocol.cycle):
        return []
    t, values = np.array(points).reshape(-1, 2).T
    done = values[t > w.onset]
    if len(done) < 3:
        return []
    extremes = [
        _number("largest", float(done.max()), view.curve_unit),
        _number("smallest", float(done.min()), view.curve_unit),
    ]
    if w.protocol.group in UNCOUNTED:
        return [*([dict(view.task_number)] if view.task_number else []), *extremes]
    if view.curve_quantity == "aperture":
        taps = view.taps
        if taps is None:
            taps = tapping.count(tapping.Params(), t, values * 1e-3, w.onset, np.inf)
        return [_number("taps", float(taps), ""), *extremes]
    return [_number("repetitions", float(repetitions.count(done, LEAST)), ""), *extremes]


def _number(name: str, value: float, unit: str) -> dict[str, Any]:
    return {"name": name, "value": round(value, 1), "unit": unit}
