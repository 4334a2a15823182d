"""Open any recording: a Motion-BIDS folder or zip, or a native recording."""

from pathlib import Path

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.sessions import motion_bids
from handscope.sessions.files import native
from handscope.sessions.files.recording import LoadedRecording, require_samples
from handscope.sessions.files.sensor_corrections import correct_recording


def load(
    path: Path, hand: Hand | None = None, correct: bool = True, inertial: bool = True
) -> LoadedRecording:
    """The recording at a path; `hand` is the side to take where it does not say (an error where it says the other).

    With `correct` false samples are as the sensors read, without their strips' calibrations and the corrections that events ask for.
    With `inertial` false a recording of magnetometers alone is one too.
    """
    if path.is_file() and path.suffix == native.SUFFIX:
        recording = native.load(path, hand, correct)
        recording = require_samples(recording, path.name) if inertial else recording
    else:
        recording = motion_bids.load(path, hand, inertial)
    return correct_recording(recording) if correct else recording


def checksum(path: Path) -> str:
    """sha256 of a recording's file."""
    if not path.is_file():
        raise InputError("reference.not_file", name=str(path))
    return native.file_checksum(path)
