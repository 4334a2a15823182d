"""Flags of a trajectory from findings and calibrations, and a warning for each kind of flag."""

from collections.abc import Sequence

import numpy as np

from handscope.estimators.data.calibration import Calibration, CalibrationSource
from handscope.estimators.data.findings import Finding
from handscope.estimators.data.trajectory import FLAG_WORDS, Flag, Trajectory
from handscope.estimators.hand.anatomy import SEGMENT, SEGMENTS
from handscope.estimators.messages.sentence import phrase

SMALLEST_SHARE = 0.0005  # share of flagged samples that prints as 0.1 %


def is_fault(finding: Finding, magnetometer: bool) -> bool:
    """Whether a tracked point's sensor is not to be trusted; `magnetometer`: whether the method uses those."""
    return (
        finding.severity == "fault"
        and finding.kind != "saturated"
        and finding.sensor in SEGMENT
        and (finding.kind != "magnetometer" or magnetometer)
    )


def flag_faults(
    movement: Trajectory, findings: Sequence[Finding], poses: Sequence[float], magnetometer: bool
) -> None:
    """Mark the segments of faulty sensors, of magnetometers only where the method uses them;
    clipping by the flag that it has.

    What a sensor missed while it stood still is missing until the next pose (s): its heading counts
    as lost.
    """
    for finding in findings:
        flag = (
            Flag.SATURATED
            if finding.kind == "saturated"
            else Flag.FAULTY
            if is_fault(finding, magnetometer)
            else None
        )
        if flag is not None and finding.sensor in SEGMENT:
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
        for segment in calibration.q_BS if calibration.source is CalibrationSource.NONE else ():
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


def flag_warnings(movement: Trajectory) -> list[str]:
    """One sentence for all segments with the same warning."""
    segments_by_warning: dict[str, list[str]] = {}
    present = int(np.bitwise_or.reduce(movement.flags, axis=None))
    for flag, what in FLAG_WORDS.items():
        shares = (
            ((movement.flags & flag) != 0).mean(axis=0)
            if present & flag
            else np.zeros(len(SEGMENTS))
        )
        for segment, share in zip(SEGMENTS, shares):
            if share >= SMALLEST_SHARE:
                segments_by_warning.setdefault(
                    phrase("processing.share_of_samples", what=what, share=100 * share), []
                ).append(segment)
    return [
        phrase("processing.segments_flagged", segments=", ".join(segments), what=warning)
        for warning, segments in segments_by_warning.items()
    ]
