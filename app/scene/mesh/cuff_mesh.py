"""The cuff that closes the forearm's stump: a dark band, so that nobody takes the end of the drawing for a part of the patient."""

import numpy as np

from handscope.app.scene.mesh.closed_surfaces import closed_tube
from handscope.app.scene.mesh.palm_shape import FOREARM, PalmShape
from handscope.app.scene.mesh.skinned_mesh import SkinnedMesh

_AROUND = 48
_WIDTH, _THICK = 0.24, 0.022  # of hand breadth
_PROFILE = (  # share of the width from the hand's side, share of the thickness over the skin
    (0.00, -1.2),
    (0.00, 0.4),
    (0.03, 0.85),
    (0.10, 1.0),
    (0.50, 1.08),
    (0.90, 1.0),
    (0.97, 0.85),
    (1.00, 0.4),
    (1.00, -1.2),
    (0.97, -2.4),
)


def cuff(shape: PalmShape) -> SkinnedMesh:
    """A closed band round the end of the left forearm, in the hand's frame."""
    start = -FOREARM * shape.length + 0.8 * _WIDTH * shape.breadth
    along, over = (np.array(column) for column in zip(*_PROFILE))
    y = start - along * _WIDTH * shape.breadth
    # towards the elbow: the other way round than a finger
    phi = -2 * np.pi * np.arange(_AROUND) / _AROUND
    depth, breadth = (
        half[:, None] + (over * _THICK * shape.breadth)[:, None]
        for half in shape.forearm_half_axes(y)
    )
    rings = np.stack(
        np.broadcast_arrays(depth * np.sin(phi), y[:, None], breadth * np.cos(phi)), axis=-1
    )
    vertices, faces = closed_tube(rings, np.array([0.0, y[0], 0.0]), np.array([0.0, y[-1], 0.0]))
    return SkinnedMesh(vertices, faces, np.ones((len(vertices), 1)), ("forearm",))
