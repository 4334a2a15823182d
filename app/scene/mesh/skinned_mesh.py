"""A surface that follows bones: vertices, triangles and, for every vertex, how much each bone carries it.

Source  linear blend skinning: Magnenat-Thalmann, Laperriere & Thalmann 1988, Graphics Interface:26
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.hand.anatomy import JOINTS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class SkinnedMesh:
    """A closed triangle mesh in the hand's frame; `weights` (vertices, bones) are not negative and sum to 1 along the bones."""

    vertices: Array  # (V, 3) m
    faces: Indices  # (F, 3) counter-clockwise seen from outside
    weights: Array  # (V, B)
    bones: tuple[str, ...]  # names of bones.BONES


def mirrored(mesh: SkinnedMesh) -> SkinnedMesh:
    """The same surface on the other hand: frames differ by the sign of all axes (hand/anatomy.py), so the triangles turn round."""
    return replace(mesh, vertices=-mesh.vertices, faces=mesh.faces[:, ::-1].copy())


def inflated(mesh: SkinnedMesh, by: float) -> SkinnedMesh:
    """The same mesh with its surface `by` m further out."""
    return replace(mesh, vertices=mesh.vertices + by * vertex_normals(mesh.vertices, mesh.faces))


def posed(mesh: SkinnedMesh, rest: Array, rotations: Array, places: Array) -> Array:
    """Vertices (V, 3) when the mesh's bones, at `rest` (B, 3) while bound, are turned by `rotations` (B, 4) and moved to `places` (B, 3)."""
    carried = quat.rotate(rotations, mesh.vertices[:, None] - rest) + places  # (V, B, 3)
    moved: Array = np.sum(mesh.weights[..., None] * carried, axis=1)
    return moved


def merged(meshes: Sequence[SkinnedMesh]) -> SkinnedMesh:
    """One mesh of several, drawn in their order."""
    bones = tuple(dict.fromkeys(bone for mesh in meshes for bone in mesh.bones))
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    weights = np.zeros((starts[-1], len(bones)))
    for mesh, start in zip(meshes, starts):
        weights[start : start + len(mesh.vertices), [bones.index(bone) for bone in mesh.bones]] = (
            mesh.weights
        )
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts)])
    return SkinnedMesh(np.concatenate([mesh.vertices for mesh in meshes]), faces, weights, bones)


def only_bones(mesh: SkinnedMesh, most: int = 4) -> SkinnedMesh:
    """The same mesh with at most `most` bones a vertex, the strongest, weights summing to 1 again: what the browser can draw."""
    weights = mesh.weights.copy()
    if weights.shape[1] > most:
        weakest = np.argsort(weights, axis=1)[:, :-most]
        np.put_along_axis(weights, weakest, 0.0, axis=1)
    return replace(mesh, weights=weights / weights.sum(axis=1, keepdims=True))


def vertex_normals(vertices: Array, faces: Indices) -> Array:
    """Outward unit normals (V, 3): the mean of the faces round each vertex, larger faces counting more."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    total = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(total, faces[:, k], across)
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-20))


def carried_by(mesh: SkinnedMesh, segment: str) -> Array:
    """How much of each vertex (V,) moves with the segment: its own bone and half of the half-way bones at its two ends."""
    halves = {f"{joint.name}_half" for joint in JOINTS if segment in (joint.parent, joint.child)}
    factors = np.array(
        [1.0 if bone == segment else 0.5 if bone in halves else 0.0 for bone in mesh.bones]
    )
    shares: Array = mesh.weights @ factors
    return shares


def cut_out(mesh: SkinnedMesh, value: Array) -> SkinnedMesh:
    """The part of a mesh on which `value` (V,) is positive; triangles on the border are cut along it."""
    inside = value > 0
    count = inside[mesh.faces].sum(axis=1)
    lone = mesh.faces[(count == 1) | (count == 2)]
    odd = np.where((inside[lone].sum(axis=1) == 1)[:, None], inside[lone], ~inside[lone]).argmax(
        axis=1
    )  # the corner alone on its side
    a, b, c = (np.take_along_axis(lone, ((odd + k) % 3)[:, None], axis=1)[:, 0] for k in range(3))
    ends = np.concatenate([np.stack([a, b], 1), np.stack([a, c], 1)])
    share = value[ends[:, 0]] / (value[ends[:, 0]] - value[ends[:, 1]])
    on_border = [_interpolate(values, ends, share) for values in (mesh.vertices, mesh.weights)]
    ab = len(mesh.vertices) + np.arange(len(lone))
    ac, tip = ab + len(lone), inside[a]
    faces = np.concatenate(
        [
            mesh.faces[count == 3],
            np.stack([a, ab, ac], 1)[tip],
            np.stack([ab, b, c], 1)[~tip],
            np.stack([ab, c, ac], 1)[~tip],
        ]
    )
    used, inverse = np.unique(faces, return_inverse=True)
    vertices, weights = (
        np.concatenate([whole, new])[used]
        for whole, new in zip((mesh.vertices, mesh.weights), on_border)
    )
    return SkinnedMesh(vertices, inverse.reshape(-1, 3), weights, mesh.bones)


def _interpolate(values: Array, ends: Indices, share: Array) -> Array:
    mixed: Array = values[ends[:, 0]] + share[:, None] * (values[ends[:, 1]] - values[ends[:, 0]])
    return mixed
