"""Photographs of hands on the sheet, drawn with known truth: perspective, a phone's lens, blur, shadow, noise.

The hand is balls along its bones, of other thicknesses than the program assumes; the sheet is the printed one. It shares the sheet's
layout with what it judges, and nothing of the camera's model but the pinhole: the lens is of another formula (division model).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from handscope.app.language import languages
from handscope.app.photograph.printing import print_sheet
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import DEVIATION, FINGERS, JOINT, JOINTS, Hand, side_sign
from handscope.estimators.hand.forward_kinematics import joint_places
from handscope.estimators.hand.geometry import HandGeometry, sized
from handscope.estimators.numerics.typing import Array
from handscope.estimators.photograph.sheet import (
    FOREARM,
    LANDMARKS,
    Sheet,
    pose_angles,
)
from handscope.estimators.simulation.person import draw_person

SIZE = (2016, 1512)  # pixels
TEXTURE = 8.0  # pixels a mm of the printed sheet
SPREAD, WRIST = np.radians(4.0), np.radians(6.0)  # standard deviations of the pose
ASIDE = np.radians(30.0)  # of where a second picture is taken from, about opposite the first
# radius of wrist, MCP, PIP, DIP, tip, as shares of the hand's length, and how much people differ
RADIUS = {"wrist": 0.100, "root": 0.070, "second": 0.048, "third": 0.038, "tip": 0.032}
RADIUS_SD = 0.12


@dataclass(frozen=True)
class Rendered:
    """A picture and what is true of it."""

    jpeg: bytes
    sheet: Sheet
    geometry: HandGeometry
    deviation: Mapping[str, float]  # rad, by joint
    marks: Mapping[str, Array]  # (2,) pixels, where the landmarks are seen


def render(rng: np.random.Generator, hand: Hand, paper: str, tilt: float) -> Rendered:
    """A photograph of somebody's hand, the camera `tilt` rad from above."""
    return render_sides(rng, hand, paper, [tilt])[0]


def render_sides(
    rng: np.random.Generator, hand: Hand, paper: str, tilts: Sequence[float]
) -> list[Rendered]:
    """Photographs of a hand that stays as it lies, each tilted by so many rad; every other from about the opposite side."""
    geometry, sheet = draw_person(hand, rng).true, Sheet(paper, hand)
    angles = pose_angles()
    angles[[JOINT[f"{f}_mcp"] for f in FINGERS[1:]], DEVIATION] = SPREAD * rng.normal(size=4)
    angles[JOINT["thumb_cmc"], DEVIATION] += 2 * SPREAD * rng.normal()
    angles[JOINT["wrist"], DEVIATION] = WRIST * rng.normal()
    seen, balls = _lay(geometry, angles, sheet, rng)
    deviation = {j.name: float(angles[k, DEVIATION]) for k, j in enumerate(JOINTS)}
    made: list[Rendered] = []
    aside = 0.0
    for k, tilt in enumerate(tilts):
        lens = _Lens.draw(rng, tilt, aside + np.pi + ASIDE * rng.normal() if k % 2 else None)
        aside = lens.aside
        jpeg = _photograph(sheet, geometry, balls, lens, rng)
        marks = dict(zip(LANDMARKS, lens.project(seen)))
        made.append(Rendered(jpeg, sheet, geometry, deviation, marks))
    return made


def _lay(
    geometry: HandGeometry, angles: Array, sheet: Sheet, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Landmarks (n, 3) as they are seen, and balls (m, 4: centre, radius), on the sheet, m."""
    sign = side_sign(geometry.hand)
    straight = angles.copy()
    straight[JOINT["wrist"]] = 0.0  # the hand lies straight on the sheet, the arm comes from aside
    ends = sign * joint_places(joint_angles.compose(straight), geometry)
    roots = sign * geometry.roots()
    length = geometry.palm_length / 0.446
    radius = {k: r * length * (1 + RADIUS_SD * rng.normal()) for k, r in RADIUS.items()}
    levels = ("root", "second", "third", "tip")
    points, sizes, seen = [], [], []
    for k, finger in enumerate(FINGERS):
        along = ends[k, -1] - ends[k, -2]
        outer = ends[k, -1] + geometry.tip_tissue[finger] * along / np.linalg.norm(along)
        chain = np.array([roots[k], *ends[k, :-1], outer])
        # a landmark is seen at the top of its joint, a fingertip's outline half way up
        tops = [2 * radius[level] for level in levels[:3]] + [radius["tip"]]
        seen += [np.array([p[1], p[2], top]) for p, top in zip(chain, tops)]
        chain[-1] -= radius["tip"] * along / np.linalg.norm(along)
        points.append(chain[:, 1:])
        sizes.append([radius[level] for level in levels])
        points.append(np.array([[0.0, 0.0], roots[k][1:]]))
        sizes.append([radius["root"], radius["root"]])
    w = angles[JOINT["wrist"], DEVIATION]
    arm = -np.array([np.cos(w), -np.sin(w)])  # distal, ulnar: towards the elbow
    across = np.array([-arm[1], arm[0]]) * -1.0  # radial is negative ulnar
    for along_arm, wide in ((0.0, 0.028), (FOREARM * length, 0.031)):
        # at the wrist, where arm and hand meet, the edges are across the hand
        side = np.array([0.0, 1.0]) if along_arm == 0.0 else across
        seen += [np.array([*(along_arm * arm + s * wide * side), radius["wrist"]]) for s in (-1, 1)]
    points.append(np.array([[0.0, 0.0], 0.25 * arm]))
    sizes.append([1.3 * radius["wrist"], 1.5 * radius["wrist"]])
    place = _Placement.draw(sheet, np.array(seen), rng)
    return place.on_sheet(np.array(seen)), place.on_sheet(_balls(points, sizes))


def _balls(points: list[Array], sizes: list[list[float]]) -> Array:
    """Balls (m, 4) between the points of each chain; distal, ulnar, height, radius."""
    found = []
    for chain, radii in zip(points, sizes):
        for a, b, r, s in zip(chain[:-1], chain[1:], radii[:-1], radii[1:]):
            share = np.linspace(0, 1, 24)[:, None]
            r_ab = r + (s - r) * share
            found.append(np.hstack([a + (b - a) * share, r_ab, r_ab]))
    return np.concatenate(found)


@dataclass(frozen=True)
class _Placement:
    """How the hand was laid on the sheet: not quite as drawn."""

    across: float  # of ulnar on the sheet's x
    shift: Array  # (2,) m
    turn: float  # rad

    @classmethod
    def draw(cls, sheet: Sheet, seen: Array, rng: np.random.Generator) -> "_Placement":
        across = -1.0 if sheet.hand == "left" else 1.0
        middle = -across * (seen[:, 1].max() + seen[:, 1].min()) / 2
        shift = np.array([middle, -0.23 * sheet.size[1]]) + 0.004 * rng.normal(size=2)
        return cls(across, shift, float(np.radians(3.0) * rng.normal()))

    def on_sheet(self, points: Array) -> Array:
        """Of (n, 3 or more: distal, ulnar, the rest)."""
        x, y = self.across * points[:, 1], points[:, 0]
        c, s = np.cos(self.turn), np.sin(self.turn)
        flat = np.stack([c * x - s * y, s * x + c * y], axis=-1) + self.shift
        return np.hstack([flat, points[:, 2:]])


@dataclass(frozen=True)
class _Lens:
    """Pinhole, then the division model: r_u = r_d / (1 + k r_d^2)."""

    focal: float  # pixels
    k: float  # of tangents
    centre: Array  # (2,) pixels
    rotation: Array  # (3, 3) from the sheet to the camera
    p_c: Array  # (3,) m
    aside: float  # rad, of the axis about which it is tilted

    @classmethod
    def draw(cls, rng: np.random.Generator, tilt: float, aside: float | None) -> "_Lens":
        """Tilted about an axis of the sheet, None: about any."""
        focal = max(SIZE) * rng.uniform(0.68, 0.84)
        aside = rng.uniform(0, 2 * np.pi) if aside is None else aside
        roll = np.pi / 2 + np.radians(5) * rng.normal()
        axis = np.array([np.cos(aside), np.sin(aside), 0.0])
        to_camera = cv2.Rodrigues(roll * np.array([0.0, 0.0, 1.0]))[0] @ np.diag([1.0, -1.0, -1.0])
        rotation = cv2.Rodrigues(tilt * axis)[0] @ to_camera
        distance = 0.45 * focal / max(SIZE) * rng.uniform(1.0, 1.2)
        target = rotation @ np.append(0.01 * rng.normal(size=2), 0.0)
        centre = np.array(SIZE) / 2 + 8 * rng.normal(size=2)
        return cls(
            focal, rng.uniform(-0.06, 0.06), centre, rotation, [0, 0, distance] - target, aside
        )

    def project(self, points: Array) -> Array:
        """Pixels (n, 2) of points (n, 3) on the sheet."""
        at = points @ self.rotation.T + self.p_c
        u = at[:, :2] / at[:, 2:]
        r2 = (u**2).sum(axis=1, keepdims=True)
        # of r_u = r_d / (1 + k r_d^2) the root near r_u
        drawn = 2.0 / (1.0 + np.sqrt(1.0 - 4.0 * self.k * r2))
        return np.asarray(self.centre + self.focal * u * drawn)

    def sheet_map(self, sheet: Sheet) -> tuple[Array, Array]:
        """For each pixel where in the texture it looks."""
        v, u = np.mgrid[: SIZE[1], : SIZE[0]].astype(float)
        d = np.stack([(u - self.centre[0]), (v - self.centre[1])], axis=-1) / self.focal
        d = d / (1.0 + self.k * (d**2).sum(axis=-1, keepdims=True))
        ray = np.concatenate([d, np.ones((*d.shape[:2], 1))], axis=-1) @ self.rotation
        lens = -self.rotation.T @ self.p_c
        at = lens[:2] - (lens[2] / ray[..., 2:]) * ray[..., :2]
        width, height = sheet.size
        return (
            ((at[..., 0] + width / 2) * 1e3 * TEXTURE - 0.5).astype(np.float32),
            ((height / 2 - at[..., 1]) * 1e3 * TEXTURE - 0.5).astype(np.float32),
        )


def _photograph(
    sheet: Sheet, geometry: HandGeometry, balls: Array, lens: _Lens, rng: np.random.Generator
) -> bytes:
    png = print_sheet(sheet, sized(geometry.hand), languages()["en"], "png", 25.4 * TEXTURE)
    texture = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert texture is not None
    picture = cv2.remap(
        texture, *lens.sheet_map(sheet), cv2.INTER_AREA, borderValue=(96, 128, 150)
    ).astype(np.float32)
    shadow = np.zeros(SIZE[::-1], np.float32)
    cast = np.column_stack([balls[:, :2] + [0.012, -0.008], 0 * balls[:, 2], balls[:, 3]])
    _draw(shadow, lens, cast, 1.0)
    picture *= 1 - 0.45 * cv2.GaussianBlur(shadow, (0, 0), 18)[..., None]
    skin = np.zeros(SIZE[::-1], np.float32)
    _draw(skin, lens, balls, 1.0)
    picture = np.where(skin[..., None] > 0, np.array([120, 150, 205], np.float32), picture)
    bright, dark = map(float, rng.uniform(0.6, 1.1, 2))
    slope = np.linspace(bright, dark, SIZE[0], dtype=np.float32)[:, None]
    blurred = cv2.GaussianBlur(picture * slope, (0, 0), rng.uniform(0.6, 1.8))
    noisy = np.clip(blurred + 4 * rng.standard_normal(picture.shape, np.float32), 0, 255)
    done, jpeg = cv2.imencode(".jpg", noisy.astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 85])
    assert done
    return bytes(jpeg)


def _draw(canvas: Array, lens: _Lens, balls: Array, value: float) -> None:
    """Each ball as a disc."""
    middles = lens.project(balls[:, :3])
    depth = (balls[:, :3] @ lens.rotation.T + lens.p_c)[:, 2]
    for (x, y), r in zip(middles, lens.focal * balls[:, 3] / depth):
        cv2.circle(canvas, (round(x), round(y)), round(r), value, -1, cv2.LINE_AA)
