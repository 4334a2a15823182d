"""The known truth of a simulated recording, written beside it as a derivative."""

from handscope.estimators.data.trajectory import Trajectory
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids.writer import pretty
from handscope.sessions.tables_io.number_table import Data
from handscope.sessions.tables_io.trajectory_table import channels_of, table_of


def truth_files(
    truth: Trajectory, recording: LoadedRecording, subject: str, task: str, software: str
) -> dict[str, Data]:
    """Files under derivatives/truth, in the layout of the derivative."""
    base = f"derivatives/truth/sub-{subject}/motion/sub-{subject}_task-{task}_tracksys-truth_desc-truth"
    columns, table = table_of(truth)
    about = {
        "TaskName": task,
        "SamplingFrequency": recording.streams[0].rate,
        "MeasuredHand": recording.hand,
        "software_version": software,
        "method": "truth",
    }
    return {
        f"{base}_motion.tsv": table,
        f"{base}_channels.tsv": channels_of(columns),
        f"{base}_motion.json": pretty(about),
    }
