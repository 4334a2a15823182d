"""Height of the trunk's sensor above the hips, entered afterwards: it replaces that of the recording, which never changes.

Applied     to the tasks of an opened recording (`applied`): a result names the height that it was computed with and is a function of it
"""

from dataclasses import replace

from handscope.estimators.data.samples import TRUNK
from handscope.estimators.errors import InputError
from handscope.estimators.measures.trunk_displacement import LEAST, MOST
from handscope.sessions.db.tables import PatientSession
from handscope.sessions.files.recording import LoadedRecording


def require_height(height: float) -> None:
    """InputError where it cannot be one, m."""
    if not LEAST <= height <= MOST:
        in_mm = {"height": 1e3 * height, "least": 1e3 * LEAST, "most": 1e3 * MOST}
        raise InputError("clinic.trunk_height_outside", **in_mm)


def require_worn(session: PatientSession) -> None:
    """InputError where the height of this session cannot be entered, or would change nothing."""
    if session.state == "open":
        raise InputError("clinic.height_while_measured")
    if not any(
        TRUNK in stream["sensors"]
        for file in session.recordings
        for stream in file.summary.get("streams", ())
    ):
        raise InputError("clinic.no_trunk_sensor")


def apply(recording: LoadedRecording, height: float | None) -> LoadedRecording:
    """The recording with this height (m) in its tasks; unchanged where none was entered afterwards."""
    if height is None:
        return recording
    events = (
        replace(e, details={**e.details, "trunk_height": height}) if e.trial_type == "task" else e
        for e in recording.events
    )
    return replace(recording, events=tuple(events))
