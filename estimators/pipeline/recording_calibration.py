"""Calibrations of a recording from its events, from another recording, or without a pose."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from handscope.estimators.alignment import (
    accelerometer_bias,
    functional_calibration,
    functional_movements,
    initial_pose,
    repeated_pose,
)
from handscope.estimators.alignment.functional_movements import (
    STEPS,
    CalibrationMovement,
    FunctionalParams,
)
from handscope.estimators.alignment.initial_pose import Pose, PoseParams
from handscope.estimators.alignment.repeated_pose import TakenPose, extend_row
from handscope.estimators.data.calibration import Calibration, CalibrationSource, PriorCalibration
from handscope.estimators.data.samples import MAG, ORIENTATION, Block, Event, Recording, join
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.orientation.given_orientations import mean_orientations
from handscope.estimators.orientation.resampling import measure_rates
from handscope.estimators.pipeline.method import Capabilities

WITHOUT_POSE = phrase("processing.without_pose")


BEGINNING = 3.0  # s of samples that tell a rate where there is no pose


def with_known(
    pose: Calibration, known: PriorCalibration, subtracts_acc_bias: bool = False
) -> Calibration:
    """The pose of a hand whose lengths, or also mountings, are known from before; the pose gives the rest. InputError for another hand.

    `subtracts_acc_bias`: the method takes known biases off its samples, so they are taken off the pose, too.
    """
    if pose.hand != known.hand:
        raise InputError("processing.calibration_of_other_hand", one=known.hand, other=pose.hand)
    if pose.source is CalibrationSource.NONE:
        raise InputError("processing.pose_needed", without_pose=WITHOUT_POSE)
    if subtracts_acc_bias:
        pose = accelerometer_bias.correct_pose(pose, known.acc_bias)
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
        q_BS_sd={**pose.q_BS_sd, **{s: known.q_BS_sd[s] for s in mounting}},
        q_BS_covariance=None if mounting else pose.q_BS_covariance,
        lengths_sd={**pose.lengths_sd, **known.lengths_sd},
        from_prior="seats and lengths" if mounting else "lengths",
    )


def calibrate(
    params: PoseParams, recording: Recording, other: Recording | None = None
) -> tuple[list[Calibration], list[str]]:
    """Calibrations in order of time from the recording's initial poses, or from another
    recording's; a bad pose beside a good one is a warning."""
    found: list[Calibration] = []
    refused: list[str] = []
    row: list[TakenPose] = []
    for event in initial_poses(recording.events):
        try:
            pose = initial_pose.pose_of(event)
            once = _from_pose(params, recording, pose)
        except InputError as problem:
            refused.append(str(problem))
        else:
            row = extend_row(row, TakenPose(pose, once))
            found.append(repeated_pose.average([taken.calibration for taken in row]))
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
        raise InputError(refused[0] if refused else phrase("processing.no_pose"))
    if other.hand != recording.hand:
        raise InputError(
            "processing.calibration_recording_of_other_hand", one=other.hand, other=recording.hand
        )
    borrowed, more = calibrate(params, other)
    return _borrow(recording, borrowed[-1], found), refused + more


def _defaults(params: PoseParams, recording: Recording) -> Calibration | None:
    """What somebody decided to go on with who could not calibrate: an annotation with `calibration:
    none` says when."""
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
    params: PoseParams, recording: Recording, poses: Sequence[Calibration]
) -> tuple[dict[str, CalibrationMovement], list[str]]:
    """Of each functional step among the events the last one that was done well; sentences of the
    steps that never were."""
    if not isinstance(params, FunctionalParams) or not params.uses_movements:
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
    params: PoseParams,
    recording: Recording,
    pieces: Mapping[str, CalibrationMovement],
    poses: list[Calibration],
) -> list[Calibration]:
    """The poses' calibrations with what the pieces tell of the sensors' mounting."""
    if not pieces or not isinstance(params, FunctionalParams):
        return poses
    return [functional_calibration.combine(params, pieces, c, recording.mounting) for c in poses]


def _flat_hand_warning(recording: Recording) -> list[str]:
    if all(e.trial_type == "flat_hand" for e in initial_poses(recording.events)):
        return [phrase("processing.flat_hand_as_pose")]
    return []


def without_pose(recording: Recording) -> tuple[list[Calibration], list[str]]:
    """Calibrations of a recording that has no pose, with warnings."""
    sensors = [s for stream in recording.streams if stream.inertial for s in stream.sensors]
    start, beginning = _beginning(recording)
    rates = measure_rates(beginning)
    known = initial_pose.uncalibrated(
        recording.hand, recording.geometry, recording.mounting, sensors, start
    )
    return [
        replace(known, rates=rates, warnings=initial_pose.rate_warnings(rates, recording.streams))
    ], []


def require_magnetometers(capabilities: Capabilities, recording: Recording) -> None:
    """InputError where the method takes headings from magnetometers and there are none."""
    if capabilities.needs_magnetometers and not any(
        {MAG, ORIENTATION} & set(s.quantities) for s in recording.streams
    ):
        raise InputError("processing.magnetometers_missing")


def initial_poses(events: Sequence[Event]) -> list[Event]:
    """The initial poses in order of time; without any, the flat hands of a functional
    calibration."""
    ordered = sorted(events, key=lambda e: e.onset)
    return [e for e in ordered if e.trial_type == "initial_pose"] or [
        e for e in ordered if e.trial_type == "flat_hand"
    ]


def _from_pose(params: PoseParams, recording: Recording, pose: Pose) -> Calibration:
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
    """The other recording's mounting and biases; headings from this recording's own poses, or from
    assuming that it begins in the pose."""
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
                source=CalibrationSource.POSE_AND_OTHER_RECORDING,
                is_functional=False,
            )
            for c in mounted
        ]
    start, beginning = _beginning(recording)
    q_GS, rates = (
        initial_pose.reorient(other, [b.between(start, start + 0.5) for b in beginning]),
        measure_rates(beginning),
    )
    warning = phrase("processing.headings_assumed")
    return [
        replace(
            other,
            t=start,
            end=start + 0.5,
            q_GS=q_GS,
            geometry=recording.geometry,
            source=CalibrationSource.OTHER_RECORDING,
            is_functional=False,
            warnings=(
                *other.warnings,
                *initial_pose.rate_warnings(rates, recording.streams),
                warning,
            ),
            rates=rates,
            q_ES=mean_orientations([b.between(start, start + 0.5) for b in beginning]),
        )
    ]
