"""XDF of the Lab Streaming Layer: the numeric stream with most channels, its labels as names.

In      a file that LabRecorder wrote
Out     columns by the channels' labels, and `time [s]` as pyxdf synchronises it
Source  XDF specification; package pyxdf
Limits  one stream a recording: of several of the same size the first
"""

from pathlib import Path
from typing import Any

import numpy as np

from handscope.estimators.errors import InputError
from handscope.sessions.table_import.number_columns import NumberColumns

MAGIC = b"XDF:"


def read_xdf(path: Path) -> NumberColumns:
    """The largest stream of numbers; InputError where there is none."""
    try:
        import pyxdf
    except ImportError:
        raise InputError("import.needs_pyxdf") from None
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise InputError("import.xdf_beginning", name=path.name)
    try:
        streams, _ = pyxdf.load_xdf(path)
    except Exception as problem:  # whatever a foreign file raises
        raise InputError("import.xdf_unreadable", name=path.name, problem=str(problem)) from None
    numeric = [
        s for s in streams if isinstance(s["time_series"], np.ndarray) and len(s["time_stamps"]) > 1
    ]
    if not numeric:
        raise InputError("import.xdf_without_numbers", name=path.name)
    stream = max(numeric, key=lambda s: s["time_series"].shape[1])
    values = np.asarray(stream["time_series"], float)
    names = _labels(stream, values.shape[1])
    t = np.asarray(stream["time_stamps"], float)[:, None]
    return NumberColumns(path.name, ("time [s]", *names), np.hstack([t - t[:1], values]))


def _labels(stream: Any, count: int) -> list[str]:
    """Channel labels of the description, else numbers."""
    try:
        channels = stream["info"]["desc"][0]["channels"][0]["channel"]
        labels = [str(c["label"][0]) for c in channels]
    except (KeyError, IndexError, TypeError):
        labels = []
    return labels if len(labels) == count else [f"channel {k}" for k in range(count)]
