"""A second hand to the right of the first: the other hand or an earlier session; each faces ahead at its first orientation."""

from collections.abc import Iterable

import numpy as np
from viser import ViserServer

from handscope.app.scene import postures, view
from handscope.app.scene.drawn_hand import DrawnHand
from handscope.app.scene.mesh import bones
from handscope.app.scene.mesh.hand_mesh import hand_mesh
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

BESIDE = 1.0  # scene units from the middle to either wrist


class SecondHand:
    """For one thread at a time, within the scene's lock."""

    def __init__(self, server: ViserServer, geometry: HandGeometry) -> None:
        self._geometry = geometry
        self._q_DG: Array | None = None  # set by the first orientation shown
        self._mesh = hand_mesh(geometry)
        self._drawn = DrawnHand(server, "/beside", self._mesh.rest, view.units_per_metre(geometry))
        self._drawn.place((BESIDE, 0.0, 0.0))
        self._drawn.turn(view.palm_down(geometry.hand))
        self.measured(FINGERS)

    def measured(self, fingers: Iterable[str]) -> None:
        """Draw these fingers solid and the others pale."""
        self._drawn.paint_hand(self._mesh, frozenset(fingers))

    def show(self, angles: Array, q_GH: Array) -> None:
        """As HandScene.show."""
        self._drawn.bend(*bones.pose(postures.filled(angles), self._geometry))
        if np.isnan(q_GH).any():
            return
        if self._q_DG is None:
            self._q_DG = view.heading_removed(q_GH, self._geometry.hand)
        self._drawn.turn(quat.multiply(self._q_DG, q_GH))
