"""The sheet as PDF at true scale: markers, a ruler, the outline of this hand in the pose."""

import json
from collections.abc import Iterable
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

import numpy as np
import typst

from handscope.app.language import Language
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.hand.geometry import MCP_DISTAL, HandGeometry
from handscope.estimators.numerics.typing import Array
from handscope.estimators.photograph.sheet import (
    ARM_LANDMARKS,
    FINGER_LANDMARKS,
    MARKER,
    RULER,
    Sheet,
)

LAYOUT = Path(__file__).with_name("sheet.typ")
CELLS = 8  # of a marker's side, its black border among them
# of the hand's length, width of what is drawn around a line from joint to joint; ours
WIDTH = dict.fromkeys(FINGERS, 0.098) | {"thumb": 0.115, "little": 0.088}
LONGEST = 0.230  # m, of a hand that fits on the paper


def print_sheet(
    sheet: Sheet,
    geometry: HandGeometry,
    language: Language,
    form: Literal["pdf", "png"] = "pdf",
    ppi: float = 144.0,
) -> bytes:
    """The sheet for a hand; as PNG for programs that look at it."""
    if geometry.palm_length / MCP_DISTAL["middle"] > LONGEST:
        raise InputError("photograph.hand_too_long", most=1e3 * LONGEST)
    compiler = typst.Compiler(
        LAYOUT,
        root=LAYOUT.parent,
        font_paths=typst.Fonts(include_system_fonts=False),
        sys_inputs={"page": json.dumps(_page(sheet, geometry, language))},
    )
    if form == "png":
        made = compiler.compile(format="png", ppi=ppi)
    else:
        made = compiler.compile(format="pdf", timestamp=0)
    assert isinstance(made, bytes)
    return made


def marker_cells(number: int) -> list[str]:
    """Rows of a marker from above, "0" black, "1" white, without its black border."""
    bits = f"{int(_codes()[number], 16):036b}"
    return [bits[k : k + 6] for k in range(0, 36, 6)]


@cache
def _codes() -> list[str]:
    """The family's codes by number, AprilTag 36h11 as OpenCV numbers its bits."""
    found: list[str] = json.loads(
        files("handscope.app.photograph").joinpath("tag36h11.json").read_text()
    )
    return found


def _page(sheet: Sheet, geometry: HandGeometry, language: Language) -> dict[str, Any]:
    """Everything in mm from the paper's upper left corner."""
    size = sheet.size
    place = {name: _mm(p, size) for name, p in sheet.landmarks(geometry).items()}
    length = 1e3 * geometry.palm_length / MCP_DISTAL["middle"]
    return {
        "language": language.code,
        "width": 1e3 * size[0],
        "height": 1e3 * size[1],
        "marker": 1e3 * MARKER,
        "cell": 1e3 * MARKER / CELLS,
        "ruler": 1e3 * RULER,
        "markers": [
            {"at": _mm(corners[0][:2], size), "rows": marker_cells(k)}
            for k, corners in sheet.free_markers(geometry).items()
        ],
        "fingers": [
            {"width": WIDTH[f] * length, "points": [place[n] for n in FINGER_LANDMARKS[f]]}
            for f in FINGERS
        ],
        "palm": _palm(place),
        "arm": [place[name] for name in ARM_LANDMARKS],
        "joints": [place[name] for f in FINGERS for name in FINGER_LANDMARKS[f][:-1]],
        "title": language.say(f"sheet.title.{sheet.hand}"),
        "how": language.say("sheet.how", length=language.number(1e3 * RULER)),
        "ruler_words": language.say("sheet.ruler", length=language.number(1e3 * RULER)),
    }


def _palm(place: dict[str, list[float]]) -> list[list[float]]:
    order = ["wrist_radial", "thumb_cmc", *(f"{f}_mcp" for f in FINGERS[1:]), "wrist_ulnar"]
    return [place[name] for name in order]


def _mm(point: Iterable[float] | Array, size: tuple[float, float]) -> list[float]:
    x, y = np.asarray(list(point), dtype=float)
    return [round(float(1e3 * (x + size[0] / 2)), 3), round(float(1e3 * (size[1] / 2 - y)), 3)]
