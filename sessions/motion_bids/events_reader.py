"""Events of a Motion-BIDS recording, from its events.tsv."""

import re
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from handscope.estimators.data.samples import (
    Event,
)
from handscope.estimators.errors import InputError
from handscope.estimators.messages.system import describe
from handscope.sessions.motion_bids.files import Files, whole
from handscope.sessions.motion_bids.tables import MISSING, rows


def read_events(path: Path) -> tuple[Event, ...]:
    """Events of one events.tsv in order of onset; InputError with its line where a row is none."""
    try:
        data = path.read_bytes()
    except OSError as problem:
        raise InputError("file.cannot_read", name=str(path), problem=describe(problem)) from None
    return parse_events(data, path.name)


def parse_events(data: bytes, name: str) -> tuple[Event, ...]:
    """Events of the content of an events.tsv in order of onset; InputError with its line where a row is none."""
    found = rows(data, name, ("onset", "duration", "trial_type")).items()
    events = (_event(row, name, number) for number, row in found)
    return tuple(sorted(events, key=lambda e: e.onset))


def events_of(files: Files, inside: str) -> tuple[Event, ...]:
    """Events of a recording in the order of their onsets, s."""
    folder, stem = PurePosixPath(inside).parent, PurePosixPath(inside).name
    names = [
        p for p in files if re.sub("_tracksys-[^_/]+", "", p) == str(folder / f"{stem}_events.tsv")
    ]
    events = []
    for path in sorted(names):
        name = PurePosixPath(path).name
        for number, row in rows(
            whole(files[path]), name, ("onset", "duration", "trial_type")
        ).items():
            events.append(_event(row, name, number))
    return tuple(sorted(events, key=lambda e: e.onset))


def _event(row: dict[str, str], name: str, line: int) -> Event:
    try:
        onset, duration = (
            float(row["onset"]),
            0.0 if row["duration"] == MISSING else float(row["duration"]),
        )
    except ValueError:
        raise InputError(
            "motion_bids.event_not_a_number",
            name=name,
            line=line,
            onset=row["onset"],
            duration=row["duration"],
        ) from None
    if not (np.isfinite(onset) and np.isfinite(duration) and duration >= 0):
        raise InputError("motion_bids.event_not_finite", name=name, line=line)
    details: dict[str, Any] = {
        key: value
        for key, value in row.items()
        if key not in ("onset", "duration", "trial_type") and value not in (MISSING, "")
    }
    for key in [k for k in details if k.endswith("_deg")]:
        try:
            details[key] = float(details[key])
        except ValueError:
            raise InputError(
                "motion_bids.event_not_degrees",
                name=name,
                line=line,
                key=key,
                value=details[key],
            ) from None
    return Event(onset, duration, row["trial_type"], details)
