"""Arrows at the fingertips: what each of them pushes with, and which way. How much stands at the arrow's foot: the hand may hide the arrow.

In      forces (5, 3) N that the fingertips exert, joint angles (joints, 3) rad, all known; the hand's frame
Out     scene units: a newton is LENGTH metres of the hand
"""

import numpy as np
from viser import ViserServer

from handscope.app.scene import palette
from handscope.app.scene.mesh import bones
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

LENGTH = 0.008  # m a newton: a pinch of 5 N is as long as two phalanges
BEHIND = 0.022  # m from the tip, away from what is pushed, to where the number stands
LEAST = 0.3  # N, below which nothing is drawn: what is left of a free sensor's zero


class ForceArrows:
    """Below the hand's frame `name`, whose parts are `scale` scene units a metre. For one thread at a time, within the scene's lock."""

    def __init__(
        self, server: ViserServer, name: str, geometry: HandGeometry, scale: float
    ) -> None:
        self._geometry, self._scale = geometry, scale
        self._arrows = {
            finger: server.scene.add_arrows(
                f"{name}/force_{finger}",
                np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]], np.float32),
                palette.FORCE,
                shaft_radius=0.004 * scale,
                head_radius=0.009 * scale,
                head_length=0.016 * scale,
                visible=False,
            )
            for finger in FINGERS
        }
        self._newtons = {
            finger: server.scene.add_label(
                f"{name}/newtons_{finger}",
                "",
                visible=False,
                font_screen_scale=1.4,
                anchor="center-center",
            )
            for finger in FINGERS
        }

    def show(self, forces: Array | None, angles: Array) -> None:
        """Forces in the hand's frame; a force that is not known (NaN) or hardly any has no arrow."""
        if forces is None:
            for shown in (*self._arrows.values(), *self._newtons.values()):
                shown.visible = False
            return
        for arrow, newtons, tip, force in zip(
            self._arrows.values(),
            self._newtons.values(),
            bones.tips(angles, self._geometry),
            forces,
            strict=True,
        ):
            size = float(np.linalg.norm(force))
            arrow.visible = newtons.visible = size >= LEAST
            if arrow.visible:
                arrow.points = (self._scale * np.array([[tip, tip + LENGTH * force]])).astype(
                    np.float32
                )
                newtons.position = self._scale * (tip - BEHIND * force / size)
                newtons.text = f"{size:.1f} N"


def in_hand(forces: Array, q_GH: Array) -> Array:
    """Forces (5, 3) of the global frame in the hand's, which is turned as q_GH (4,)."""
    return quat.rotate(quat.conjugate(q_GH), forces)
