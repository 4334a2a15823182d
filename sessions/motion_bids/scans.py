"""When a Motion-BIDS recording was measured: `acq_time` of its files in scans.tsv.

Source  BIDS 1.10, "Scans file": local time unless it ends in Z; dates before 1925 are shifted on purpose and tell nothing
"""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import PurePosixPath

from handscope.estimators.messages import Message, Value, render_english
from handscope.sessions.motion_bids.files import Files, whole
from handscope.sessions.motion_bids.tables import MISSING, rows

SHIFTED = 1925  # years before it: made unrecognisable


def start_of(files: Files, recorded: Sequence[str], warnings: list[str]) -> str | None:
    """The earliest time of the `recorded` files (paths of motion.tsv), ISO 8601 in UTC; None where no scans.tsv tells it."""
    found = []
    for path in (p for p in files if p.endswith("_scans.tsv")):
        name, folder = PurePosixPath(path).name, PurePosixPath(path).parent
        for line, row in rows(whole(files[path]), name, ("filename",)).items():
            text = row.get("acq_time", MISSING)
            if text == MISSING or str(folder / row["filename"]) not in recorded:
                continue
            try:
                found.append(datetime.fromisoformat(text).astimezone(UTC))
            except (ValueError, OverflowError):
                values: dict[str, Value] = {"name": name, "line": line, "text": text}
                warnings.append(render_english(Message("motion_bids.acq_time_unreadable", values)))
    dates = [moment for moment in found if moment.year >= SHIFTED]
    return min(dates).isoformat() if dates else None
