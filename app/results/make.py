"""Make results: process a stored recording, assess it, store figures, a thinned trajectory and the report's content.

It runs in a process of its own (app/job_queue.py), so that a long computation never delays a live view.
"""

import io
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import update
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session, object_session
from sqlalchemy.orm.exc import StaleDataError

from handscope.app.options import with_options
from handscope.app.protocols import offered
from handscope.app.report.content import Content, Visit, content, drifts_of, joints_to_name
from handscope.app.report.references import newest
from handscope.app.report.sections import self_calibration
from handscope.app.report.stored import pack, unpack
from handscope.app.workers import deadline
from handscope.estimators.data.options import describe, values_of, with_present_names
from handscope.estimators.data.samples import Event
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import SEGMENT
from handscope.estimators.measures.accuracy import accuracy_of
from handscope.estimators.measures.assessment import TaskResult, assess
from handscope.estimators.measures.excursions import repetitions
from handscope.estimators.measures.plot_data import PlotData, thin_curves
from handscope.estimators.measures.tapping import Tapping
from handscope.estimators.methods import ALL_METHODS
from handscope.estimators.methods.map_gain import gaining_fingers
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import Processed, process
from handscope.estimators.recording_checks.check import check_processed
from handscope.sessions.clinic import corrections, references, self_calibrations, trunk_height
from handscope.sessions.clinic.results import begin, fail
from handscope.sessions.db.full_disk import FULL, is_full
from handscope.sessions.db.tables import Result
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import derivative
from handscope.sessions.sealing.stored import open_stored, read_stored, write_stored
from handscope.sessions.store import records, stored_files
from handscope.sessions.store.store import Store
from handscope.sessions.tables_io.number_table import Data
from handscope.sessions.tables_io.trajectory_table import measured_segments

LOOK, STEP = 0.5, 0.05  # s, share: how often progress is stored
REPLAY_RATE = 60.0  # Hz of the trajectory stored for replay and curves
CURVE_POINTS = 1500  # of a measure's curve at most: finer than a screen


class StoppedError(Exception):
    """The result was stopped or erased."""


def make(store: Store, result_id: int) -> None:
    """Process the result's recording; a failure that the user can mend becomes the result's error.

    A result that is stopped or erased meanwhile leaves no files.
    """
    with store.database() as db:
        try:
            _make_or_fail(db, store, result_id)
        except StaleDataError:
            db.rollback()
            for file in (replay_file(result_id), report_file(result_id)):
                store.path_of(file).unlink(missing_ok=True)


def _make_or_fail(db: Session, store: Store, result_id: int) -> None:
    try:
        if (result := begin(db, result_id)) is not None:
            _make(db, store, result)
    except StoppedError:
        db.rollback()
    except (InputError, OSError, DBAPIError) as problem:
        db.rollback()
        full = is_full(problem) or is_full(problem.__context__)
        if not full and not isinstance(problem, InputError):
            raise
        fail(db, result_id, FULL if full else str(problem))


def _make(db: Session, store: Store, result: Result) -> None:
    on_progress = deadline.limit_time(
        deadline.LIMIT, _progress_writer(db, result.id), from_command_line=False
    )
    recording, processed = process_result(store, result, on_progress)
    on_progress(1.0)
    tasks = assess_result(result, recording, processed)
    save_replay(store, result.id, processed.trajectory)
    save_report(store, result, recording, processed, tasks)
    result.figures = [row for t in tasks for row in figure_rows(t)]
    result.content = {
        **page_content(processed, tasks, recording),
        "options": options_of(result),
    }
    result.warnings, result.state, result.progress = list(processed.warnings), "done", 1.0
    result.recording.session.state = "processed"
    db.commit()
    references.current(db, result, newest().data)


def process_result(
    store: Store,
    result: Result,
    progress: Callable[[float], None] = lambda share: None,
    reasons: bool = True,
) -> tuple[LoadedRecording, Processed]:
    """The recording with its corrections, and what the method makes of it; `reasons`: with those of the corrections."""
    if result.method not in ALL_METHODS:
        raise InputError(
            "analysis.unknown_method", name=result.method, methods=", ".join(ALL_METHODS)
        )
    method = ALL_METHODS[result.method]
    applied = result.corrections if reasons else corrections.redact_reasons(result.corrections)
    recording = trunk_height.apply(
        corrections.apply(records.open_recording(store, result.recording), applied),
        result.trunk_height,
    )
    db = object_session(result)
    prior = None if db is None else self_calibrations.load_prior(db, result.reused)
    made = process(
        method,
        params_of(result),
        recording,
        progress=progress,
        known=prior,
    )
    return recording, check_processed(made, recording)


def params_of(result: Result) -> Any:
    """The method's Params: defaults as they were when the result was made, and what it was asked for."""
    params_type = ALL_METHODS[result.method].Params
    known = {d.name for d in describe(params_type)}
    options = with_present_names(params_type, result.content.get("options", {}))
    asked = with_present_names(params_type, result.parameters)
    frozen = {k: v for k, v in options.items() if k in known and k not in asked}
    return replace(with_options(params_type, asked), **frozen)


def options_of(result: Result) -> dict[str, Any]:
    """Every option by name, defaults as well: what a later version may have other defaults for."""
    return values_of(params_of(result))


def assess_result(
    result: Result, recording: LoadedRecording, processed: Processed
) -> list[TaskResult]:
    """The measures of a processed recording; none of a session measured here without a trial: nothing was asked of how the hand moved in it."""
    if records.is_without_trial(result.recording.session):
        return []
    return assess(
        processed.trajectory,
        recording.events,
        recording.geometry,
        accuracy_of(result.method, processed.calibrations),
    )


def derivative_files(store: Store, result: Result, reasons: bool = True) -> dict[str, Data]:
    """The Motion-BIDS derivative of a result (docs/motion-bids.md)."""
    recording, processed = process_result(store, result, reasons=reasons)
    params = params_of(result)
    return derivative.tree(processed, recording, result.method, params, result.version)


def figure_rows(t: TaskResult) -> list[dict[str, Any]]:
    """The figures of a task as plain data, in the order of the measure; NaN becomes None."""
    rows = []
    for f in t.figures:
        row = asdict(f)
        row["value"] = None if not np.isfinite(f.value) else f.value
        rows.append(
            {
                "task": t.task,
                "measure": t.measure,
                "onset": t.onset,
                **row,
                "sd_basis": t.sd_basis if f.sd is not None else "",
            }
        )
    return rows


def page_content(
    processed: Processed, tasks: list[TaskResult], recording: LoadedRecording
) -> dict[str, Any]:
    """Everything that the result page draws besides the figures."""
    trajectory, c = processed.trajectory, processed.calibrations[0]
    return {
        "self_calibration": _found_calibration(processed, recording),
        "self_calibration_gains": _fingers_to_gain(processed, recording),
        "span": [float(trajectory.t[0]), float(trajectory.t[-1])]
        if len(trajectory)
        else [0.0, 0.0],
        "measured": measured_segments(trajectory),
        "calibration": {
            "source": c.description,
            "onset": c.span[0],
            "end": c.span[1],
            "quality": {s: asdict(q) for s, q in c.quality.items()},
            "joints": joints_to_name(c),
        },
        "drift": [asdict(drift) for drift in drifts_of(processed)],
        "untested": dict(derivative.untested_table(processed.untested)),
        "tasks": [_task(t) for t in tasks],
        "events": [
            {
                "trial_type": e.trial_type,
                "onset": e.onset,
                "duration": e.duration,
                **dict(e.details),
            }
            for e in recording.events
        ],
        "repetitions": {
            str(k): _repetitions(e, processed.trajectory, tasks)
            for k, e in enumerate(recording.events)
            if e.trial_type == "task"
        },
    }


def _found_calibration(processed: Processed, recording: LoadedRecording) -> dict[str, Any] | None:
    """What self-calibration found, beside the lengths as they were given."""
    found = self_calibration.stored_form(processed)
    return found and {**found, "given": dict(recording.geometry.lengths)}


def _fingers_to_gain(processed: Processed, recording: LoadedRecording) -> list[str]:
    """Fingers whose lengths and mountings could be estimated from this movement; none where they were already."""
    calibration = processed.calibrations[0]
    if calibration.stretch is not None or calibration.from_prior == "seats and lengths":
        return []
    return list(gaining_fingers(recording, calibration, processed.trajectory))


def _repetitions(
    event: Event, trajectory: Trajectory, tasks: list[TaskResult]
) -> list[dict[str, Any]]:
    """Start and stop of the task's repetitions, s, and whether they are excluded: half covered by an excluded stretch."""
    gone = [(float(a), float(b)) for a, b in event.details.get("left_out", ())]
    cycles = repetitions(
        trajectory,
        event.onset,
        event.end,
        [t.details for t in tasks if t.onset == event.onset and t.end == event.end],
    )
    counted = [
        (a, b)
        for a, b in cycles
        if not any(min(b, stop) - max(a, start) > (b - a) / 2 for start, stop in gone)
    ]
    return [{"start": a, "stop": b, "out": (a, b) in gone} for a, b in sorted([*counted, *gone])]


def replay_file(result_id: int) -> str:
    """Name of the stored trajectory of a result."""
    return f"results/{result_id}.npz"


def save_replay(store: Store, result_id: int, trajectory: Trajectory) -> None:
    """Store the trajectory thinned to REPLAY_RATE; it can be made again at any time."""
    rate = 1.0 / float(np.median(np.diff(trajectory.t))) if len(trajectory) > 1 else REPLAY_RATE
    thin = slice(None, None, max(1, round(rate / REPLAY_RATE)))
    buffer = io.BytesIO()
    small = {
        "angles": trajectory.angles[thin],
        "q_GH": trajectory.q_GS[thin, SEGMENT["hand"]],
        "tips": trajectory.tips[thin],
    }
    if trajectory.forces is not None:
        small["forces"] = trajectory.forces[thin]
    arrays = {name: values.astype(np.float32) for name, values in small.items()}
    np.savez_compressed(
        buffer, allow_pickle=False, t=trajectory.t[thin], flags=trajectory.flags[thin], **arrays
    )
    path = store.path_of(replay_file(result_id))
    path.parent.mkdir(exist_ok=True)
    write_stored(buffer.getvalue(), path)


def load_replay(store: Store, result: Result) -> dict[str, Any]:
    """The thinned trajectory: t (n,), angles (n, joints, 3), q_GH (n, 4), tips (n, 5, 3), flags, measured forces (n, 5, 3).

    Made again where its file is missing.
    """
    path = stored_files.fetch_local(store, replay_file(result.id))
    if not path.exists():
        save_replay(store, result.id, process_result(store, result)[1].trajectory)
    return _read(path, path.stat().st_mtime_ns)


def report_file(result_id: int) -> str:
    """Name of the stored report content of a result."""
    return f"results/{result_id}.report.npz"


def save_report(
    store: Store,
    result: Result,
    recording: LoadedRecording,
    processed: Processed,
    tasks: list[TaskResult],
) -> Content:
    """Store the report's content for the recording; it can be made again at any time."""
    params = params_of(result)
    nobody, version, corrected = Visit(patient=""), result.version, result.corrections
    protocols, _ = offered(store.folder)
    report_content = content(
        nobody,
        recording,
        processed,
        result.method,
        params,
        tasks,
        version,
        protocols,
        corrections=corrected,
    )
    if (db := object_session(result)) is not None and (reused := result.reused):
        earlier = self_calibrations.get(db, reused["self_calibration"])
        report_content = replace(
            report_content, self_calibration=self_calibration.reused_form(earlier, reused["parts"])
        )
    write_stored(pack(report_content), store.path_of(report_file(result.id)))
    return report_content


def load_report(store: Store, result: Result) -> Content:
    """The report's content for the recording, without a visit; made again where its file is missing or outdated."""
    path = stored_files.fetch_local(store, report_file(result.id))
    if path.exists() and (report_content := unpack(read_stored(path))) is not None:
        return report_content
    recording, processed = process_result(store, result)
    return save_report(
        store, result, recording, processed, assess_result(result, recording, processed)
    )


@lru_cache(maxsize=4)
def _read(path: Path, written: int) -> dict[str, Any]:
    """Cached, since a page asks for one curve after the other; ten minutes are 10 MB."""
    with open_stored(path) as file, np.load(file) as arrays:
        return {name: arrays[name] for name in arrays.files}


def _task(t: TaskResult) -> dict[str, Any]:
    """What pages draw of a task: `shown` of every measure; ranges and taps also in the form of their own pages."""
    payload: dict[str, Any] = {
        "task": t.task,
        "measure": t.measure,
        "onset": t.onset,
        "end": t.end,
        "shown": _shown(t.shown),
    }
    if isinstance(t.details, Tapping):
        d = t.details
        payload |= {
            "closings": d.closings.tolist(),
            "amplitudes": d.amplitudes.tolist(),
            "grade": d.grade,
            "reason": d.reason,
        }
    elif t.measure == "range_of_motion":
        payload["ranges"] = [asdict(r) for r in t.details]
    return payload


def _shown(shown: PlotData) -> dict[str, Any]:
    """Curves, thinned, and marks as plain data; NaN becomes None."""
    curves = thin_curves(shown.curves, CURVE_POINTS)
    payload = [
        {
            "name": c.name,
            "unit": c.unit,
            "x_unit": c.x_unit,
            "x": _plain(c.x, 5),
            "y": _plain(c.y, 6),
        }
        for c in curves
    ]
    return {"curves": payload, "marks": {name: _plain(t, 4) for name, t in shown.marks.items()}}


def _plain(values: Array, digits: int) -> list[float | None]:
    return [round(float(v), digits) if np.isfinite(v) else None for v in values]


def _progress_writer(db: Session, result_id: int) -> Callable[[float], None]:
    """A progress callback that stores shares from time to time; StoppedError once the result is stopped or erased."""
    stored, checked = 0.0, time.monotonic()

    def write_progress(share: float) -> None:
        nonlocal stored, checked
        if share - stored < STEP and time.monotonic() - checked < LOOK:
            return
        stored, checked = share, time.monotonic()
        statement = (
            update(Result)
            .where(Result.id == result_id, Result.state == "running")
            .values(progress=share)
        )
        updated = db.execute(
            statement.returning(Result.id), execution_options={"synchronize_session": False}
        ).all()
        db.commit()
        if not updated:
            raise StoppedError

    return write_progress
