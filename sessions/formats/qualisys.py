"""Markers of a Qualisys Track Manager export (tsv, mm) as the simulator takes them: three on a hand's back, an elbow, two on each finger.

Source  QTM user manual, export to TSV: head lines of name and values, then Frame, Time and three columns a marker; marker names of Fabisch et al. 2022
"""

import gzip
from pathlib import Path

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.movements.optical_capture import Markers

BACK = ("hand_top", "hand_left", "hand_right")
ELBOWS = ("left_elbow", "right_elbow")


def read_markers(path: Path) -> Markers:
    """The markers of a .tsv or .tsv.gz file, in metres; a hidden one is NaN."""
    try:
        data = path.read_bytes()
        lines = (gzip.decompress(data) if path.suffix == ".gz" else data).decode().splitlines()
    except (OSError, EOFError, UnicodeDecodeError) as problem:
        raise InputError("qualisys.cannot_read", path=str(path), problem=str(problem)) from None
    names, table = _table(path, lines)
    column = {name: k for k, name in enumerate(names)}
    elbow = next((name for name in ELBOWS if name in column), ELBOWS[-1])
    wanted = [*BACK, elbow, *(f"{f}_{place}" for f in FINGERS for place in ("middle", "tip"))]
    if missing := [name for name in wanted if name not in column]:
        raise InputError(
            "qualisys.marker_missing", path=str(path), missing=missing[0], wanted=", ".join(wanted)
        )
    places = table[:, 2:].reshape(len(table), -1, 3)[:, [column[name] for name in wanted]] * 1e-3
    return Markers(table[:, 1], places[:, :3], places[:, 3], places[:, 4:].reshape(-1, 5, 2, 3))


def _table(path: Path, lines: list[str]) -> tuple[list[str], Array]:
    names = next((line.split("\t")[1:] for line in lines if line.startswith("MARKER_NAMES\t")), [])
    first = next(
        (k + 1 for k, line in enumerate(lines) if line.startswith("Frame\tTime\t")), len(lines)
    )
    try:
        table = np.array(
            [[float(cell or "nan") for cell in line.split("\t")] for line in lines[first:] if line],
            dtype=float,
        )
    except ValueError as problem:
        raise InputError("qualisys.damaged", path=str(path), problem=str(problem)) from None
    if table.ndim != 2 or len(table) < 2 or table.shape[1] != 2 + 3 * len(names):
        raise InputError("qualisys.not_an_export", path=str(path))
    return names, table
