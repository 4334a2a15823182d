"""A thick line in the scene that moves with the hand: a round tube with a bone at each of its points.

viser's own line makes its geometry anew for each change, which costs a browser as much as the rest of a picture; a bone costs two short messages.
"""

import numpy as np
from viser import ViserServer
from viser import _messages as wire

from handscope.app.scene.mesh.closed_surfaces import closed_tube
from handscope.app.scene.mesh.skinned_mesh import Indices
from handscope.app.scene.palette import Colour
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

AROUND = 8  # corners of a section
SPACING = 0.1  # scene units from point to point while the tube is bound
ALONG = np.array([0.0, 0.0, 1.0])  # the tube while it is bound
_SAME = 1e-5  # scene units or quaternion components: a smaller change is not sent


class DrawnLine:
    """`points` points, `radius` scene units thick to either side; hidden until it is drawn. For one thread at a time, within the scene's lock."""

    def __init__(
        self, server: ViserServer, name: str, points: int, radius: float, colour: Colour
    ) -> None:
        self._queue, self._name = server.scene._queue_scene_message, name
        at = SPACING * np.arange(points)[:, None] * ALONG
        vertices, faces = _tube(at, radius)
        bone = np.clip(np.rint(vertices[:, 2] / SPACING), 0, points - 1)
        self._wxyz, self._at = np.tile(quat.IDENTITY, (points, 1)), at
        self.points = points
        self._mesh = server.scene.add_mesh_skinned(
            name,
            vertices,
            faces,
            bone_wxyzs=self._wxyz,
            bone_positions=at,
            skin_weights=(bone[:, None] == np.arange(points)).astype(float),
            color=colour,
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )

    @property
    def visible(self) -> bool:
        """Whether it is drawn."""
        return bool(self._mesh.visible)

    def hide(self) -> None:
        """Draw nothing."""
        self._mesh.visible = False

    def draw(self, points: Array) -> None:
        """Lead through points (points, 3), scene units, all in one plane."""
        wxyz = directions(points)
        turned = np.abs(wxyz - self._wxyz).max(axis=1) > _SAME
        moved = np.abs(points - self._at).max(axis=1) > _SAME
        for k in np.flatnonzero(turned):
            self._queue(wire.SetBoneOrientationMessage(self._name, int(k), tuple(wxyz[k].tolist())))
        for k in np.flatnonzero(moved):
            self._queue(wire.SetBonePositionMessage(self._name, int(k), tuple(points[k].tolist())))
        self._wxyz = np.where(turned[:, None], wxyz, self._wxyz)
        self._at = np.where(moved[:, None], points, self._at)
        self._mesh.visible = True


def directions(points: Array) -> Array:
    """Orientations (n, 4) of the sections of a tube through points (n, 3) of a plane: square to the line, none turned about it against the next."""
    along = np.gradient(points, axis=0)
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    along[~along.any(axis=1)] = ALONG
    across = np.cross(along[0], along[-1])
    if np.linalg.norm(across) < 1e-6:  # straight: any direction that is square to it
        across = np.cross(along[0], np.eye(3)[np.argmin(np.abs(along[0]))])
    across = across / np.linalg.norm(across)
    beside = np.cross(along, across)
    beside = beside / np.linalg.norm(beside, axis=1, keepdims=True)
    return quat.from_matrix(np.stack([np.cross(beside, along), beside, along], axis=-1))


def _tube(at: Array, radius: float) -> tuple[Array, Indices]:
    """Vertices and faces round points (n, 3) along ALONG, a little beyond both ends."""
    phi = -2 * np.pi * np.arange(AROUND) / AROUND
    section = radius * np.column_stack([np.sin(phi), np.cos(phi), np.zeros(AROUND)])
    return closed_tube(
        at[:, None] + section, at[0] - 0.6 * radius * ALONG, at[-1] + 0.6 * radius * ALONG
    )
