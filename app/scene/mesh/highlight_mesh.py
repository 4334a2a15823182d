"""The skin of one segment alone, a little raised: laid over the hand in another colour it shows which segment is meant."""

from handscope.app.scene.mesh.hand_mesh import HandMesh
from handscope.app.scene.mesh.skinned_mesh import SkinnedMesh, carried_by, cut_out, inflated
from handscope.estimators.hand.anatomy import CHAINS, FINGERS

_RAISED = 0.6e-3  # m
_MINE = 0.5  # share of the skin's weights from which it counts as the segment's


def highlight_parts(hand: HandMesh, segment: str) -> dict[str, SkinnedMesh]:
    """Open surfaces over the segment's skin, by the mesh they lie on: the finger's, the palm's, or both."""
    finger = next((f for f in FINGERS if segment in CHAINS[f]), None)
    sources = {"palm": hand.palm} | ({finger: hand.fingers[finger]} if finger else {})
    patches = {
        name: cut_out(inflated(mesh, _RAISED), carried_by(mesh, segment) - _MINE)
        for name, mesh in sources.items()
    }
    return {name: patch for name, patch in patches.items() if len(patch.faces)}
