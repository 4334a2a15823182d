"""The recording itself as Motion-BIDS (docs/motion-bids.md): raw samples and events, no estimate."""

from handscope.sessions.exports.measured import Exported, Measured
from handscope.sessions.motion_bids.writer import tree


def write(measured: Measured) -> Exported:
    """All files of the folder."""
    files = tree(
        measured.recording,
        measured.labels["subject"],
        measured.labels["task"],
        software=measured.origin.software,
    )
    return Exported({name: bytes(data) for name, data in files.items()})
