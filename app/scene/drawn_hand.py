"""One hand in a viser scene: its meshes, their paint, and the messages that move their bones.

Nothing is ever removed, only hidden: viser 1.1.1's page falls over when a skinned mesh is taken away.
"""

from collections.abc import Set

import numpy as np
from viser import MeshSkinnedHandle, ViserServer
from viser import _messages as wire

from handscope.app.scene import palette
from handscope.app.scene.mesh.bones import BONE
from handscope.app.scene.mesh.hand_mesh import HandMesh
from handscope.app.scene.mesh.skinned_mesh import SkinnedMesh
from handscope.app.scene.palette import Paint
from handscope.estimators.numerics.quaternions import IDENTITY
from handscope.estimators.numerics.typing import Array, Bools

# A bone that turned or moved less than this since it was sent is not sent again: a fiftieth of a millimetre at the tip of a finger, where a pixel is
# some tenths; sensors that lie still tell as much
_TURNED, _MOVED = 1e-4, 2e-5  # quaternion components, m

_FOLLOWED = {
    "palm": palette.SKIN,
    "fingers": palette.SKIN,
    "nails": palette.NAIL,
    "pale": palette.UNMEASURED,
    "cuff": palette.CUFF,
}
_UNFOLLOWED = {
    "palm": palette.UNFOLLOWED,
    "fingers": palette.UNFOLLOWED,
    "nails": palette.UNFOLLOWED_NAIL,
}


class DrawnHand:
    """Skinned meshes below one turning frame, `rest` (bones, 3) m: where the bones' joints are while bound; `scale`: scene units per metre.

    For one thread at a time.
    """

    def __init__(
        self,
        server: ViserServer,
        name: str,
        rest: Array,
        scale: float,
    ) -> None:
        self._server, self._name, self._rest, self._scale = server, name, rest, scale
        self._frame = server.scene.add_frame(name, show_axes=False)
        self._bones: dict[str, tuple[int, ...]] = {}
        self._handles: dict[str, MeshSkinnedHandle] = {}
        self._hidden: set[str] = set()
        self._rotations, self._places = np.tile(IDENTITY, (len(rest), 1)), rest
        self._skin: dict[frozenset[str], tuple[str, ...]] = {}  # by which fingers are measured

    def add(self, part: str, mesh: SkinnedMesh) -> None:
        """Draw one more part in the present pose."""
        self._bones[part] = tuple(BONE[name] for name in mesh.bones)
        self._handles[part] = self._server.scene.add_mesh_skinned(
            f"{self._name}/{part}",
            mesh.vertices * self._scale,
            mesh.faces,
            bone_wxyzs=np.tile(IDENTITY, (len(mesh.bones), 1)),
            bone_positions=self._rest[list(self._bones[part])] * self._scale,
            skin_weights=mesh.weights,
        )
        self._send_all(part)

    def parts(self) -> tuple[str, ...]:
        """Names of all parts, hidden ones too."""
        return tuple(self._handles)

    def bones_by_mesh(self) -> dict[str, list[int]]:
        """Which bones each mesh follows, in its own order, by the mesh's name in the scene."""
        return {f"{self._name}/{part}": list(own) for part, own in self._bones.items()}

    def show(self, part: str, shown: bool) -> None:
        """Show or hide a part."""
        if shown == (part in self._hidden):
            self._hidden ^= {part}
            self._handles[part].visible = shown
            self._send_all(part)

    def paint(self, part: str, paint: Paint) -> None:
        """Give a part its colour and opacity."""
        handle = self._handles[part]
        handle.color, handle.opacity = paint.colour, paint.opacity
        handle.cast_shadow = handle.receive_shadow = paint.opacity is None and paint.shaded

    def paint_hand(self, mesh: HandMesh, measured: Set[str], followed: bool = True) -> None:
        """Draw a hand: the measured fingers solid, the others pale; all grey while the hand is not followed."""
        measured = frozenset(measured)
        if measured not in self._skin:
            drawn = mesh.drawn(measured)
            self._skin[measured] = tuple(drawn)
            for part in [part for part in drawn if part not in self._handles]:
                self.add(part, drawn[part])
        for part in {part for parts in self._skin.values() for part in parts}:
            self.show(part, part in self._skin[measured])
        paints = _FOLLOWED if followed else {**_FOLLOWED, **_UNFOLLOWED}
        for part in self._skin[measured]:
            self.paint(part, paints[part.partition("_")[0]])

    def place(self, wrist: tuple[float, float, float]) -> None:
        """Put the wrist there, scene units."""
        self._frame.position = wrist

    def turn(self, q: Array) -> None:
        """Turn the whole hand about its wrist: q (4,) from the hand's frame to the scene's."""
        self._frame.wxyz = q

    def bend(self, rotations: Array, places: Array) -> None:
        """Move the bones: rotations (bones, 4) and places (bones, 3), see bones.pose."""
        turned = np.abs(rotations - self._rotations).max(axis=1) > _TURNED
        moved = np.abs(places - self._places).max(axis=1) > _MOVED
        self._rotations = np.where(turned[:, None], rotations, self._rotations)
        self._places = np.where(moved[:, None], places, self._places)
        self._send([part for part in self._bones if part not in self._hidden], turned, moved)

    def _send_all(self, part: str) -> None:
        every = np.ones(len(self._rest), bool)
        self._send([part], every, every)

    def _send(self, parts: list[str], turned: Bools, moved: Bools) -> None:
        """Queue where the bones are, straight as messages: through the bones' handles it costs five times as much (1.03 instead of 0.19 ms for
        65 bones), because each assignment there compares with np.allclose."""
        queue = self._server.scene._queue_scene_message
        wxyz, position = self._rotations.tolist(), (self._scale * self._places).tolist()
        for part in parts:
            name = f"{self._name}/{part}"
            for k, bone in enumerate(self._bones[part]):
                if turned[bone]:
                    queue(wire.SetBoneOrientationMessage(name, k, tuple(wxyz[bone])))
                if moved[bone]:
                    queue(wire.SetBonePositionMessage(name, k, tuple(position[bone])))
