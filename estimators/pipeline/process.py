"""From a recording to the hand's movement: find its calibration events, calibrate, run the
method."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from handscope.estimators.alignment import (
    initial_pose,
    mounting_checks,
)
from handscope.estimators.data import trajectory
from handscope.estimators.data.calibration import Calibration, PriorCalibration
from handscope.estimators.data.findings import Finding, whole_streams
from handscope.estimators.data.held_contact import ContactOutcome
from handscope.estimators.data.magnet_streams import find_magnetometers
from handscope.estimators.data.mounting_change import MountingChange
from handscope.estimators.data.samples import (
    FORCE,
    ORIENTATION,
    TORQUE,
    Block,
    Recording,
    WholeRecording,
)
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.fault_detection.finding import NOTHING_UNTESTED, Suspicion, Untested
from handscope.estimators.fault_detection.words import as_findings, sentence
from handscope.estimators.numerics.native_libraries import freed_memory_returned
from handscope.estimators.orientation.given_orientations import (
    GivenParams,
    rate_orientations,
    with_orientations,
)
from handscope.estimators.pipeline.contacts import contact_messages, with_contacts
from handscope.estimators.pipeline.coupled_segments import flag_coupled, remembered, restarts_of
from handscope.estimators.pipeline.flags import (
    flag_faults,
    flag_guesses,
    flag_warnings,
    is_fault,
)
from handscope.estimators.pipeline.losses import mark_losses
from handscope.estimators.pipeline.method import (
    AnyMethod,
    notices_mounting_changes,
    solves_whole,
    steps_through,
    uses_contacts,
)
from handscope.estimators.pipeline.mounting_changes import of_change
from handscope.estimators.pipeline.recording_calibration import (
    calibrate,
    initial_poses,
    require_magnetometers,
    with_known,
    without_pose,
)
from handscope.estimators.pipeline.run import run
from handscope.estimators.sensors import fault_detection, saturation

P = TypeVar("P")


@dataclass(frozen=True)
class Processed:
    """What a method made of a recording."""

    trajectory: Trajectory
    calibrations: tuple[Calibration, ...]
    warnings: tuple[str, ...]
    findings: tuple[Finding, ...] = ()  # faults of sensors; their segments are flagged
    # of the warnings those of the method or of calibrating, in their order
    method_messages: tuple[str, ...] = ()
    # of the method, and of the checks (check.py) where they ran; among findings
    suspicions: tuple[Suspicion, ...] = ()
    untested: Untested = NOTHING_UNTESTED  # what the checks, where they ran, could not have found
    restarts: tuple[float, ...] | None = None  # s, of a filter that couples sensors: restarts_of


def process(
    method: AnyMethod[P],
    params: P,
    recording: Recording,
    calibration_recording: Recording | None = None,
    progress: Callable[[float], None] = lambda share: None,
    known: PriorCalibration | None = None,
) -> Processed:
    """Run a method over a recording; `progress` hears the share done, 0 to 1; `known`: from an
    earlier self-calibration.

    InputError where the recording cannot be calibrated.
    """
    takes = method.CAPABILITIES.takes_orientations
    recording = with_orientations(takes, recording)
    if calibration_recording is not None:
        calibration_recording = with_orientations(takes, calibration_recording)
    require_magnetometers(method.CAPABILITIES, recording)
    scales_declared = _limits_known(recording)
    recording = saturation.with_full_scales(recording, whole_of(recording))
    ends: list[object] = []  # the method's states
    movement, calibrations, warnings = _estimate(
        method, params, recording, calibration_recording, progress, known, ends.append
    )
    noticed = tuple(of_change(c) for c in _mounting_changes(method, ends))
    findings = (*findings_of(recording, calibrations), *as_findings(noticed))
    measured = [b for b in whole_of(recording) if ORIENTATION not in b.stream.quantities]
    if method.CAPABILITIES.needs_pose:
        flag_guesses(movement, calibrations)
    flag_faults(
        movement,
        findings,
        [c.t for c in calibrations],
        method.CAPABILITIES.needs_magnetometers,
    )
    movement, of_forces = _attach_forces(movement, measured, recording, calibrations)
    movement, of_place = _add_hand_position(movement, measured, recording)
    fault_messages = [f.message for f in findings if f.kind != "saturated" or not scales_declared]
    messages = [
        *recording.warnings,
        *warnings,
        *map(sentence, contact_messages(_contact_outcomes(method, ends))),
        *(w for c in calibrations for w in c.warnings),
        *fault_messages,
        *flag_warnings(movement),
    ]
    messages += [*of_forces, *of_place]
    mark_losses(movement, whole_of(recording))
    restarts = restarts_of(method.CAPABILITIES, calibrations)
    if restarts is not None:
        for f in (f for f in findings if is_fault(f, method.CAPABILITIES.needs_magnetometers)):
            flag_coupled(movement, [f.sensor], [remembered(span, restarts) for span in f.spans])
    return Processed(
        movement,
        tuple(calibrations),
        tuple(dict.fromkeys(messages)),
        findings,
        tuple(warnings),
        noticed,
        restarts=restarts,
    )


def _mounting_changes(method: AnyMethod[P], ends: Sequence[object]) -> Iterator[MountingChange]:
    if notices_mounting_changes(method):
        for state in ends:
            yield from method.mounting_changes(state)


def _contact_outcomes(method: AnyMethod[P], ends: Sequence[object]) -> Iterator[ContactOutcome]:
    if uses_contacts(method):
        for state in ends:
            yield from method.contact_outcomes(state)


def _attach_forces(
    movement: Trajectory,
    measured: list[Block],
    recording: Recording,
    calibrations: Sequence[Calibration],
) -> tuple[Trajectory, list[str]]:
    """With the fingertips' forces where a force sensor is worn, and messages."""
    if not any({FORCE, TORQUE} & set(b.stream.quantities) for b in measured):
        return movement, []
    # a fiftieth of every start, for recordings with forces alone
    from handscope.estimators.force.fingertip_forces import ForceParams, attach_forces

    return attach_forces(ForceParams(), movement, measured, recording.mounting, calibrations)


def _add_hand_position(
    movement: Trajectory, measured: list[Block], recording: Recording
) -> tuple[Trajectory, list[str]]:
    """With the hand's position where a magnet is worn, and messages."""
    if recording.plate is None and not find_magnetometers([b.stream for b in measured]):
        return movement, []
    # a tenth of every start, for recordings with a magnet alone
    from handscope.estimators.magnet.pipeline.hand_position import PlaceParams, add_hand_position

    return add_hand_position(PlaceParams(), movement, measured, recording.plate, recording.mounting)


def _estimate(
    method: AnyMethod[P],
    params: P,
    recording: Recording,
    calibration_recording: Recording | None,
    progress: Callable[[float], None],
    known: PriorCalibration | None,
    on_end: Callable[[object], None],
) -> tuple[Trajectory, list[Calibration], list[str]]:
    """The movement, what it was calibrated with, and what is said of that; `on_end` is given the method's state at the end of each calibration's time."""
    if solves_whole(method):
        return method.solve(params, recording, progress)
    assert steps_through(method)
    calibrations, warnings = _calibrations(method, params, recording, calibration_recording)
    if known is not None:
        calibrations = [
            with_known(c, known, method.CAPABILITIES.subtracts_acc_bias) for c in calibrations
        ]
    if isinstance(params, GivenParams):
        calibrations, fused_elsewhere = rate_orientations(params, calibrations)
        warnings = [*warnings, *fused_elsewhere]
    if method.CAPABILITIES.uses_contacts:
        calibrations = with_contacts(calibrations, recording.events)
    pieces = run(method, params, calibrations, recording, on_end)
    movement = trajectory.join(_with_progress(pieces, _span(recording), progress), recording.hand)
    return movement, calibrations, warnings


def _calibrations(
    method: AnyMethod[P], params: P, recording: Recording, other: Recording | None
) -> tuple[list[Calibration], list[str]]:
    if not method.CAPABILITIES.needs_pose:
        return without_pose(recording)
    assert isinstance(params, initial_pose.PoseParams), "a method with a pose has its options"
    return calibrate(params, recording, other)


@freed_memory_returned()
def findings_of(recording: Recording, calibrations: Sequence[Calibration]) -> tuple[Finding, ...]:
    """What is wrong with single sensors; where there is an initial pose, also with how they sit."""
    blocks = whole_of(recording)
    raw = [b for b in blocks if ORIENTATION not in b.stream.quantities]
    poses = [c for c in calibrations if c.source.is_pose]
    if not poses:
        return tuple(fault_detection.check(raw, (0.0, 0.0)))
    found = fault_detection.check(raw, (poses[0].t, poses[0].end))
    broken = {f.sensor for f in found if f.severity == "fault" and f.kind != "magnetometer"}
    taken = initial_pose.pose_of(initial_poses(recording.events)[0])
    pose = initial_pose.calibrated_part(taken, poses[0])
    # mounting known from movements
    mounting = {
        **recording.mounting,
        **{s: poses[0].q_BS[s] for s in poses[0].q_BS_sd},
    }
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
    if isinstance(recording, WholeRecording):
        return [b for b in recording.samples.values() if len(b.t)]
    return [b for b in whole_streams(list(recording.blocks())) if len(b.t)]


def _limits_known(recording: Recording) -> bool:
    """Whether the fusion itself detects clipping, so that shares are reported already."""
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


def _span(recording: Recording) -> tuple[float, float]:
    spans = [(b.t[0], b.t[-1]) for b in recording.blocks() if len(b.t)]
    return min(s for s, _ in spans), max(e for _, e in spans)
