"""A photograph of a hand on the sheet: its markers found, where the camera stood, where the landmarks will be.

OpenCV finds the markers; it comes with `pip install "handscope[photograph]"`.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from types import ModuleType
from typing import Any

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.hand.geometry import MCP_DISTAL, HandGeometry
from handscope.estimators.numerics.typing import Array
from handscope.estimators.photograph import camera as cameras
from handscope.estimators.photograph.camera import Camera
from handscope.estimators.photograph.hand_figures import (
    Figures,
    View,
    landmark_heights,
    measure,
)
from handscope.estimators.photograph.sheet import RULER, Sheet, sheet_of
from handscope.sessions.files.silenced import without_warnings

LEAST_MARKERS = 4
LEAST_SPREAD = 0.4  # of the paper's height, between markers, along the paper and across it
LEAST_SIDE = 24  # pixels of a marker's side: eight squares of three
MOST_TILT = np.radians(35.0)  # ours: the hand's height then moves a joint by two thirds of itself
MOST_MISFIT = 1.0e-3  # m, of markers against the sheet: more, and the paper was not flat
LARGEST = 30 * 2**20  # bytes of a picture
MOST_PIXELS, LEAST_PIXELS = 60e6, 0.3e6
SHOWN = 2000  # pixels, of the longer side of a picture that is kept
RULER_RANGE = (0.8, 1.25)  # of its length; no printer scales more by mistake
EXIF, FOCAL_35MM = 0x8769, 0xA405  # tags of a picture's own description


@dataclass(frozen=True)
class Photograph:
    """A picture whose camera is known."""

    sheet: Sheet
    camera: Camera
    markers: int  # found

    def proposed(self, geometry: HandGeometry) -> dict[str, Array]:
        """Where the landmarks (2,) of this hand are in the picture, pixels, if it lies as drawn."""
        on_sheet = self.sheet.landmarks(geometry)
        height = landmark_heights(geometry.palm_length / MCP_DISTAL["middle"])
        points = np.column_stack([np.array(list(on_sheet.values())), height])
        return dict(zip(on_sheet, self.camera.project(points)))


def measure_hand(pictures: Sequence[tuple[Photograph, Mapping[str, Array]]]) -> Figures:
    """What the landmarks (2,), pixels, in photographs of a hand that lies alike in all tell of it."""
    views = [View(photograph.camera, marks) for photograph, marks in pictures]
    return measure(views, pictures[0][0].sheet.hand)


def open_photograph(data: bytes, hand: Hand, ruler: float | None = None) -> Photograph:
    """The photograph in a JPEG or PNG file; `ruler` is the length of the printed ruler, m, None: as it should be.

    InputError says what to do where a picture will not do.
    """
    scale = _scale(ruler)
    pixels, focal = _read(data)
    found = _markers(pixels)
    sheet = _sheet_of(found, hand)
    drawn = sheet.markers()
    seen = {k: corners for k, corners in found.items() if k in drawn}
    _require_enough(seen, sheet)
    size = (int(pixels.shape[1]), int(pixels.shape[0]))
    camera = cameras.locate(
        scale * np.concatenate([drawn[k] for k in seen]),
        np.concatenate(list(seen.values())),
        size,
        None if focal is None else cameras.share_of_side(focal, size),
    )
    if camera.misfit > MOST_MISFIT:
        raise InputError("photograph.sheet_not_flat", misfit=1e3 * camera.misfit)
    if camera.tilt > MOST_TILT:
        raise InputError("photograph.too_oblique", tilt=float(np.degrees(camera.tilt)))
    return Photograph(sheet, camera, len(seen))


def without_description(data: bytes) -> bytes:
    """The picture alone as JPEG, upright: no place, no time, no device; at most SHOWN pixels long."""
    from PIL import Image, ImageOps

    with _open_picture(data) as picture:
        upright = ImageOps.exif_transpose(picture).convert("RGB")
    upright.thumbnail((SHOWN, SHOWN))
    plain, out = Image.frombytes("RGB", upright.size, upright.tobytes()), BytesIO()
    plain.save(out, "JPEG", quality=85)
    return out.getvalue()


def _scale(ruler: float | None) -> float:
    scale = 1.0 if ruler is None else ruler / RULER
    if not RULER_RANGE[0] <= scale <= RULER_RANGE[1]:
        raise InputError("photograph.ruler_length", length=1e3 * (ruler or 0.0))
    return scale


@contextmanager
def _open_picture(data: bytes) -> Iterator[Any]:
    """The picture; what its library says of a damaged description is not needed."""
    from PIL import Image

    with (
        without_warnings(),
        Image.open(BytesIO(data), formats=("JPEG", "PNG")) as picture,
    ):
        yield picture


def _read(data: bytes) -> tuple[Any, float | None]:
    """The picture in grey, upright as its file says, and its focal length on 35 mm film, mm."""
    from PIL import Image, ImageOps

    try:
        with _open_picture(data) as picture:
            many = picture.width * picture.height
            if not LEAST_PIXELS <= many <= MOST_PIXELS:
                raise InputError(
                    "photograph.size_outside", width=picture.width, height=picture.height
                )
            focal = picture.getexif().get_ifd(EXIF).get(FOCAL_35MM)
            grey = np.asarray(ImageOps.exif_transpose(picture).convert("L"))
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        raise InputError("photograph.unreadable") from None
    if isinstance(focal, int | float) and 15 <= focal <= 120:
        return grey, float(focal)
    return grey, None


def _markers(grey: Any) -> dict[int, Array]:
    """Corners (4, 2) in pixels of every marker of the family, by its number."""
    aruco = _opencv().aruco
    parameters = aruco.DetectorParameters()
    parameters.cornerRefinementMethod = aruco.CORNER_REFINE_SUBPIX
    detector = aruco.ArucoDetector(
        aruco.getPredefinedDictionary(aruco.DICT_APRILTAG_36h11), parameters
    )
    corners, numbers, _ = detector.detectMarkers(grey)
    if numbers is None:
        return {}
    return {
        int(k): np.asarray(c, dtype=float).reshape(4, 2) for k, c in zip(numbers.ravel(), corners)
    }


def _opencv() -> ModuleType:
    try:
        import cv2
    except ImportError:
        raise InputError("photograph.without_opencv") from None
    module: ModuleType = cv2
    return module


def _sheet_of(found: dict[int, Array], hand: Hand) -> Sheet:
    """The sheet that most markers are of."""
    sheets = [s for s in map(sheet_of, found) if s is not None]
    if not sheets:
        raise InputError("photograph.no_marker")
    sheet = max(set(sheets), key=sheets.count)
    if sheet.hand != hand:
        raise InputError("photograph.other_hand", sheet=sheet.hand, hand=hand)
    return sheet


def _require_enough(seen: dict[int, Array], sheet: Sheet) -> None:
    if len(seen) < LEAST_MARKERS:
        raise InputError("photograph.few_markers", count=len(seen), least=LEAST_MARKERS)
    middles = np.array([sheet.markers()[k].mean(axis=0)[:2] for k in seen])
    wide = np.ptp(middles, axis=0)
    if wide[0] == 0 or wide[1] < LEAST_SPREAD * sheet.size[1]:
        raise InputError("photograph.markers_on_one_side")
    sides = [np.linalg.norm(c - np.roll(c, 1, axis=0), axis=1).min() for c in seen.values()]
    if np.median(sides) < LEAST_SIDE:
        raise InputError("photograph.too_far", side=float(np.median(sides)), least=LEAST_SIDE)
