"""Open the markers of a C3D file (www.c3d.org); forces, analogue channels and events are passed over.

The package c3d is plain Python: a broken file raises an exception, where the faster ezc3d (C++) took the process down with it, or never came back.
What programs write is not always what the format asks for: MarkerReader takes what leaves the markers' places sure.
"""

import struct
from os import SEEK_END
from pathlib import Path

import numpy as np
from c3d import Reader

from handscope.estimators.errors import InputError
from handscope.estimators.pipeline.optical_trajectory import Markers
from handscope.sessions.files.silenced import without_warnings

SUFFIX = ".c3d"
METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
# units in full, or what is left of them in four letters
SPELT = {"mete": "m", "metr": "m", "cent": "cm", "mill": "mm"}
BLOCK = 512  # bytes
MOST_FRAMES = 2**16 - 1  # that a header can count
MOST_BYTES = 2**30  # of a file: an hour of 100 markers at 100 Hz is 0.6 GB
BROKEN = (
    AssertionError,
    AttributeError,
    IndexError,
    KeyError,
    LookupError,
    MemoryError,
    NameError,  # c3d unpacks with a name that it never set, where the processor type is none of the three
    OSError,
    OverflowError,
    TypeError,
    ValueError,
    struct.error,
)


class MarkerReader(Reader):  # type: ignore[misc]  # c3d has no types
    """Points only. Where header and parameters contradict each other: the rate is the parameters', the number of frames the header's."""

    def _check_metadata(self) -> None:
        """ValueError where a contradiction leaves the places or their unit unsure. Scales of analogue channels and the rate may differ."""
        header, scale = self._header, float(self.point_scale)
        if header.point_count != self.point_used:
            raise ValueError(
                f"its header counts {header.point_count} points, its parameters {self.point_used}"
            )
        if header.scale_factor * scale <= 0 or (
            scale > 0 and header.scale_factor != np.float32(scale)
        ):
            raise ValueError(
                f"its header scales lengths by {header.scale_factor:g}, its parameters by {scale:g}"
            )
        self._words = self._analogue_words()

    def _analogue_words(self) -> int:
        """Analogue words in a frame: header and parameters may contradict each other; the file's size decides."""
        header = self._header
        declared = {
            int(header.analog_count),
            int(Reader.analog_used.fget(self)) * int(header.analog_per_frame),
        }
        if len(declared) == 1:
            return declared.pop()
        room = self._handle.seek(0, SEEK_END) - (header.data_block - 1) * BLOCK
        frames, width = header.last_frame - header.first_frame + 1, 4 if self.point_scale < 0 else 2
        fitting = [
            words
            for words in declared
            if 0 <= room - frames * width * (4 * header.point_count + words) < BLOCK
        ]
        if len(fitting) != 1:
            raise ValueError(
                "its header and its parameters tell different numbers of analogue channels"
            )
        return fitting[0]

    @property
    def analog_used(self) -> int:
        return self._words

    @property
    def analog_per_frame(self) -> int:
        return 1

    def get_analog_transform(self) -> tuple[float, float]:
        """None: they are passed over, however their scales are written."""
        return 1.0, 0.0

    @property
    def last_frame(self) -> int:
        """The header's, unless it cannot count so far; parameters are wrong by one with some programs (OptiTrack)."""
        declared = int(Reader.last_frame.fget(self))
        return (
            declared
            if declared > MOST_FRAMES or self._header.last_frame == MOST_FRAMES
            else int(self._header.last_frame)
        )


def read_markers(path: Path) -> Markers:
    """All markers, in metres, the first frame at 0 s; NaN where a marker was not seen."""
    if not path.is_file():
        raise InputError("c3d.does_not_exist", path=str(path))
    if path.stat().st_size > MOST_BYTES:
        raise InputError("c3d.too_large", name=path.name, most_bytes=MOST_BYTES / 2**30)
    try:
        with path.open("rb") as file, without_warnings():
            reader = MarkerReader(file)
            names = _labels(reader) if reader.point_used else ()
            points = _frames(reader) if names else np.empty((0, 0, 5))
            rate, unit, declared = (
                float(reader.point_rate),
                _unit(reader),
                int(reader.last_frame) - int(reader.first_frame) + 1,
            )
    except BROKEN as problem:
        raise InputError(
            "c3d.not_readable", name=path.name, problem=" ".join(str(problem).split())[:80]
        ) from None
    if len(points) < 2 or len(names) < points.shape[1]:
        raise InputError("c3d.no_markers", name=path.name)
    if unit not in METRES:
        raise InputError("c3d.unknown_unit", name=path.name, unit=unit, metres=", ".join(METRES))
    if not np.isfinite(rate) or rate <= 0:
        raise InputError("c3d.no_rate", name=path.name, rate=rate)
    if len(points) < declared:
        raise InputError("c3d.cut_off", name=path.name, points=len(points), declared=declared)
    # a negative residual marks a point that was not seen
    hidden = (points[..., 3] < 0) | ~np.isfinite(points[..., :3]).all(axis=-1)
    places = np.where(hidden[..., None], np.nan, points[..., :3] * METRES[unit])
    return Markers(np.arange(len(points)) / rate, names[: points.shape[1]], places)


def _frames(reader: Reader) -> np.ndarray:
    """Points (n, markers, 5): place, residual, cameras; as many frames as the file holds."""
    return np.array(
        [points for _, points, _ in reader.read_frames(analog_transform=False)], dtype=float
    ).reshape(-1, reader.point_used, 5)


def _labels(reader: Reader) -> tuple[str, ...]:
    """Names of the markers; more than 255 go on in LABELS2, LABELS3, ..."""
    groups = [reader.get(f"POINT:LABELS{k}") for k in ("", *range(2, 10))]
    return tuple(
        str(label).strip(" \0")
        for group in groups
        if group is not None
        for label in np.ravel(group.string_array)
    )


def _unit(reader: Reader) -> str:
    """The first unit given: some programs give a unit for each marker, and fill up with zeros or cut off after four letters; mm where there is none."""
    unit = reader.get("POINT:UNITS")
    declared = (
        [str(word).strip(" \0") for word in np.ravel(unit.string_array)]
        if unit is not None and unit.total_bytes
        else ["mm"]
    )
    return SPELT.get(declared[0][:4].lower(), declared[0])
