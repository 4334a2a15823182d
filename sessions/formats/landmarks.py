"""Read the 21 hand landmarks of a camera's hand tracker, MediaPipe's numbers and names, from JSON or CSV. Layouts in docs/comparison.md.

In      JSON: frames with a time and 21 points; CSV: a time column and 63 columns such as x0 or index_finger_mcp_x
Out     Landmarks: s, places in a right-handed frame (x right, y down, z away from the camera), NaN where no hand was seen
Source  https://ai.google.dev/edge/mediapipe/solutions/vision/hand_landmarker: world landmarks in m; image landmarks in shares of the picture,
        z about in the scale of x, 0 at the wrist
Limits  one hand a file; MediaPipe's `handedness` counts on a mirrored picture and is not used
"""

import csv
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FINGERS, HANDS, Hand
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.landmark_trajectory import COUNT, WRIST, Landmarks

SUFFIXES = (".json", ".csv")
MOST_BYTES = 2**28  # an hour at 60 Hz is about 0.2 GB of JSON
SHORTEST_FRAME, LONGEST_FRAME = 1e-3, 1.0  # s from frame to frame; others are times in another unit
LONGEST = 4 * 3600.0  # s of a file
LARGEST = 1e5  # of a coordinate, in whatever unit
AT_WRIST = 1e-5  # of |z| at the wrist, below which points are shares of a picture
NAMES = (
    "wrist",
    *(f"thumb_{part}" for part in ("cmc", "mcp", "ip", "tip")),
    *(f"{finger}_{part}" for finger in FINGERS[1:] for part in ("mcp", "pip", "dip", "tip")),
)
WORLD = (
    "world_landmarks",
    "worldLandmarks",
    "hand_world_landmarks",
    "multi_hand_world_landmarks",
    "keypoints3D",
)
POINTS = (*WORLD, "landmarks", "hand_landmarks", "handLandmarks", "multi_hand_landmarks")
SECONDS = {
    "time": 1.0, "t": 1.0, "time_s": 1.0, "timestamp_s": 1.0, "time_ms": 1e-3, "timestamp_ms": 1e-3,
    "time_us": 1e-6, "timestamp_us": 1e-6,
}  # fmt: skip
RATES = ("rate", "fps", "frame_rate")
PICTURE = (("image_width", "image_height"), ("width", "height"))


@dataclass(frozen=True)
class FileContent:
    """What a file says, before times and scale are checked."""

    t: Array  # (n,) s
    places: Array  # (n, 21, 3)
    hand: Hand | None = None
    picture: tuple[float, float] | None = None  # width and height, pixels
    is_world: bool = False  # places have one scale already


def read_landmarks(path: Path) -> Landmarks:
    """The landmarks of a file; InputError names the frame or column that is wrong."""
    if not path.is_file():
        raise InputError("landmarks.does_not_exist", path=str(path))
    if path.stat().st_size > MOST_BYTES:
        raise InputError("landmarks.too_large", name=path.name, most_bytes=MOST_BYTES >> 20)
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("landmarks.not_utf8", name=path.name) from None
    read = _read_csv if path.suffix.lower() == ".csv" else _read_json
    content = read(text, path.name)
    _require_times(content.t, path.name)
    return Landmarks(content.t, _scale(content, path.name), content.hand)


def _read_json(text: str, name: str) -> FileContent:
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as problem:
        raise InputError("landmarks.not_json", name=name, problem=str(problem)[:80]) from None
    head: Mapping[str, Any] = value if isinstance(value, dict) else {}
    frames = head.get("frames") if head else value
    if not isinstance(frames, list) or len(frames) < 2:
        raise InputError("landmarks.no_frames", name=name)
    places = np.stack([_points(frame, k, name) for k, frame in enumerate(frames)])
    sizes = [(head[w], head[h]) for w, h in PICTURE if w in head and h in head]
    picture = (_number(sizes[0][0], name), _number(sizes[0][1], name)) if sizes else None
    is_world = all(isinstance(f, dict) and any(key in f for key in WORLD) for f in frames)
    t = _json_times(head, frames, name)
    return FileContent(t, places, _hand(head.get("hand"), name), picture, is_world)


def _json_times(head: Mapping[str, Any], frames: list[Any], name: str) -> Array:
    if (rate := next((head[key] for key in RATES if key in head), None)) is not None:
        if not 0 < (hz := _number(rate, name)) <= 1e4:
            raise InputError("landmarks.rate_impossible", name=name, hz=hz)
        return np.asarray(np.arange(len(frames)) / hz)
    known = [f for f in frames if isinstance(f, dict)]
    key = next((k for k in SECONDS if known and k in known[0]), None)
    if key is None or len(known) < len(frames):
        raise InputError(
            "landmarks.no_time",
            name=name,
            seconds=", ".join(SECONDS),
            rates=", ".join(RATES),
        )
    return SECONDS[key] * np.array(
        [_number(f.get(key), f"{name}, frame {k}") for k, f in enumerate(frames)]
    )


def _points(frame: Any, k: int, name: str) -> Array:
    """A frame's points (21, 3); NaN where it holds no hand."""
    where = f"{name}, frame {k}"
    found = frame
    if isinstance(frame, dict):
        found = next((frame[key] for key in POINTS if key in frame), None)
    if isinstance(found, list) and found and _is_hand(found[0]):
        if len(found) > 1:
            raise InputError("landmarks.several_hands", where=where, found=len(found))
        found = found[0]
    if isinstance(found, dict):
        found = found.get("landmark")
    if found is None or found == []:
        return np.full((COUNT, 3), np.nan)
    if not isinstance(found, list) or len(found) != COUNT:
        raise InputError("landmarks.point_count", where=where, count=COUNT)
    return np.array([_point(point, where) for point in found])


def _is_hand(value: Any) -> bool:
    """Whether it is a hand of many points, not one point."""
    if isinstance(value, dict):
        return "landmark" in value
    return isinstance(value, list) and (not value or isinstance(value[0], dict | list))


def _point(point: Any, where: str) -> list[float]:
    if isinstance(point, dict):
        point = [point.get(axis) for axis in "xyz"]
    if not isinstance(point, list) or len(point) < 3:
        raise InputError("landmarks.point_incomplete", where=where)
    return [_number(value, where) for value in point[:3]]


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e18:
        raise InputError("landmarks.not_a_number", where=where, value=str(value)[:20])
    return float(value)


def _hand(value: Any, name: str) -> Hand | None:
    if value is None:
        return None
    for side in HANDS:
        if str(value).lower() == side:
            return side
    raise InputError(
        "landmarks.hand_unknown", name=name, hands=" or ".join(HANDS), value=str(value)[:20]
    )


def _read_csv(text: str, name: str) -> FileContent:
    lines = text.splitlines()
    delimiter = max(";\t,", key=lines[0].count) if lines else ","
    try:
        header, *rows = [row for row in csv.reader(lines, delimiter=delimiter) if row] or [[]]
    except csv.Error as problem:
        raise InputError("landmarks.not_a_table", name=name, problem=str(problem)) from None
    columns = [column.strip().lower() for column in header]
    time = next((key for key in SECONDS if key in columns), None)
    if time is None or len(rows) < 2:
        raise InputError("landmarks.no_time_column", name=name, seconds=", ".join(SECONDS))
    values = np.array(
        [
            _row(row, len(columns), delimiter != ",", f"{name}, row {k}")
            for k, row in enumerate(rows, 2)
        ]
    )
    places = values[:, _coordinates(columns, name)].reshape(-1, COUNT, 3)
    places[~np.isfinite(places).all(axis=(1, 2))] = np.nan
    sizes = [
        (columns.index(w), columns.index(h)) for w, h in PICTURE if w in columns and h in columns
    ]
    picture = (float(values[0, sizes[0][0]]), float(values[0, sizes[0][1]])) if sizes else None
    return FileContent(SECONDS[time] * values[:, columns.index(time)], places, None, picture)


def _row(cells: Sequence[str], count: int, comma: bool, where: str) -> list[float]:
    """Numbers of a row, NaN for words and empty cells; a decimal comma where `comma` does not part the cells."""
    if len(cells) != count:
        raise InputError("landmarks.row_length", where=where, cells=len(cells), count=count)
    return [_cell(cell.replace(",", ".") if comma else cell) for cell in cells]


def _cell(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return np.nan


def _coordinates(columns: Sequence[str], name: str) -> list[int]:
    """Numbers of the 63 columns, x y z of each landmark; world landmarks go before image landmarks."""
    found: dict[tuple[int, str], int] = {}
    for k, column in enumerate(columns):
        if (which := _landmark_of(column)) and (which not in found or "world" in column):
            found[which] = k
    wanted = [(landmark, axis) for landmark in range(COUNT) for axis in "xyz"]
    missing = [
        f"{axis} of {NAMES[landmark]}" for landmark, axis in wanted if (landmark, axis) not in found
    ]
    if missing:
        raise InputError(
            "landmarks.columns_missing", name=name, missing=missing[0], missing2=len(missing) - 1
        )
    return [found[key] for key in wanted]


def _landmark_of(column: str) -> tuple[int, str] | None:
    words = [
        w
        for w in re.findall(r"[a-z]+|\d+", column)
        if w not in ("finger", "landmark", "world", "hand", "lm")
    ]
    axes = [w for w in words if w in ("x", "y", "z")]
    rest = "_".join(w for w in words if w not in ("x", "y", "z")).replace("pinky", "little")
    if len(axes) != 1:
        return None
    if rest.isdecimal() and len(rest) < 3 and int(rest) < COUNT:
        return int(rest), axes[0]
    return (NAMES.index(rest), axes[0]) if rest in NAMES else None


def _require_times(t: Array, name: str) -> None:
    if not np.isfinite(t).all() or not (np.diff(t) > 0).all():
        raise InputError("landmarks.time_not_increasing", name=name)
    interval = float(np.median(np.diff(t)))
    if not SHORTEST_FRAME <= interval <= LONGEST_FRAME:
        raise InputError("landmarks.frame_interval", name=name, seconds=interval)
    if t[-1] - t[0] > LONGEST:
        raise InputError("landmarks.too_long", name=name, hours=LONGEST / 3600)


def _scale(content: FileContent, name: str) -> Array:
    """Places (n, 21, 3) whose axes have one scale: shares of a picture are stretched by its width and height."""
    places, picture = content.places, content.picture
    if not np.isfinite(places).any():
        raise InputError("landmarks.no_hand", name=name)
    if np.nanmax(np.abs(places)) > LARGEST:
        raise InputError("landmarks.coordinates_too_large", name=name, largest=LARGEST)
    wrist = np.nanmedian(np.abs(places[:, WRIST]), axis=0)
    if content.is_world or wrist[2] > AT_WRIST or wrist[:2].max() < AT_WRIST:
        return places
    if picture is None or not all(1 <= size <= LARGEST for size in picture):
        raise InputError("landmarks.image_size_missing", name=name)
    return np.asarray(places * [picture[0], picture[1], picture[0]])
