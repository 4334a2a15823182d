"""What a method made of a recording, with what the checks of the recording show: messages, flags, and with them the grades of figures.

In      a processed recording, and the recording
Out     the same with findings; segments of faulty sensors, and what the method's filter couples with them, are flagged from when to when, which lowers the grade of what rests on them
Limits  those of the checks: fault_detection/check.py
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.deviations import widen_faulty
from handscope.estimators.data.findings import Finding
from handscope.estimators.data.samples import Recording
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.fault_detection.check import FROZEN, check_recording
from handscope.estimators.fault_detection.coverage import shown_by_gravity, untested
from handscope.estimators.fault_detection.finding import Suspicion, Untested
from handscope.estimators.fault_detection.neighbours.check_neighbours import Compared
from handscope.estimators.fault_detection.words import as_findings, sentence
from handscope.estimators.hand.anatomy import SEGMENT
from handscope.estimators.messages.sentence import messages_of
from handscope.estimators.methods import m2
from handscope.estimators.numerics.native_libraries import freed_memory_returned
from handscope.estimators.pipeline.coupled_segments import flag_coupled, remembered
from handscope.estimators.pipeline.process import Processed, whole_of
from handscope.estimators.pipeline.recording_calibration import calibrate
from handscope.estimators.recording_checks.clipped_gyroscopes import CLIPPED, clipped_gyroscopes
from handscope.estimators.recording_checks.free_joints import check_joints
from handscope.estimators.recording_checks.pose_gravity import check_pose
from handscope.estimators.sensors.saturation import with_full_scales

EXPLAINS = {  # what a cause of the file looks like at single sensors, by the kind of their findings
    "file.accelerometer_unit": "gravity",
    "file.gyroscope_negated": "turned",
    "file.gyroscope_sign": "turned",
    "file.gyroscope_exchange": "turned",
    "file.gyroscope_axes": "turned",
    "file.accelerometer_negated": "turned",
}
BY_TURNED = {"sensor.slipped", "sensors.disagree"}  # what a sensor that turned explains
# where times are wrong, sensors seem to have turned
OF_TIMES = {"file.rate", "file.lost_rows", "file.frozen"}
OTHER_HAND = {"hand.other", "hand.mirrored", "hand.other_thumb"}  # told once
IN_OTHER_UNIT = "sensor.accelerometer_unit"
EDGE = 0.1  # s: checks look at windows, so a fault begins a little earlier and ends a little later than they say


def check_processed(processed: Processed, recording: Recording) -> Processed:
    """Check the recording, flag the segments of sensors that are at fault, and append the messages.

    What the method noticed itself of a turned sensor stands for what the checks say of it. Flags are written into the trajectory in place; standard deviations are widened (data/deviations.py).
    """
    recording = with_full_scales(recording, whole_of(recording))
    turned = {sensor for s in processed.suspicions for sensor in s.sensors}
    compared = Compared(whole_of(recording), recording, processed.calibrations)
    # before sensors are compared: either takes a good part of a long recording's memory
    with freed_memory_returned():
        by_gravity = shown_by_gravity(compared.cells)
    suspicions = [
        s
        for s in suspicions_of(recording, processed.calibrations, compared)
        if not (s.message.code in BY_TURNED and turned & {*s.sensors})
        and s.message.code != CLIPPED  # a finding of processing
    ]
    findings = as_findings(suspicions)
    flag_segments(processed.trajectory, [*as_findings(processed.suspicions), *findings])
    if processed.restarts is not None:
        _flag_coupled(processed, suspicions, processed.restarts)
    processed = _without_explained(processed, suspicions)
    noticed = processed.suspicions
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
        suspicions=(*noticed, *suspicions),
        untested=untested_of(
            recording, [*noticed, *suspicions], processed.calibrations, compared, by_gravity
        ),
    )


def _without_explained(processed: Processed, suspicions: Sequence[Suspicion]) -> Processed:
    """Without what is said of each sensor where one cause of the file or a wrong unit explains it, as of sensors that seem to turn where times are wrong or a sensor is at fault; flags stay as they are."""
    codes = {s.message.code for s in suspicions}
    kinds = {EXPLAINS.get(code) for code in codes}
    faults = [s for s in suspicions if s.message.severity == "fault"]
    noticed = processed.suspicions
    frozen = {n for s in suspicions if s.message.code == FROZEN for n in s.sensors}
    effects = [
        s
        for s in noticed
        if codes & OF_TIMES or frozen & {*s.sensors} or any(_explains(fault, s) for fault in faults)
    ]
    explained = [f for f in processed.findings if f.kind in kinds]
    units = {n for s in suspicions if s.message.code == IN_OTHER_UNIT for n in s.sensors}
    messages = {f.message for f in explained} | {sentence(s.message) for s in effects}
    messages |= {
        w
        for w in processed.warnings
        for m in messages_of(w)
        if m.code == "calibration.resting_gravity" and m.values["sensor"] in units
    }
    return replace(
        processed,
        findings=tuple(f for f in processed.findings if f not in explained),
        warnings=tuple(w for w in processed.warnings if w not in messages),
        suspicions=tuple(s for s in noticed if s not in effects),
    )


def _explains(fault: Suspicion, noticed: Suspicion) -> bool:
    """Whether all sensors that a method noticed were at fault all that time."""
    during = all(any(a <= c and d <= b for a, b in fault.spans) for c, d in noticed.spans)
    return during and {*noticed.sensors} <= {*fault.sensors}


def suspicions_of(
    recording: Recording,
    calibrations: Sequence[Calibration] | None = None,
    compared: Compared | None = None,
) -> list[Suspicion]:
    """What is probably wrong with a recording, by its readings, by what joints can do and by gravity in its pose.

    Parameters
    ----------
    recording : Recording
        With what is declared of it.
    calibrations : sequence of Calibration, optional
        As they were used; without them those of its initial poses, where these tell any.
    compared : Compared, optional
        Of the recording with these calibrations, where what is `untested_of` it shares it.

    Returns
    -------
    list of Suspicion
        Of a sensor that one names nothing more is suspected by its joints; questions (severity `info`) last.
    """
    recording = with_full_scales(recording, whole_of(recording))
    known = calibrations_of(recording) if calibrations is None else calibrations
    clipped = clipped_gyroscopes(whole_of(recording))
    found = check_recording(whole_of(recording), recording, known, compared)
    found = [*clipped, *(s for s in found if not _by_clipping(s, clipped))]
    named = {n for s in found if s.message.severity != "info" for n in s.sensors}
    found += [s for s in check_joints(recording, known) if _is_asked(s) or not named & {*s.sensors}]
    of_pose = check_pose(recording, known)
    if OTHER_HAND & {s.message.code for s in found}:
        of_pose = [s for s in of_pose if s.message.code not in OTHER_HAND]
    return sorted([*found, *of_pose], key=_is_asked)


def untested_of(
    recording: Recording,
    suspicions: Sequence[Suspicion],
    calibrations: Sequence[Calibration] | None = None,
    compared: Compared | None = None,
    by_gravity: Mapping[str, Mapping[float, bool]] | None = None,
) -> Untested:
    """What the recording's movement is too little for, but for sensors of which something is found."""
    recording = with_full_scales(recording, whole_of(recording))
    known = calibrations_of(recording) if calibrations is None else calibrations
    named = {n for s in suspicions if s.message.severity != "info" for n in s.sensors}
    return untested(whole_of(recording), recording, known, named, compared, by_gravity)


def calibrations_of(recording: Recording) -> list[Calibration]:
    """How sensors sit on their segments by the recording's poses; none where they do not tell it."""
    try:
        return calibrate(m2.Params(), recording)[0]
    except InputError:
        return []


def _by_clipping(suspicion: Suspicion, clipped: Sequence[Suspicion]) -> bool:
    """Whether sensors disagree of which one clips."""
    return suspicion.message.code == "sensors.disagree" and any(
        {*c.sensors} & {*suspicion.sensors} for c in clipped
    )


def _is_asked(suspicion: Suspicion) -> bool:
    """Whether it is a question rather than a fault."""
    return suspicion.message.severity == "info"


def flag_segments(trajectory: Trajectory, findings: Sequence[Finding]) -> None:
    """Mark the segments (in place) of sensors at fault, for as long as the fault holds; magnetometers spoil no angle of a 6D method."""
    for finding in findings:
        if finding.sensor not in SEGMENT or "magnetometer" in finding.kind:
            continue
        flag = Flag.FAULTY if finding.severity == "fault" else Flag.DOUBTFUL
        for span in _widened(finding.spans):
            first, last = np.searchsorted(trajectory.t, span)
            trajectory.flags[first:last, SEGMENT[finding.sensor]] |= np.uint8(flag)


def _flag_coupled(
    processed: Processed, suspicions: Sequence[Suspicion], restarts: Sequence[float]
) -> None:
    """Mark what the filter couples with sensors at fault, for as long as it remembers the fault; what the method noticed itself, until then: it counts on it afterwards."""
    for s in processed.suspicions:
        flag_coupled(processed.trajectory, s.sensors, _widened(s.spans))
    for s in suspicions:
        if _is_asked(s) or "magnetometer" in s.message.code:
            continue
        spans = [remembered(span, restarts) for span in _widened(s.spans)]
        for sensors in [(n,) for n in s.sensors] if s.message.severity == "fault" else [s.sensors]:
            flag_coupled(processed.trajectory, sensors, spans)


def _widened(spans: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    return [(start - EDGE, stop + EDGE) for start, stop in spans]
