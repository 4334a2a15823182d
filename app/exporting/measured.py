"""From a processed recording to what an export is written from."""

from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

from handscope.app.language import ENGLISH
from handscope.app.protocols import load_all
from handscope.app.report import FORMS, Style
from handscope.app.report.content import Visit, content
from handscope.app.version import software_version
from handscope.estimators.data.options import values_of
from handscope.estimators.errors import InputError
from handscope.estimators.measures.accuracy import accuracy_of
from handscope.estimators.measures.assessment import assess
from handscope.estimators.pipeline.process import Processed
from handscope.sessions.exports import export, format_of
from handscope.sessions.exports.measured import Exported, Measured, Origin, is_simulated
from handscope.sessions.files.recording import LoadedRecording


def gather(
    recording: LoadedRecording,
    processed: Processed,
    method: str,
    params: Any,
    pseudonym: str = "",
    software: str | None = None,
) -> Measured:
    """The movement with its measures; nobody is named but by a pseudonym that was given. InputError without any movement."""
    if not np.isfinite(processed.trajectory.angles).any():
        raise InputError("export.no_joint_angles", method=method)
    origin = Origin(
        software=software or software_version(),
        method=method,
        options=values_of(params),
        checksum=recording.checksum,
        start_utc=recording.start_utc or "",
        made_utc=datetime.now(UTC).isoformat(timespec="seconds"),
        simulated=is_simulated(recording.source),
        warnings=processed.warnings,
        pseudonym=pseudonym,
    )
    accuracy = accuracy_of(method, processed.calibrations)
    tasks = assess(processed.trajectory, recording.events, recording.geometry, accuracy)
    declared = any(e.trial_type == "task" for e in recording.events)
    return Measured(
        recording=recording,
        movement=processed.trajectory,
        geometry=processed.calibrations[0].geometry,
        origin=origin,
        tasks=tuple(tasks) if declared else (),
    )


def export_processed(
    measured: Measured,
    name: str,
    processed: Processed,
    params: Any,
    with_report: bool = True,
) -> Exported:
    """The files of a format, with the report and the drawn hand where it takes them."""
    wanted = format_of(name)
    if wanted.skin:
        from handscope.app.exporting.skin import skin

        measured = replace(measured, skin=skin)
    if wanted.report and with_report:
        measured = replace(measured, report=_report(measured, processed, params))
    return export(measured, name)


def without_text(measured: Measured) -> Measured:
    """The same without what people may have typed at events: numbers and the task's name stay."""
    kept = ("task_name", "contacts")
    events = tuple(
        replace(e, details={k: v for k, v in e.details.items() if k in kept or _is_number(v)})
        for e in measured.recording.events
    )
    return replace(measured, recording=measured.recording.with_events(events))


def _is_number(value: Any) -> bool:
    try:
        float(value)
    except (TypeError, ValueError):
        return False
    return True


def _report(measured: Measured, processed: Processed, params: Any) -> bytes:
    """The PDF as the report has it, of nobody who is named."""
    visit = Visit(patient=measured.origin.pseudonym)
    origin = measured.origin
    made = content(
        visit,
        measured.recording,
        processed,
        origin.method,
        params,
        measured.tasks,
        origin.software,
        load_all(),
    )
    return bytes(FORMS["pdf"](made, Style(ENGLISH)))
