"""From a recording to the hand's movement: find its calibration events, calibrate, run the method."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np

from handscope.estimators.alignment import (
    functional_calibration,
    functional_movements,
    initial_pose,
    mounting_checks,
)
from handscope.estimators.alignment.functional_movements import STEPS, CalibrationMovement
from handscope.estimators.data import trajectory
from handscope.estimators.data.calibration import Calibration, PriorCalibration
from handscope.estimators.data.findings import Finding, whole_streams
from handscope.estimators.data.samples import MAG, Block, Event, Recording, join
from handscope.estimators.data.trajectory import FLAG_WORDS, Flag, Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.fault_detection.finding import Suspicion
from handscope.estimators.force import fingertip_forces
from handscope.estimators.hand.anatomy import SEGMENT, SEGMENTS
from handscope.estimators.magnet.pipeline import hand_position
from handscope.estimators.orientation.resampling import measure_rates
from handscope.estimators.pipeline.run import run
from handscope.estimators.sensors import fault_detection, saturation

WITHOUT_POSE = "the recording has no initial_pose event"
BEGINNING = 3.0  # s of samples that tell a rate where there is no pose
WORTH_SAYING = 0.0005  # share of flagged samples that prints as 0.1 %


@dataclass(frozen=True)
class Processed:
    """What a method made of a recording."""

    trajectory: Trajectory
    calibrations: tuple[Calibration, ...]
    warnings: tuple[str, ...]
    findings: tuple[Finding, ...] = ()  # faults of sensors; their segments are flagged
    method_messages: tuple[
        str, ...
    ] = ()  # of the warnings those of the method or of calibrating, in their order
    suspicions: tuple[
        Suspicion, ...
    ] = ()  # of the checks (check.py), where they ran; among findings


def process(
    method: ModuleType,
    params: Any,
    recording: Recording,
    calibration_recording: Recording | None = None,
    progress: Callable[[float], None] = lambda share: None,
    known: PriorCalibration | None = None,
) -> Processed:
    """Run a method over a recording; `progress` hears the share done, 0 to 1; `known`: from an earlier self-calibration.

    InputError where the recording cannot be calibrated.
    """
    _require_magnetometers(params, recording)
    scales_declared = _limits_known(recording)
    if scales := saturation.find_full_scales(whole_of(recording)):
        recording = saturation.WithFullScales(recording, scales)
    if hasattr(method, "solve"):
        movement, calibrations, warnings = method.solve(params, recording, progress)
    else:
        calibrations, warnings = (
            calibrate(params, recording, calibration_recording)
            if method.NEEDS_POSE
            else _without_pose(recording)
        )
        if known is not None:
            calibrations = [with_known(c, known) for c in calibrations]
        movement = trajectory.join(
            _with_progress(
                run(method, params, calibrations, recording), _span(recording), progress
            ),
            recording.hand,
        )
    findings = findings_of(recording, calibrations)
    if method.NEEDS_POSE:
        flag_guesses(movement, calibrations)
    flag_faults(
        movement, findings, [c.t for c in calibrations], getattr(params, "MAGNETOMETER", False)
    )
    movement, of_forces = fingertip_forces.attach_forces(
        fingertip_forces.ForceParams(),
        movement,
        whole_of(recording),
        recording.mounting,
        calibrations,
    )
    movement, of_place = hand_position.add_hand_position(
        hand_position.PlaceParams(),
        movement,
        whole_of(recording),
        recording.plate,
        recording.mounting,
    )
    fault_messages = [f.message for f in findings if f.kind != "saturated" or not scales_declared]
    messages = [
        *recording.warnings,
        *warnings,
        *(w for c in calibrations for w in c.warnings),
        *fault_messages,
        *_flag_warnings(movement),
    ]
    messages += [*of_forces, *of_place]
    return Processed(
        movement, tuple(calibrations), tuple(dict.fromkeys(messages)), findings, tuple(warnings)
    )


def with_known(pose: Calibration, known: PriorCalibration) -> Calibration:
    """The pose of a hand whose lengths, or also whose sensors' seats, were found before; the pose tells the rest. InputError for another hand."""
    if pose.hand != known.hand:
        raise InputError(
            f"the calibration is of the {known.hand} hand, the recording of the {pose.hand} one"
        )
    if pose.source == "none":
        raise InputError(
            f"{WITHOUT_POSE}: the calibration tells how sensors sit, not where they point; record 3 s of the pose first"
        )
    mounting = {s: q for s, q in known.q_BS.items() if s in pose.q_BS}
    mounted = (
        functional_calibration.apply_mounting(pose, {"hand": pose.q_BS["hand"]} | mounting)
        if mounting and "hand" in pose.q_BS
        else pose
    )
    measured = pose.geometry.measured | set(known.lengths)
    geometry = replace(
        pose.geometry, lengths={**pose.geometry.lengths, **known.lengths}, measured=measured
    )
    return replace(
        mounted,
        geometry=geometry,
        gyr_bias={**known.gyr_bias, **pose.gyr_bias},
        source=f"{pose.source}, {'seats and lengths' if mounting else 'lengths'} from self-calibration",
    )


def findings_of(recording: Recording, calibrations: Sequence[Calibration]) -> tuple[Finding, ...]:
    """What is wrong with single sensors; where there is an initial pose, also with how they sit."""
    blocks = whole_of(recording)
    poses = [c for c in calibrations if c.source.startswith("initial pose")]
    if not poses:
        return tuple(fault_detection.check(blocks, (0.0, 0.0)))
    found = fault_detection.check(blocks, (poses[0].t, poses[0].end))
    broken = {f.sensor for f in found if f.severity == "fault" and f.kind != "magnetometer"}
    pose = replace(
        initial_pose.pose_of(_poses(recording.events)[0]),
        onset=poses[0].t,
        duration=poses[0].end - poses[0].t,
    )
    mounting = {
        **recording.mounting,
        **{s: poses[0].q_BS[s] for s in poses[0].q_BS_sd},
    }  # told by movements: how it sits is known
    return (
        *found,
        *(
            f
            for f in mounting_checks.check(blocks, mounting, pose, recording.events)
            if f.sensor not in broken
        ),
    )


def whole_of(recording: Recording) -> list[Block]:
    """One block a stream; a recording that has them so is not copied."""
    if isinstance(recording, saturation.WithFullScales):
        return [recording.scaled(b) for b in whole_of(recording.recording)]
    streams = getattr(recording, "samples", None)
    return [
        b
        for b in (whole_streams(list(recording.blocks())) if streams is None else streams.values())
        if len(b.t)
    ]


def flag_faults(
    movement: Trajectory, findings: Sequence[Finding], poses: Sequence[float], magnetometer: bool
) -> None:
    """Mark the segments of faulty sensors, of magnetometers only where the method uses them; clipping by the flag that it has.

    What a sensor missed while it stood still is missing until the next pose (s): its heading counts as lost.
    """
    for finding in findings:
        flag = (
            Flag.SATURATED
            if finding.kind == "saturated"
            else Flag.FAULTY
            if finding.severity == "fault"
            else None
        )
        if (
            flag is not None
            and finding.sensor in SEGMENT
            and (finding.kind != "magnetometer" or magnetometer)
        ):
            for start, stop in finding.spans:
                _mark(movement, finding.sensor, start, stop, flag)
                if finding.kind in ("dead_axis", "stuck"):
                    later = min((t for t in poses if t > start), default=np.inf)
                    _mark(
                        movement,
                        finding.sensor,
                        *((start, later) if start >= poses[0] else (-np.inf, min(stop, poses[0]))),
                        Flag.HEADING_LOST,
                    )


def flag_guesses(movement: Trajectory, calibrations: Sequence[Calibration]) -> None:
    """Mark what rests on defaults instead of a calibration."""
    ends = [*(c.t for c in calibrations[1:]), np.inf]
    for calibration, end in zip(calibrations, ends):
        for segment in calibration.q_BS if calibration.source == "none" else ():
            _mark(
                movement,
                segment,
                -np.inf if calibration is calibrations[0] else calibration.t,
                end,
                Flag.UNCALIBRATED,
            )


def _mark(movement: Trajectory, segment: str, start: float, stop: float, flag: Flag) -> None:
    first, last = np.searchsorted(movement.t, [start - 1e-9, stop + 1e-9])
    movement.flags[first:last, SEGMENT[segment]] |= np.uint8(flag)


def _limits_known(recording: Recording) -> bool:
    """Whether the fusion itself sees clipping, so that it is told by share already."""
    return all(s.full_scale for s in recording.streams if s.inertial)


def _with_progress(
    pieces: Iterator[Trajectory], span: tuple[float, float], progress: Callable[[float], None]
) -> Iterator[Trajectory]:
    for piece in pieces:
        if len(piece):
            progress(
                float(np.clip((piece.t[-1] - span[0]) / max(span[1] - span[0], 1e-9), 0.0, 1.0))
            )
        yield piece


def calibrate(
    params: Any, recording: Recording, other: Recording | None = None
) -> tuple[list[Calibration], list[str]]:
    """Calibrations in order of time from the recording's initial poses, or from another recording's; a bad pose beside a good one is a warning."""
    found: list[Calibration] = []
    refused: list[str] = []
    for event in _poses(recording.events):
        try:
            found.append(_from_pose(params, recording, event))
        except InputError as problem:
            refused.append(str(problem))
    if found and other is None:
        pieces, spoilt = functional_pieces(params, recording, found)
        return _functional(params, recording, pieces, found), [
            *refused,
            *_flat_hand_warning(recording),
            *spoilt,
        ]
    if other is None and (defaults := _defaults(params, recording)):
        return [defaults], refused
    if other is None:
        raise InputError(
            refused[0]
            if refused
            else f"{WITHOUT_POSE}; record 3 s of it, or take one from another recording with --calibration"
        )
    if other.hand != recording.hand:
        raise InputError(
            f"the calibration recording is of the {other.hand} hand, the recording of the {recording.hand} one"
        )
    borrowed, more = calibrate(params, other)
    return _borrow(recording, borrowed[-1], found), refused + more


def _defaults(params: Any, recording: Recording) -> Calibration | None:
    """What somebody decided to go on with who could not calibrate: an annotation with `calibration: none` says when."""
    for event in (
        e
        for e in recording.events
        if e.trial_type == "annotation" and e.details.get("calibration") == "none"
    ):
        window = _window(recording, event.onset, event.end)
        return initial_pose.guess_calibration(
            params, recording.hand, recording.geometry, recording.mounting, window
        )
    return None


def functional_pieces(
    params: Any, recording: Recording, poses: Sequence[Calibration]
) -> tuple[dict[str, CalibrationMovement], list[str]]:
    """Of each functional step among the events the last one that was done well; sentences of the steps that never were."""
    if not getattr(params, "functional", False) or params.alignment == "heading":
        return {}, []
    good: dict[str, CalibrationMovement] = {}
    spoilt: dict[str, CalibrationMovement] = {}
    for event in sorted(
        (e for e in recording.events if e.trial_type in STEPS), key=lambda e: e.onset
    ):
        bias = ([c for c in poses if c.t <= event.onset] or list(poses[:1]))[-1].gyr_bias
        piece = functional_movements.measure(
            params,
            event.trial_type,
            _window(recording, event.onset, event.end),
            event.onset,
            event.end,
            bias,
        )
        (spoilt if piece.problems else good)[piece.step] = piece
    return good, [
        problem for step, piece in spoilt.items() if step not in good for problem in piece.problems
    ]


def _functional(
    params: Any,
    recording: Recording,
    pieces: Mapping[str, CalibrationMovement],
    poses: list[Calibration],
) -> list[Calibration]:
    """The poses' calibrations with what the pieces tell of the sensors' mounting."""
    return (
        [functional_calibration.combine(params, pieces, c, recording.mounting) for c in poses]
        if pieces
        else poses
    )


def _flat_hand_warning(recording: Recording) -> list[str]:
    if all(e.trial_type == "flat_hand" for e in _poses(recording.events)):
        return [
            "the recording has no initial_pose event: its flat hand serves as that, the thumb aligned with the fingers where its angles are not told"
        ]
    return []


def _without_pose(recording: Recording) -> tuple[list[Calibration], list[str]]:
    sensors = [s for stream in recording.streams if stream.inertial for s in stream.sensors]
    start, beginning = _beginning(recording)
    rates = measure_rates(beginning)
    known = initial_pose.uncalibrated(
        recording.hand, recording.geometry, recording.mounting, sensors, start
    )
    return [
        replace(known, rates=rates, warnings=initial_pose.rate_warnings(rates, recording.streams))
    ], []


def _require_magnetometers(params: Any, recording: Recording) -> None:
    """InputError where the method takes headings from magnetometers and there are none."""
    if getattr(params, "MAGNETOMETER", False) and not any(
        MAG in s.quantities for s in recording.streams
    ):
        raise InputError(
            "the method takes headings from magnetometers and the recording has none; use m2"
        )


def _poses(events: Sequence[Event]) -> list[Event]:
    """The initial poses in order of time; without any, the flat hands of a functional calibration."""
    ordered = sorted(events, key=lambda e: e.onset)
    return [e for e in ordered if e.trial_type == "initial_pose"] or [
        e for e in ordered if e.trial_type == "flat_hand"
    ]


def _from_pose(params: Any, recording: Recording, event: Event) -> Calibration:
    pose = initial_pose.pose_of(event)
    window = _window(recording, pose.onset, pose.end)
    return initial_pose.calibrate(
        params, recording.hand, recording.geometry, recording.mounting, window, pose
    )


def _window(recording: Recording, start: float, stop: float) -> list[Block]:
    """The samples between two instants, one block a stream."""
    parts: dict[str, list[Block]] = {}
    for block in recording.blocks():
        if len((part := block.between(start, stop)).t):
            parts.setdefault(block.stream.name, []).append(part)
    return [join(p) for p in parts.values()]


def _beginning(recording: Recording) -> tuple[float, list[Block]]:
    """When the inertial samples begin (s), and the first of them, one block a stream."""
    start = min(
        (float(b.t[0]) for b in recording.blocks() if b.stream.inertial and len(b.t)), default=0.0
    )
    return start, [b for b in _window(recording, start, start + BEGINNING) if b.stream.inertial]


def _borrow(recording: Recording, other: Calibration, own: list[Calibration]) -> list[Calibration]:
    """The other recording's mounting and biases; headings from this recording's own poses, or from assuming that it begins in the pose."""
    if own:
        mounted = [
            functional_calibration.apply_mounting(c, other.q_BS) if other.steps else c for c in own
        ]
        return [
            replace(
                c,
                q_BS={**c.q_BS, **other.q_BS},
                q_BS_sd=other.q_BS_sd,
                q_BS_covariance=other.q_BS_covariance,
                steps=other.steps,
                gyr_bias={**other.gyr_bias, **c.gyr_bias},
                source="initial pose, mounting from another recording",
            )
            for c in mounted
        ]
    start, beginning = _beginning(recording)
    q_GS, rates = (
        initial_pose.reorient(other, [b.between(start, start + 0.5) for b in beginning]),
        measure_rates(beginning),
    )
    warning = (
        f"{WITHOUT_POSE}: headings assume that it begins in the pose of the calibration recording"
    )
    return [
        replace(
            other,
            t=start,
            end=start + 0.5,
            q_GS=q_GS,
            geometry=recording.geometry,
            source="another recording",
            warnings=(
                *other.warnings,
                *initial_pose.rate_warnings(rates, recording.streams),
                warning,
            ),
            rates=rates,
        )
    ]


def _span(recording: Recording) -> tuple[float, float]:
    spans = [(b.t[0], b.t[-1]) for b in recording.blocks() if len(b.t)]
    return min(s for s, _ in spans), max(e for _, e in spans)


def _flag_warnings(movement: Trajectory) -> list[str]:
    """One sentence for all segments of which the same is to be said."""
    segments_by_warning: dict[str, list[str]] = {}
    present = int(np.bitwise_or.reduce(movement.flags, axis=None))
    for flag, what in FLAG_WORDS.items():
        shares = (
            ((movement.flags & flag) != 0).mean(axis=0)
            if present & flag
            else np.zeros(len(SEGMENTS))
        )
        for segment, share in zip(SEGMENTS, shares):
            if share >= WORTH_SAYING:
                segments_by_warning.setdefault(
                    f"{what} in {100 * share:.1f} % of the samples", []
                ).append(segment)
    return [
        f"{', '.join(segments)}: {warning}" for warning, segments in segments_by_warning.items()
    ]
