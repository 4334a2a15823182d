"""The skin of one finger from where it leaves the palm, or from its first joint, to its tip.

In      a finger's shape
Out     a closed mesh in the straight finger's coordinates (dorsal, distal, ulnar) with the weights of its five bones
"""

import numpy as np

from handscope.app.scene.mesh.closed_surfaces import closed_tube
from handscope.app.scene.mesh.finger_shape import FingerShape
from handscope.app.scene.mesh.joint_blend import hinge, through
from handscope.app.scene.mesh.skinned_mesh import Indices
from handscope.estimators.hand.anatomy import CHAINS, FINGER_JOINTS
from handscope.estimators.numerics.typing import Array

AROUND = 24  # vertices in a ring
# of the first segment
LEAVES_PALM = {"thumb": 0.80, "index": 0.56, "middle": 0.56, "ring": 0.59, "little": 0.62}
_BEND = 1.6  # of the half breadth: over which length the skin of a joint bends
# m: it begins below the palm's skin and comes out of it on a clean line
_BORDER, _OVER = (-2.5e-3, 0.0, 3e-3), (-0.8e-3, 0.0, 0.25e-3)


def leaves_palm(finger: str, shape: FingerShape) -> float:
    """Distal coordinate at which the finger's own mesh comes out of the palm's, m."""
    return LEAVES_PALM[finger] * shape.joints[1]


def finger_bones(finger: str) -> tuple[str, ...]:
    """The five bones of a finger's mesh, in order along it."""
    first, second, third = CHAINS[finger]
    _, middle, last = FINGER_JOINTS[finger]
    return first, f"{middle}_half", second, f"{last}_half", third


def tube(shape: FingerShape, start: float) -> tuple[Array, Indices, Array]:
    """Vertices (V, 3), faces (F, 3) and weights (V, 5) of the finger's skin from distal coordinate `start`, m."""
    t = _rings(start + _BORDER[0], shape)
    phi = 2 * np.pi * (np.arange(AROUND) + 0.5) / AROUND
    rings = shape.surface(t[:, None], phi[None, :])
    over = np.interp(t - start, _BORDER, _OVER)
    rings[..., ::2] *= (1.0 + over / shape.half_breadth)[:, None, None]
    vertices, faces = closed_tube(
        rings, np.array([0.0, t[0], 0.0]), np.array([0.0, shape.length, 0.0])
    )
    return vertices, faces, bend_weights(vertices[:, 1], shape)


def bend_weights(t: Array, shape: FingerShape) -> Array:
    """Weights (n, 5) of first segment, half-way bone, second, half-way bone and third at distal coordinates t (n,)."""
    near, far = (hinge(through(t, joint, _BEND * shape.half_breadth)) for joint in shape.joints[1:])
    return np.stack(
        [near[0], near[1], near[2] * far[0], near[2] * far[1], near[2] * far[2]], axis=-1
    )


def _rings(start: float, shape: FingerShape) -> Array:
    """Distal coordinates of the rings: close at the joints and at the tip."""
    r = shape.half_breadth
    joints = [np.linspace(joint - 0.95 * r, joint + 0.95 * r, 9) for joint in shape.joints[1:]]
    border = start - _BORDER[0] + np.array([*_BORDER, 1.5e-3])
    body = np.linspace(start - 2 * _BORDER[0], shape.length - 0.9 * r, 13)[1:]
    tip = shape.length - 0.9 * r * (1 - np.sin(np.linspace(0, np.pi / 2, 9)[1:-1]))
    t = np.concatenate([border, *joints, body, tip])
    t = np.sort(t[(t >= start - 1e-9) & (t < shape.length - 1e-5)])
    return np.asarray(t[np.concatenate([[True], np.diff(t) > 0.09 * r])])
