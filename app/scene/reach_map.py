"""A small map beside the hand: the trunk seen from behind, rings of distance before it, the magnet's place and how sure it is.

In      places in the trunk's axes (forward, up, right), m
Out     scene units: a metre is SCALE; the map's own axes are the scene's (x to the right, y away from the viewer, z up)
"""

import numpy as np
from viser import ViserServer

from handscope.app.scene import palette
from handscope.estimators.numerics.typing import Array

SCALE = 1.1
# the trunk's sensor: beside the cuff, where neither metronome nor countdown lies over it
AT = np.array([-1.02, -0.15, 0.0])
RINGS = (0.2, 0.4, 0.6)  # m
TRUNK = (0.16, 0.09, 0.26)  # m, half axes of the chest: across, deep, high; ours
MAGNET = 0.022  # m, drawn larger than it is
LEAST_SD = 0.003  # m


class ReachMap:
    """For one thread at a time, within the scene's lock."""

    def __init__(self, server: ViserServer) -> None:
        scene = server.scene
        chest = tuple(SCALE * x for x in TRUNK)
        behind = AT + SCALE * np.array([0.0, -TRUNK[1], -0.08])
        self._fixed = [
            scene.add_icosphere(
                "/reach/trunk",
                1.0,
                palette.CUFF.colour,
                scale=chest,
                opacity=0.55,
                position=behind,
                cast_shadow=False,
            ),
            *(_ring(server, r) for r in RINGS),
            *(_number(server, r) for r in RINGS),
        ]
        self._magnet = scene.add_icosphere(
            "/reach/magnet", SCALE * MAGNET, palette.TRAIL, position=AT
        )
        self._sure = scene.add_icosphere(
            "/reach/sure", 1.0, palette.TRAIL, opacity=0.28, position=AT, cast_shadow=False
        )
        self._stem = scene.add_line_segments(
            "/reach/stem",
            np.zeros((1, 2, 3), np.float32),
            palette.TRAIL,
            thickness=2.0,
            thickness_units="screen",
        )
        self.hide()

    def hide(self) -> None:
        for node in (*self._fixed, self._magnet, self._sure, self._stem):
            node.visible = False

    def show(self, place: Array, sd: Array, doubtful: bool) -> None:
        """The hand's sensor at `place` (3,) m with its standard deviation (3,) m; a doubtful place is drawn pale, one that is not known not at all."""
        known = bool(np.isfinite(place).all())
        for node in self._fixed:
            node.visible = True
        for part in (self._magnet, self._sure, self._stem):
            part.visible = known
        if not known:
            return
        at = AT + SCALE * _seen(place)
        colour = palette.UNMEASURED.colour if doubtful else palette.TRAIL
        self._magnet.position, self._magnet.color = at, colour
        self._sure.position, self._sure.color = at, colour
        self._sure.scale = tuple(float(x) for x in SCALE * np.maximum(np.abs(_seen(sd)), LEAST_SD))
        floor = at * [1.0, 1.0, 0.0] + [0.0, 0.0, AT[2]]
        self._stem.points = np.array([[at, floor]], np.float32)


def _seen(v: Array) -> Array:
    """Forward, up, right of the trunk as x, y, z of the scene."""
    return np.array([v[2], v[0], v[1]])


def _ring(server: ViserServer, radius: float) -> object:
    """A half circle of `radius` m before the trunk."""
    angle = np.linspace(0.0, np.pi, 33)
    points = (
        AT + SCALE * radius * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    ).astype(np.float32)
    return server.scene.add_line_segments(
        f"/reach/ring_{round(100 * radius)}",
        np.stack([points[:-1], points[1:]], axis=1),
        palette.GROUND_SECTION,
        thickness=2.0,
        thickness_units="screen",
    )


def _number(server: ViserServer, radius: float) -> object:
    at = AT + SCALE * radius * np.array([0.0, 1.0, 0.0])
    return server.scene.add_label(
        f"/reach/cm_{round(100 * radius)}",
        f"{round(100 * radius)} cm",
        position=at,
        font_screen_scale=0.8,
        anchor="bottom-center",
    )
