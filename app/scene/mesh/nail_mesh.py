"""A fingernail: a thin curved plate on the back of the tip, round at its root, its free edge a little off the skin."""

import numpy as np

from handscope.app.scene.mesh.closed_surfaces import closed_plate
from handscope.app.scene.mesh.finger_shape import FingerShape
from handscope.app.scene.mesh.skinned_mesh import Indices
from handscope.estimators.numerics.typing import Array

_ROOT, _EDGE = 0.46, 0.985  # of the last segment, tissue included
_HALF_ANGLE = np.radians(58.0)  # how far round the finger it reaches
# m: over the skin, free edge above that, below the skin
_LIFT, _FREE, _DEPTH = 0.45e-3, 0.25e-3, 0.9e-3
_DORSAL = np.array([1.0, 0.0, 0.0])


def nail(shape: FingerShape) -> tuple[Array, Indices]:
    """Vertices (V, 3) and faces (F, 3) in the straight finger's coordinates."""
    # across, and from root to edge
    x, y = np.meshgrid(np.linspace(-1, 1, 15), np.linspace(0, 1, 15))
    skin = shape.surface(_along(x, y, shape), np.pi / 2 + _half_angle(y) * x)
    top = (
        skin + (_LIFT * _arch(x, y) + _FREE * np.maximum((y - 0.7) / 0.3, 0.0))[..., None] * _DORSAL
    )
    return closed_plate(top, skin - _DEPTH * _DORSAL)


def _along(x: Array, y: Array, shape: FingerShape) -> Array:
    """Distal coordinate, m: root and edge are bowed."""
    bowed = y + 0.048 * (1 - x**2) * (2 * y - 1)
    last = shape.length - shape.joints[2]
    return np.minimum(
        shape.joints[2] + last * (_ROOT + (_EDGE - _ROOT) * bowed),
        shape.length - 0.02 * shape.half_breadth,
    )


def _half_angle(y: Array) -> Array:
    """Half of the nail's width as an angle round the finger: narrow at the root, rounded at the edge."""
    root = 1 - 0.55 * (1 - np.minimum(y / 0.35, 1)) ** 2.2
    edge = 1 - 0.28 * np.maximum((y - 0.72) / 0.28, 0) ** 2
    return np.asarray(_HALF_ANGLE * np.sqrt(root * edge))


def _arch(x: Array, y: Array) -> Array:
    """Height over the skin in units of the lift, falling to it at the rim."""
    rim = np.minimum(1 - np.abs(x) ** 6, np.minimum(y / 0.12, (1 - y) / 0.05 + 0.4))
    return np.asarray(0.75 + 0.5 * np.clip(rim, 0, 1))
