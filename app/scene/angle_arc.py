"""What a task measures, drawn on the hand: an arc at the joint with its number and the band to reach, or the line between thumb and index tip.

In      a quantity of protocols.CURVES, the angles shown (joints, 3) rad, a band in rad; places in the hand's frame
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from viser import ViserServer

from handscope.app.scene import palette
from handscope.app.scene.drawn_line import DrawnLine
from handscope.app.scene.mesh import bones
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import (
    ANGLES,
    DEVIATION,
    FINGER_JOINTS,
    FINGERS,
    FLEXION,
    JOINT,
    side_sign,
)
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

POINTS = 13  # of a drawn line
RADIUS, BAND = 0.030, 0.035  # m: of the arc, and of the band outside it
BESIDE = 0.012  # m from the bone's axis to the finger's side, where skin hides nothing
NUMBER = 1.45  # of the radius, where the number stands
THICK, THIN, BROAD = 0.001, 0.0004, 0.0018  # m: half of a line's thickness
AGAIN = 0.2  # s until the number is written again, as the angles in the panel: each costs a browser more than the hand's bones
APERTURE = "aperture"
# Latin, the same in every language that reads the scene: what an angle below and above zero is, "" for the one that the task is named by
DIRECTIONS = {FLEXION: ("ext.", ""), DEVIATION: ("add.", "abd.")}
SIDES = {
    "wrist": ("rad.", "uln."),
    "middle_mcp": ("rad.", "uln."),
    "thumb_cmc": ("abd.", "add."),
    "index_mcp": ("abd.", "add."),
}


@dataclass(frozen=True)
class Measured:
    """A quantity of a task and the band of it that is asked for, rad."""

    what: str
    band: tuple[float, float] | None = None


class AngleArc:
    """Below the hand's frame `name`, whose parts are `scale` scene units a metre. For one thread at a time, within the scene's lock."""

    def __init__(
        self,
        server: ViserServer,
        name: str,
        geometry: HandGeometry,
        scale: float,
        later: Callable[[float, Callable[[], None]], None],
    ) -> None:
        """`later` does something so many s later."""
        self._geometry, self._scale, self._later = geometry, scale, later
        self._arc, self._ray_straight, self._ray_bent, self._span, self._band = (
            DrawnLine(server, f"{name}/measured_{part}", points, scale * thick, colour)
            for part, points, thick, colour in (
                ("arc", POINTS, THICK, palette.MEASURED),
                ("ray_straight", 2, THIN, palette.MEASURED),
                ("ray_bent", 2, THIN, palette.MEASURED),
                ("span", 2, THICK, palette.MEASURED),
                ("band", POINTS, BROAD, palette.TARGET),
            )
        )
        self._text, self._has_waited = "", True
        self._number = server.scene.add_label(
            f"{name}/number", "", visible=False, font_screen_scale=1.6, anchor="center-center"
        )

    def show(self, measured: Measured | None, angles: Array, with_number: bool) -> None:
        """Draw the quantity of a hand with these angles, all known; None takes it away."""
        drawn = None if measured is None else _lines(measured, angles, self._geometry)
        rays = (None, None) if drawn is None or drawn.rays is None else drawn.rays
        self._place(self._arc, None if drawn is None else drawn.arc)
        self._place(self._span, None if drawn is None else drawn.span)
        self._place(self._band, None if drawn is None else drawn.band)
        for line, ray in zip((self._ray_straight, self._ray_bent), rays):
            self._place(line, ray)
        if drawn is not None:
            self._number.position = self._scale * drawn.number_at
            self._text = drawn.text
            if self._has_waited:
                self._write()
        self._number.visible = drawn is not None and with_number

    def _write(self) -> None:
        if self._number.text != self._text:
            self._number.text, self._has_waited = self._text, False
            self._later(AGAIN, self._write_again)

    def _write_again(self) -> None:
        self._has_waited = True
        self._write()

    def _place(self, line: DrawnLine, points: Array | None) -> None:
        if points is None:
            line.hide()
        else:
            line.draw(self._scale * points)


@dataclass(frozen=True)
class _Lines:
    """Points of lines, m in the hand's frame."""

    arc: Array | None  # (POINTS, 3)
    rays: Array | None  # (2 rays, 2 ends, 3)
    span: Array | None  # (2 ends, 3): straight, so it needs no bones between
    band: Array | None  # (POINTS, 3)
    number_at: Array  # (3,)
    text: str


def _lines(measured: Measured, angles: Array, geometry: HandGeometry) -> _Lines | None:
    """What to draw; None for a quantity that no joint of the drawn hand shows."""
    if measured.what == APERTURE:
        return _aperture(angles, geometry)
    joint, _, name = measured.what.rpartition("_")
    if joint not in JOINT or name not in ANGLES[: DEVIATION + 1]:
        return None
    axis = ANGLES.index(name)
    value = float(angles[JOINT[joint], axis])
    at = _arc_of(joint, axis, angles, geometry)
    straight, bent = at(np.array([0.0, value]), RADIUS)
    centre = at(np.zeros(1), 0.0)[0]
    band = None
    if measured.band is not None:
        band = at(np.linspace(*measured.band, POINTS), BAND)
    return _Lines(
        at(np.linspace(0.0, value, POINTS), RADIUS),
        np.array([[centre, straight], [centre, bent]]),
        None,
        band,
        at(np.array([0.5 * value]), NUMBER * RADIUS)[0],
        _words(joint, axis, round(float(np.degrees(value)))),
    )


def _words(joint: str, axis: int, degrees: int) -> str:
    """ "63°", "ext. 4°": a sign would be read either way."""
    below, above = DIRECTIONS[axis] if axis == FLEXION else SIDES.get(joint, DIRECTIONS[axis])
    direction = below if degrees < 0 else above if degrees else ""
    return f"{direction} {abs(degrees)}°".strip()


def _aperture(angles: Array, geometry: HandGeometry) -> _Lines:
    thumb, index = bones.tips(angles, geometry)[:2]
    dorsal = side_sign(geometry.hand) * np.array([1.0, 0.0, 0.0])
    size = float(np.linalg.norm(thumb - index))
    span = np.array([thumb, index])
    return _Lines(
        None, None, span, None, 0.5 * (thumb + index) + 0.016 * dorsal, f"{1e3 * size:.0f} mm"
    )


def _arc_of(
    joint: str, axis: int, angles: Array, geometry: HandGeometry
) -> Callable[[Array, float], Array]:
    """A function from values (n,) of one of a joint's angles (rad) and a radius (m) to places (n, 3) beside the joint."""
    sign, own = side_sign(geometry.hand), angles[JOINT[joint]]
    finger = next((f for f in FINGERS if joint in FINGER_JOINTS[f]), None)
    if finger is None:
        place, q_parent = np.zeros(3), quat.conjugate(joint_angles.compose(own))
    else:
        q, places = bones.chain(angles, geometry)
        row, k = FINGERS.index(finger), FINGER_JOINTS[finger].index(joint)
        place, q_parent = places[row, k], q[row, k - 1] if k else quat.IDENTITY
    away = np.array([0.0, 0.0, -sign]) if axis == FLEXION else np.array([sign, 0.0, 0.0])

    def at(values: Array, radius: float) -> Array:
        turned = np.tile(own, (len(values), 1))
        turned[:, axis] = values
        q_child = quat.multiply(q_parent, joint_angles.compose(turned))
        offset = quat.rotate(q_parent, BESIDE * away)
        return place + offset + radius * quat.rotate(q_child, np.array([0.0, sign, 0.0]))

    return at
