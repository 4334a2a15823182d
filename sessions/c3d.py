"""Open the markers of a C3D file (www.c3d.org); forces, analogue channels and events are passed over.

The package c3d is plain Python: a broken file raises an exception, where the faster ezc3d (C++) took the process down with it.
"""

import struct
import warnings
from pathlib import Path

import numpy as np
from c3d import Reader

from estimators.errors import InputError
from estimators.marker_clusters import Markers

SUFFIX = ".c3d"
METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
MOST_BYTES = 2**30  # of a file: an hour of 100 markers at 100 Hz is 0.6 GB
BROKEN = (
    AssertionError,
    AttributeError,
    IndexError,
    KeyError,
    LookupError,
    MemoryError,
    OSError,
    OverflowError,
    TypeError,
    ValueError,
    struct.error,
)


def read_markers(path: Path) -> Markers:
    """All markers, in metres, the first frame at 0 s; NaN where a marker was not seen."""
    if not path.is_file():
        raise InputError(f"{path} does not exist or is no file; give a C3D file")
    if path.stat().st_size > MOST_BYTES:
        raise InputError(f"{path.name} is larger than {MOST_BYTES / 2**30:.0f} GB; export the stretch of the task only")
    try:
        with path.open("rb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            reader = Reader(file)
            rate, names, unit = float(reader.point_rate), _labels(reader), _unit(reader)
            told = int(reader.last_frame) - int(reader.first_frame) + 1
            points = _frames(reader) if names and reader.point_used else np.empty((0, 0, 5))
    except BROKEN as problem:
        raise InputError(f"{path.name} is no C3D file that can be read ({' '.join(str(problem).split())[:80]}); export it again") from None
    if len(points) < 2 or len(names) < points.shape[1]:
        raise InputError(f"{path.name} holds no markers over time; export the labelled trajectories")
    if unit not in METRES:
        raise InputError(f"{path.name} has the unknown unit {unit!r} of length (POINT:UNITS); it is {', '.join(METRES)}")
    if not np.isfinite(rate) or rate <= 0:
        raise InputError(f"{path.name} has no usable rate of frames (POINT:RATE is {rate:g}); export it again")
    if len(points) < told:
        raise InputError(f"{path.name} was cut off: it holds {len(points)} of {told} frames; copy or export it again")
    hidden = (points[..., 3] < 0) | ~np.isfinite(points[..., :3]).all(axis=-1)  # a negative residual marks a point that was not seen
    places = np.where(hidden[..., None], np.nan, points[..., :3] * METRES[unit])
    return Markers(np.arange(len(points)) / rate, names[: points.shape[1]], places)


def _frames(reader: Reader) -> np.ndarray:
    """Points (n, markers, 5): place, residual, cameras; as many frames as the file holds."""
    return np.array([points for _, points, _ in reader.read_frames(analog_transform=False)], dtype=float).reshape(-1, reader.point_used, 5)


def _labels(reader: Reader) -> tuple[str, ...]:
    """Names of the markers; more than 255 go on in LABELS2, LABELS3, ..."""
    groups = [reader.get(f"POINT:LABELS{k}") for k in ("", *range(2, 10))]
    return tuple(str(label).strip() for group in groups if group is not None for label in np.ravel(group.string_array))


def _unit(reader: Reader) -> str:
    unit = reader.get("POINT:UNITS")
    return str(unit.string_value).strip() if unit is not None else "mm"
