"""The scene's hand as an export takes it: the same surfaces, bones and colours."""

import numpy as np

from handscope.app.scene import palette
from handscope.app.scene.mesh import bones
from handscope.app.scene.mesh.hand_mesh import hand_mesh
from handscope.app.scene.mesh.skinned_mesh import SkinnedMesh, only_bones, vertex_normals
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array
from handscope.sessions.exports.measured import Skin, SkinPart

MOST = 4  # bones that carry a vertex


def skin(geometry: HandGeometry, angles: Array) -> Skin:
    """The hand drawn, and its bones at angles (n, joints, 3) rad, all known."""
    mesh = hand_mesh(geometry)
    turns, places = bones.pose(angles, geometry)
    parts = tuple(_part(name, part) for name, part in mesh.parts().items())
    return Skin(parts, bones.BONES, mesh.rest, turns, places)


def _part(name: str, mesh: SkinnedMesh) -> SkinPart:
    limited = only_bones(mesh, MOST)
    numbers = np.array([bones.BONE[bone] for bone in limited.bones])
    strongest = np.argsort(-limited.weights, axis=1)[:, :MOST]
    weights = np.take_along_axis(limited.weights, strongest, axis=1)
    carrying = np.where(weights > 0, numbers[strongest], 0)
    if weights.shape[1] < MOST:
        room = ((0, 0), (0, MOST - weights.shape[1]))
        weights, carrying = np.pad(weights, room), np.pad(carrying, room)
    finger = name.removesuffix("_nail")
    return SkinPart(
        name,
        finger if finger in FINGERS else "",
        limited.vertices,
        vertex_normals(limited.vertices, limited.faces),
        limited.faces,
        carrying,
        weights,
        _colour(name),
    )


def _colour(name: str) -> tuple[float, float, float]:
    """Linear, of the scene's sRGB."""
    paint = (
        palette.NAIL if name.endswith("_nail") else palette.CUFF if name == "cuff" else palette.SKIN
    )
    share = np.array(paint.colour) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    r, g, b = (float(x) for x in linear)
    return r, g, b
