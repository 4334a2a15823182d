"""Analysis from Python: load a recording, run a method over it. `import handscope` re-exports these functions."""

import warnings
from os import PathLike
from pathlib import Path
from typing import Any

from handscope.app.options import with_options
from handscope.estimators.data.samples import Recording
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.methods import ALL_METHODS, DEFAULT
from handscope.estimators.pipeline.check import check_processed
from handscope.estimators.pipeline.process import Processed
from handscope.estimators.pipeline.process import process as process_recording
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import recordings as formats_recordings


def load(path: str | PathLike[str], hand: Hand | None = None) -> LoadedRecording:
    """Read a recording: a native file, or a Motion-BIDS folder or zip.

    `hand` ("left" or "right") is needed only where the recording does not say it. InputError where the file cannot be read.
    """
    return formats_recordings.load(Path(path), hand)


def process(
    recording: Recording | str | PathLike[str], method: str = DEFAULT, **options: Any
) -> Processed:
    """Run a method over a recording or the path of one.

    `options` are those that `handscope process --help` lists, with the same names and units. InputError for an unknown
    method or option, and for a recording that cannot be calibrated. What the checks of the recording find, and what
    else is to be known about the result, reaches the caller by `warnings.warn`, too.
    """
    if isinstance(recording, (str, PathLike)):
        recording = load(recording)
    if method not in ALL_METHODS:
        raise InputError(f"there is no method {method!r}; methods are {', '.join(ALL_METHODS)}")
    chosen = ALL_METHODS[method]
    made = process_recording(chosen, with_options(chosen.Params, options), recording)
    result = check_processed(made, recording)
    for message in result.warnings:
        warnings.warn(message, stacklevel=2)
    return result
