"""The whole hand: palm, cuff, five fingers and five nails as skinned meshes for a sized hand, left or right."""

from collections.abc import Mapping, Set
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from handscope.app.scene.mesh import bones, finger_mesh
from handscope.app.scene.mesh.cuff_mesh import cuff
from handscope.app.scene.mesh.nail_mesh import nail
from handscope.app.scene.mesh.palm_mesh import palm
from handscope.app.scene.mesh.palm_shape import Root, palm_shape
from handscope.app.scene.mesh.skinned_mesh import (
    SkinnedMesh,
    carried_by,
    cut_out,
    inflated,
    merged,
    mirrored,
)
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array

_GHOST_OVER = 0.8e-3  # m, the ghost lies this far over the hand, so that the two do not flicker where they agree
_FIRST_JOINT = 6e-3  # m, where a finger drawn from its first joint begins
_KEPT = 8  # hands
Lengths = tuple[tuple[str, float], ...]
Places = tuple[tuple[str, tuple[float, float, float]], ...]


@dataclass(frozen=True)
class HandMesh:
    """Closed surfaces in the hand's own frame from the wrist's centre, bound in the pose bones.BOUND."""

    palm: SkinnedMesh
    cuff: SkinnedMesh
    fingers: Mapping[str, SkinnedMesh]
    nails: Mapping[str, SkinnedMesh]
    # the fingers from their first joint, which lies in the palm
    whole_fingers: Mapping[str, SkinnedMesh]
    rest: Array  # (bones, 3) m, where the bones' joints are while bound

    def parts(self) -> dict[str, SkinnedMesh]:
        """All meshes by name."""
        return {
            **self.fingers,
            **{f"{finger}_nail": nail for finger, nail in self.nails.items()},
            "palm": self.palm,
            "cuff": self.cuff,
        }

    def drawn(self, measured: Set[str]) -> dict[str, SkinnedMesh]:
        """The meshes as they are drawn, one for what is painted alike: each is a call to the graphics processor, and another for its shadow.

        Names say which fingers are in `fingers` and `nails` unless all are; `pale` has those that are not measured.
        """
        solid = [finger for finger in FINGERS if finger in measured]
        rest = [finger for finger in FINGERS if finger not in measured]
        some = "".join(f"_{finger}" for finger in solid) if rest else ""
        groups = {
            f"fingers{some}": [self.fingers[finger] for finger in solid],
            f"nails{some}": [self.nails[finger] for finger in solid],
            f"pale{some}": [which[f] for which in (self.fingers, self.nails) for f in rest],
        }
        together = {name: merged(meshes) for name, meshes in groups.items() if meshes}
        return {**together, "palm": self.palm, "cuff": self.cuff}

    def ghost(self, whole: bool) -> dict[str, SkinnedMesh]:
        """What a second, translucent hand needs to lie over the first: its fingers from their first joint, or all of it."""
        without_forearm = cut_out(self.palm, 0.3 - carried_by(self.palm, "forearm"))
        parts = (
            {"hand": merged([*map(_without_base, self.fingers.values()), without_forearm])}
            if whole
            else {"fingers": merged([*self.whole_fingers.values()])}
        )
        return {name: inflated(mesh, _GHOST_OVER) for name, mesh in parts.items()}


def hand_mesh(geometry: HandGeometry) -> HandMesh:
    """The hand; the right one is the left one mirrored. Building takes most of a second: those of the last few geometries are kept, read-only."""
    joints = tuple((joint, tuple(place)) for joint, place in geometry.joint_positions.items())
    return _built(
        geometry.hand,
        tuple(geometry.lengths.items()),
        joints,
        tuple(geometry.tip_tissue.items()),
        geometry.palm_length,
    )


@lru_cache(maxsize=_KEPT)
def _built(
    hand: Hand, lengths: Lengths, joints: Places, tip_tissue: Lengths, palm_length: float
) -> HandMesh:
    geometry = HandGeometry(hand, dict(lengths), dict(joints), dict(tip_tissue), palm_length)
    if hand == "left":
        built = _left(geometry)
    else:
        places = tuple((joint, (-x, -y, -z)) for joint, (x, y, z) in joints)
        left = _built("left", lengths, places, tip_tissue, palm_length)
        built = _right(left, bones.rest(geometry))
    for mesh in (
        built.palm,
        built.cuff,
        *built.fingers.values(),
        *built.nails.values(),
        *built.whole_fingers.values(),
    ):
        for array in (mesh.vertices, mesh.faces, mesh.weights):
            array.flags.writeable = False
    return built


def _right(left: HandMesh, rest: Array) -> HandMesh:
    def each(meshes: Mapping[str, SkinnedMesh]) -> dict[str, SkinnedMesh]:
        return {finger: mirrored(mesh) for finger, mesh in meshes.items()}

    return HandMesh(
        mirrored(left.palm),
        mirrored(left.cuff),
        each(left.fingers),
        each(left.nails),
        each(left.whole_fingers),
        rest,
    )


def _left(geometry: HandGeometry) -> HandMesh:
    shape = palm_shape(geometry)
    return HandMesh(
        palm(shape),
        cuff(shape),
        {finger: _finger(finger, shape.roots[finger]) for finger in FINGERS},
        {finger: _nail(finger, shape.roots[finger]) for finger in FINGERS},
        {finger: _finger(finger, shape.roots[finger], _FIRST_JOINT) for finger in FINGERS},
        bones.rest(geometry),
    )


def _without_base(finger: SkinnedMesh) -> SkinnedMesh:
    """A finger without its base, which lies in the palm and would show through."""
    base = np.isin(finger.faces, [*range(finger_mesh.AROUND), len(finger.vertices) - 2]).any(axis=1)
    return replace(finger, faces=finger.faces[~base])


def _finger(finger: str, root: Root, start: float | None = None) -> SkinnedMesh:
    vertices, faces, weights = finger_mesh.tube(
        root.shape, finger_mesh.leaves_palm(finger, root.shape) if start is None else start
    )
    return SkinnedMesh(root.on_hand(vertices), faces, weights, finger_mesh.finger_bones(finger))


def _nail(finger: str, root: Root) -> SkinnedMesh:
    vertices, faces = nail(root.shape)
    return SkinnedMesh(
        root.on_hand(vertices), faces, np.ones((len(vertices), 1)), (CHAINS[finger][2],)
    )
