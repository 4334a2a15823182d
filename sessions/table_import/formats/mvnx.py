"""MVN's mvnx: orientations of segments, fingers too where they were tracked.

In      an XML file with subject/segments/segment and subject/frames/frame; times in ms
Out     columns `left hand quat w` and so on: q_GS of MVN's segments in its frame with z up
Source  Xsens MVN user manual, appendix on MVNX; finger segments in its order
Limits  the segments' frames are MVN's: the initial pose makes them ours
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, HANDS
from handscope.sessions.table_import.number_columns import NumberColumns

BODY = {f"{side.title()}{name}": f"{side} {segment}" for side in HANDS for name, segment in (("ForeArm", "forearm"), ("Hand", "hand"))}  # fmt: skip
FINGER_SEGMENTS = 20  # a hand: carpus, three of the thumb, four of each finger with its metacarpal
COMPONENTS = "wxyz"


def read_mvnx(path: Path) -> NumberColumns:
    """The orientations of hands and forearms; InputError where the file has none."""
    try:
        root = ET.parse(path).getroot()
    except (ET.ParseError, OSError, ValueError) as problem:
        raise InputError("import.mvnx_unreadable", name=path.name, problem=str(problem)) from None
    segments = [str(s.get("label")) for s in _find_all(root, "segment")]
    frames = [f for f in _find_all(root, "frame") if f.get("type") == "normal"]
    if not segments or not frames:
        raise InputError("import.mvnx_without_movement", name=path.name)
    names = [name for s in segments for name in _columns(BODY.get(s, ""))]
    kept = [k for k, s in enumerate(segments) if s in BODY]
    rows = [_row(frame, len(segments), kept, path.name) for frame in frames]
    fingers = [side for side in HANDS if _text(frames[0], f"orientationFingers{side.title()}")]
    names += [name for side in fingers for s in _finger_segments(side) for name in _columns(s)]
    for row, frame in zip(rows, frames):
        for side in fingers:
            row.extend(_fingers(frame, side, path.name))
    return NumberColumns(path.name, ("time [ms]", *names), np.array(rows))


def _find_all(root: ET.Element, name: str) -> Iterator[ET.Element]:
    """Elements of a name, whatever namespace the file declares."""
    return (e for e in root.iter() if e.tag.rpartition("}")[2] == name)


def _columns(segment: str) -> list[str]:
    return [f"{segment} quat {c}" for c in COMPONENTS] if segment else []


def _text(frame: ET.Element, name: str) -> str:
    return next((e.text or "" for e in _find_all(frame, name)), "")


def _numbers(frame: ET.Element, name: str, count: int, file: str) -> list[float]:
    try:
        found = [float(x) for x in _text(frame, name).split()]
    except ValueError:
        found = []
    if len(found) != count:
        raise InputError(
            "import.mvnx_frame_numbers",
            file=file,
            frame=str(frame.get("index")),
            count=count,
            element=name,
        )
    return found


def _row(frame: ET.Element, segments: int, kept: Sequence[int], file: str) -> list[float]:
    """Time and the orientations kept of one frame."""
    numbers = _numbers(frame, "orientation", 4 * segments, file)
    try:
        time = float(frame.get("time", ""))
    except ValueError:
        raise InputError(
            "import.mvnx_frame_time", file=file, frame=str(frame.get("index"))
        ) from None
    return [time, *(x for k in kept for x in numbers[4 * k : 4 * k + 4])]


def _finger_segments(side: str) -> list[str]:
    return [f"{side} {segment}" for finger in FINGERS for segment in CHAINS[finger]]


def _fingers(frame: ET.Element, side: str, file: str) -> Iterator[float]:
    """The fingers' orientations without carpus and the metacarpals of index to little."""
    name = f"orientationFingers{side.title()}"
    numbers = _numbers(frame, name, 4 * FINGER_SEGMENTS, file)
    for k in range(FINGER_SEGMENTS):
        if k in (1, 2, 3) or (k > 3 and (k - 4) % 4 > 0):
            yield from numbers[4 * k : 4 * k + 4]
