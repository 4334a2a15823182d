"""Load, process, measure: the functions that `import handscope` re-exports. Paths are strings or path objects alike."""

import warnings
from os import PathLike
from pathlib import Path
from typing import Any

from handscope.app.analysis.movement import Movement
from handscope.app.analysis.recording import AnalysisRecording
from handscope.app.analysis.recording import from_arrays as from_arrays
from handscope.app.analysis.result import Result
from handscope.app.options import with_options
from handscope.estimators.data.samples import Recording
from handscope.estimators.errors import InputError as InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.messages.sentence import codes_of
from handscope.estimators.methods import ALL_METHODS, default_for
from handscope.estimators.pipeline.process import Processed
from handscope.estimators.pipeline.process import process as process_recording
from handscope.estimators.recording_checks.check import check_processed
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.motion_bids import kinematics
from handscope.sessions.motion_bids.files import open_files

Source = AnalysisRecording | LoadedRecording | Recording | str | PathLike[str]


def load(path: str | PathLike[str], hand: Hand | None = None) -> AnalysisRecording:
    """Read a recording: a native file, or a Motion-BIDS folder or zip.

    Parameters
    ----------
    path
        Of the file or folder.
    hand
        "left" or "right"; needed only where the recording does not say it.

    Returns
    -------
    AnalysisRecording
        Samples in SI units: gyroscopes in rad/s, accelerometers in m/s^2, magnetometers in T, times in s.

    Raises
    ------
    InputError
        Where the file cannot be read, or nobody says which hand it is.

    Notes
    -----
    Formats: docs/recording.md (native) and docs/motion-bids.md.
    """
    return AnalysisRecording(formats_recordings.load(Path(path), hand))


def process(recording: Source, method: str | None = None, **options: Any) -> Result:
    """Run a method over a recording.

    Parameters
    ----------
    recording
        A recording, or the path of one.
    method
        b, m1, m2, ekf, map, ...; without a name `ekf`, of orientations alone `m2`.
    **options
        Those that `handscope process --method NAME --help` lists, with the same names and units.

    Returns
    -------
    Result
        Angles, fingertips, figures and report; n samples, joint angles (n, joints, 3) in rad inside.

    Raises
    ------
    InputError
        For an unknown method or option, and for a recording that cannot be calibrated.

    Warns
    -----
    UserWarning
        What the checks of the recording find, and what else is to be known about the result.

    Notes
    -----
    Each method names its source: `Result.cite`, docs/methods.
    """
    if method is not None and method not in ALL_METHODS:
        raise InputError("analysis.unknown_method", name=method, methods=", ".join(ALL_METHODS))
    opened: Any = load(recording) if isinstance(recording, (str, PathLike)) else recording
    samples = opened.loaded if isinstance(opened, AnalysisRecording) else opened
    method = method or default_for(samples.streams)
    chosen = ALL_METHODS[method]
    params = with_options(chosen.Params, options)
    made = check_processed(process_recording(chosen, params, samples), samples)
    for message in _once_a_code(made):
        warnings.warn(message, stacklevel=2)
    return Result(samples, made, method, params)


def _once_a_code(made: Processed) -> list[str]:
    """Warnings, of those with the same codes the first; `Processed.warnings` has all."""
    first = {codes_of(w) or w: w for w in reversed(made.warnings)}
    return [w for w in made.warnings if first[codes_of(w) or w] is w]


def measure(
    recording: Source | Result, task: str | None = None, method: str | None = None, **options: Any
) -> Any:
    """The figures of tasks as a table.

    Parameters
    ----------
    recording
        A result; or a recording, or the path of one, which is processed for it.
    task
        Name of one task, such as "tapping"; without it all.
    method
        As for `process`; not used of a result.
    **options
        As for `process`.

    Returns
    -------
    pandas.DataFrame
        A row a figure: value, standard deviation, grade; SI units, named in the row.

    Raises
    ------
    InputError
        For a task that the recording does not have, and as `process` does.

    Notes
    -----
    Definitions and their sources: docs/measures.md.
    """
    result = recording if isinstance(recording, Result) else process(recording, method, **options)
    return result.measures(task)


def truth(path: str | PathLike[str], hand: Hand | None = None) -> Movement:
    """The movement that a simulated recording was made from; it lies beside the samples.

    Parameters
    ----------
    path
        Of the Motion-BIDS folder or zip.
    hand
        "left" or "right"; needed only where the recording does not say it.

    Returns
    -------
    Movement
        Angles and fingertips as they truly were.

    Raises
    ------
    InputError
        Where there is no truth beside the samples.

    Notes
    -----
    `handscope simulate` writes it: `desc-truth` of docs/motion-bids.md.
    """
    files = open_files(Path(path))
    names = [n for n in sorted(files) if n.endswith("_desc-truth_motion.tsv")]
    if not names:
        raise InputError("analysis.no_truth", path=str(path))
    found = kinematics.load(files, names[0], hand).trajectory
    if found is None:
        raise InputError("analysis.no_movement", path=str(path), names=names[0])
    return Movement(found)
