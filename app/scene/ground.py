"""The ground below the hand: a faint grid, and a soft contact shadow that stays under it."""

import numpy as np
from numpy.typing import NDArray
from viser import ViserServer

from handscope.app.scene import palette, view
from handscope.app.scene.mesh import bones
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

BELOW = 0.22  # scene units that the ground lies below the lowest point of a movement
HIGHEST, LOWEST = -0.5, -2.0  # scene units below the wrist
# scene units of the contact shadow over the ground: below its lines, which it would hide
OVER = -0.01
SHADOW = "/contact_shadow"
LENGTH, BREADTH = 2.5, 1.7  # scene units of the contact shadow
DARKEST = 170  # of 255, below the palm, in the dark theme
PIXELS = (96, 64)


class Ground:
    """For one thread at a time, within the scene's lock."""

    def __init__(self, server: ViserServer) -> None:
        self._height = view.GROUND
        self._grid = server.scene.add_grid(
            "/ground",
            width=12.0,
            height=12.0,
            cell_size=0.2,
            cell_color=palette.GROUND,
            section_size=1.0,
            section_color=palette.GROUND_SECTION,
            fade_distance=7.5,
            fade_from="origin",
            shadow_opacity=0.0,
            position=(0.0, 0.0, self._height),
        )
        self._shadow = server.scene.add_image(
            SHADOW,
            _soft_spot(),
            BREADTH,
            LENGTH,
            format="png",
            cast_shadow=False,
            receive_shadow=False,
        )

    def lie_below(self, points: Array, seen_from_below: bool) -> None:
        """Lie just below points (n, 3) of a movement; from below the ground the hand is drawn without it."""
        self._height = float(np.clip(points[:, 2].min() - BELOW, LOWEST, HIGHEST))
        self._grid.position = (0.0, 0.0, self._height)
        self._grid.visible = self._shadow.visible = not seen_from_below

    def follow(self, angles: Array, q_DH: Array, geometry: HandGeometry, place: Array) -> None:
        """Keep the contact shadow under a hand with these angles, turned as q_DH (4,), whose wrist is at `place` (3,)."""
        tips = quat.rotate(q_DH, bones.tips(angles, geometry)) * view.units_per_metre(geometry)
        x, y, _ = middle = 0.5 * tips[1:].mean(axis=0)
        self._shadow.position = (middle[0] + place[0], middle[1] + place[1], self._height + OVER)
        self._shadow.wxyz = _lying(np.arctan2(x, y))


def _soft_spot() -> NDArray[np.uint8]:
    """An image (rows, columns, 4) of a black spot that fades towards its rim."""
    y, x = np.meshgrid(*(np.linspace(-1, 1, n) for n in PIXELS), indexing="ij")
    share = np.clip(1.0 - np.hypot(x, y), 0.0, 1.0)
    spot = np.zeros((*PIXELS, 4), np.uint8)
    spot[..., 3] = np.rint(DARKEST * share**2 * (3 - 2 * share))
    return spot


def _lying(heading: float) -> Array:
    """Orientation (4,) of an image on the ground, seen from above, its height along this heading (from y towards x)."""
    return quat.multiply(quat.about(2, -heading), quat.about(0, np.pi))
