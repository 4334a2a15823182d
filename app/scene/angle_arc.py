"""What a task measures, drawn on the hand: an arc at the joint with its number and the band to reach, or the line between thumb and index tip.

In      a quantity of protocols.CURVES, the angles shown (joints, 3) rad, a band in rad; places in the hand's frame
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from viser import LineSegmentsHandle, ViserServer

from handscope.app.scene import palette
from handscope.app.scene.mesh import bones
from handscope.app.scene.palette import Colour
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

PIECES = 24
RADIUS, BAND = 0.030, 0.035  # m: of the arc, and of the band outside it
BESIDE = 0.012  # m from the bone's axis to the finger's side, where skin hides nothing
NUMBER = 1.45  # of the radius, where the number stands
APERTURE = "aperture"


@dataclass(frozen=True)
class Measured:
    """A quantity of a task and the band of it that is asked for, rad."""

    what: str
    band: tuple[float, float] | None = None


class AngleArc:
    """Below the hand's frame `name`, whose parts are `scale` scene units a metre. For one thread at a time, within the scene's lock."""

    def __init__(
        self, server: ViserServer, name: str, geometry: HandGeometry, scale: float
    ) -> None:
        self._server, self._name, self._geometry, self._scale = server, name, geometry, scale
        self._arc = self._line("arc", palette.MEASURED, 5.0)
        self._rays = self._line("rays", palette.MEASURED, 2.0)
        self._band = self._line("band", palette.TARGET, 9.0)
        self._number = server.scene.add_label(
            f"{name}/number", "", visible=False, font_screen_scale=1.6, anchor="center-center"
        )

    def show(self, measured: Measured | None, angles: Array, with_number: bool) -> None:
        """Draw the quantity of a hand with these angles, all known; None takes it away."""
        drawn = None if measured is None else _lines(measured, angles, self._geometry)
        self._number.visible = drawn is not None and with_number
        self._place(self._arc, None if drawn is None else drawn.arc)
        self._place(self._rays, None if drawn is None else drawn.rays)
        self._place(self._band, None if drawn is None else drawn.band)
        if drawn is not None:
            self._number.position = self._scale * drawn.number_at
            if self._number.text != drawn.text:
                self._number.text = drawn.text

    def _place(self, line: LineSegmentsHandle, points: Array | None) -> None:
        line.visible = points is not None
        if points is not None:
            line.points = (self._scale * points).astype(np.float32)

    def _line(self, part: str, colour: Colour, thickness: float) -> LineSegmentsHandle:
        return self._server.scene.add_line_segments(
            f"{self._name}/measured_{part}",
            np.zeros((PIECES, 2, 3), np.float32),
            colour,
            thickness=thickness,
            thickness_units="screen",
            visible=False,
        )


@dataclass(frozen=True)
class _Lines:
    """Pieces of line (n, 2, 3), m in the hand's frame."""

    arc: Array
    rays: Array | None
    band: Array | None
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
        band = _pieces(at(np.linspace(*measured.band, PIECES + 1), BAND))
    return _Lines(
        _pieces(at(np.linspace(0.0, value, PIECES + 1), RADIUS)),
        np.array([[centre, straight], [centre, bent]]),
        band,
        at(np.array([0.5 * value]), NUMBER * RADIUS)[0],
        f"{round(float(np.degrees(value)))}°",
    )


def _aperture(angles: Array, geometry: HandGeometry) -> _Lines:
    thumb, index = bones.tips(angles, geometry)[:2]
    line = np.linspace(thumb, index, PIECES + 1)
    dorsal = side_sign(geometry.hand) * np.array([1.0, 0.0, 0.0])
    size = float(np.linalg.norm(thumb - index))
    return _Lines(
        _pieces(line), None, None, 0.5 * (thumb + index) + 0.016 * dorsal, f"{1e3 * size:.0f} mm"
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


def _pieces(points: Array) -> Array:
    """Points (n + 1, 3) as pieces of line (n, 2, 3)."""
    return np.stack([points[:-1], points[1:]], axis=1)
