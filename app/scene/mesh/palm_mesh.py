"""The palm's skin: one closed surface from the forearm's stump to the first part of the fingers, and which bones carry it."""

from collections.abc import Mapping

import numpy as np

from handscope.app.scene.mesh import isosurface
from handscope.app.scene.mesh.joint_blend import hinge, through
from handscope.app.scene.mesh.palm_shape import FOREARM, PalmShape
from handscope.app.scene.mesh.skinned_mesh import SkinnedMesh, only_bones
from handscope.estimators.hand.anatomy import CHAINS, FINGER_JOINTS, FINGERS
from handscope.estimators.numerics.typing import Array

CELL = 0.030  # of hand breadth: 2.6 mm on an 85 mm hand
_SMOOTHING = 6  # rounds of averaging neighbours' weights, about a cell each
# of hand breadth: over which length the skin of a joint bends
_MCP_BEND, _CMC_BEND, _WRIST_BEND = 0.24, 0.26, 0.40
_WEB = 0.022  # of hand breadth: how sharply the web between two fingers is divided between them


def palm(shape: PalmShape) -> SkinnedMesh:
    """The palm of the left hand in the bound pose."""
    low, high = _box(shape)
    vertices, faces = isosurface.surface(shape.field, low, high, CELL * shape.breadth)
    by_bone = _weights(shape, vertices)
    weights = np.stack(list(by_bone.values()), axis=-1)
    rings = isosurface.neighbours(len(vertices), faces)
    for _ in range(_SMOOTHING):
        weights = 0.5 * weights + 0.5 * (rings @ weights)
    for finger in FINGERS:
        own = _below_finger(shape, finger, vertices)[:, None]
        weights = weights * (1.0 - own) + own * (np.array(list(by_bone)) == CHAINS[finger][0])
    return only_bones(SkinnedMesh(vertices, faces, weights, tuple(by_bone)))


def _box(shape: PalmShape) -> tuple[Array, Array]:
    ends = [shape.roots[f].on_hand(np.array([0.0, shape.ends[f], 0.0])) for f in FINGERS]
    marks = np.array(
        [*ends, *(root.place for root in shape.roots.values()), [0.0, -FOREARM * shape.length, 0.0]]
    )
    margin = np.array([0.36, 0.12, 0.30]) * shape.breadth
    return marks.min(axis=0) - margin, marks.max(axis=0) + margin


def _weights(shape: PalmShape, points: Array) -> Mapping[str, Array]:
    """The weight of every bone at points (n, 3): who carries a point is who is nearest, and how far along it lies through the joint."""
    forearm, wrist, beyond = hinge(
        through(points[:, 1], -0.02 * shape.breadth, _WRIST_BEND * shape.breadth)
    )
    _, thumb_half, thumb = hinge(_thumb(shape, points))
    weights = {"forearm": forearm, "wrist_half": wrist, "hand": np.zeros(len(points))}
    weights |= {"thumb_cmc_half": beyond * thumb_half, CHAINS["thumb"][0]: beyond * thumb}
    left = beyond * (1.0 - thumb_half - thumb)
    for finger, share in zip(FINGERS[1:], _nearest_finger(shape, points).T):
        along = shape.roots[finger].local(points)[:, 1]
        before, half, after = hinge(through(along, 0.02 * shape.breadth, _MCP_BEND * shape.breadth))
        weights["hand"] = weights["hand"] + left * share * before
        weights |= {
            FINGER_JOINTS[finger][0] + "_half": left * share * half,
            CHAINS[finger][0]: left * share * after,
        }
    return weights


def _thumb(shape: PalmShape, points: Array) -> Array:
    """How far points move with the thumb (n,): nearer to its metacarpal than to the palm's middle, and beyond the CMC joint."""
    root = shape.roots["thumb"]
    to_thumb = _to_line(
        points, root.place, root.on_hand(np.array([0.0, root.shape.joints[1], 0.0]))
    )
    to_palm = _to_line(points, shape.at(-0.05, 0.12, 0.0), shape.roots["index"].place)
    nearer = through(to_palm / (to_thumb + to_palm), 0.51, 0.30)
    return nearer * through(
        root.local(points)[:, 1], 0.09 * shape.breadth, _CMC_BEND * shape.breadth
    )


def _nearest_finger(shape: PalmShape, points: Array) -> Array:
    """How much a point belongs to each of the four fingers (n, 4), sharp on a finger and shared in the webs."""
    off = []
    for finger in FINGERS[1:]:
        root = shape.roots[finger]
        far = root.on_hand(np.array([0.0, root.shape.joints[1], 0.0]))
        off.append(_to_line(points, root.place, far) - root.shape.half_breadth)
    distance = np.stack(off, axis=-1)
    closeness = np.exp(-(distance - distance.min(axis=-1, keepdims=True)) / (_WEB * shape.breadth))
    shares: Array = closeness / closeness.sum(axis=-1, keepdims=True)
    return shares


def _below_finger(shape: PalmShape, finger: str, points: Array) -> Array:
    """1 where the palm's surface runs below a finger's mesh (n,): there it must move as the finger does, whatever its neighbours do."""
    root = shape.roots[finger]
    dorsal, along, ulnar = root.local(points).T
    beside = np.hypot(dorsal, ulnar) < 1.1 * root.shape.half_breadth
    return np.where(beside, through(along, shape.ends[finger] - 8.5e-3, 5e-3), 0.0)


def _to_line(points: Array, start: Array, stop: Array) -> Array:
    """Distance (n,) of points (n, 3) from the line between two others."""
    axis = stop - start
    share = np.clip((points - start) @ axis / float(axis @ axis), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - start - share[:, None] * axis, axis=1))
