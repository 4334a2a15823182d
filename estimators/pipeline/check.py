"""What a method made of a recording, with what the checks of the recording show: messages, flags, and with them the grades of figures.

In      a processed recording, and the recording
Out     the same with findings; segments of faulty sensors are flagged from when to when, which lowers the grade of what rests on them
Limits  those of the checks: fault_detection/check.py
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.data.deviations import widen_faulty
from handscope.estimators.data.findings import Finding
from handscope.estimators.data.samples import Recording
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.fault_detection.check import as_findings, check_recording
from handscope.estimators.fault_detection.words import sentence
from handscope.estimators.hand.anatomy import SEGMENT
from handscope.estimators.pipeline.process import Processed, whole_of

EDGE = 0.1  # s: checks look at windows, so a fault begins a little earlier and ends a little later than they say


def check_processed(processed: Processed, recording: Recording) -> Processed:
    """Check the recording, flag the segments of sensors that are at fault, and append the messages.

    Flags are written into the trajectory in place; standard deviations are widened (data/deviations.py).
    """
    suspicions = check_recording(whole_of(recording), recording, processed.calibrations)
    findings = as_findings(suspicions)
    flag_segments(processed.trajectory, findings)
    trajectory = processed.trajectory
    if trajectory.angles_sd is not None:
        trajectory = replace(
            trajectory, angles_sd=widen_faulty(trajectory.angles_sd, trajectory.flags)
        )
    messages = dict.fromkeys([*processed.warnings, *(sentence(s.message) for s in suspicions)])
    return replace(
        processed,
        trajectory=trajectory,
        warnings=tuple(messages),
        findings=(*processed.findings, *findings),
        suspicions=tuple(suspicions),
    )


def flag_segments(trajectory: Trajectory, findings: Sequence[Finding]) -> None:
    """Mark the segments (in place) of sensors at fault, for as long as the fault holds; magnetometers spoil no angle of a 6D method."""
    for finding in findings:
        if finding.sensor not in SEGMENT or "magnetometer" in finding.kind:
            continue
        flag = Flag.FAULTY if finding.severity == "fault" else Flag.DOUBTFUL
        for rows in _rows(trajectory, finding):
            trajectory.flags[rows, SEGMENT[finding.sensor]] |= np.uint8(flag)


def _rows(trajectory: Trajectory, finding: Finding) -> Iterator[slice]:
    """Samples in which a finding holds."""
    for start, stop in finding.spans:
        first, last = np.searchsorted(trajectory.t, [start - EDGE, stop + EDGE])
        yield slice(int(first), int(last))
