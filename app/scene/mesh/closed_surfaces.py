"""Closed triangle surfaces over regular grids of points; faces run counter-clockwise seen from outside."""

import numpy as np

from handscope.app.scene.mesh.skinned_mesh import Indices
from handscope.estimators.numerics.typing import Array


def closed_tube(rings: Array, start: Array, stop: Array) -> tuple[Array, Indices]:
    """Vertices and faces of a tube through rings (rings, around, 3), closed by a point (3,) at either end.

    Seen against the direction of the tube, looking back from its end to its start, each ring runs clockwise.
    """
    count, around = rings.shape[:2]
    grid = np.arange(count * around).reshape(count, around)
    after = np.roll(grid, -1, axis=1)
    base, tip = np.full(around, count * around), np.full(around, count * around + 1)
    caps = [np.stack([base, after[0], grid[0]], -1), np.stack([tip, grid[-1], after[-1]], -1)]
    return np.concatenate([rings.reshape(-1, 3), start[None], stop[None]]), np.concatenate(
        [_strips(grid, after), *caps]
    )


def closed_plate(top: Array, bottom: Array) -> tuple[Array, Indices]:
    """Vertices and faces of a plate between two grids (rows, columns, 3); rows follow columns clockwise seen from above."""
    rows, columns = top.shape[:2]
    grid = np.arange(rows * columns).reshape(rows, columns)
    upper = _strips(grid[:, :-1], grid[:, 1:])
    border = np.concatenate([grid[0, :], grid[1:, -1], grid[-1, -2::-1], grid[-2:0:-1, 0]])
    after, below = np.roll(border, -1), rows * columns
    rim = np.concatenate(
        [
            np.stack([after, border, border + below], -1),
            np.stack([after, border + below, after + below], -1),
        ]
    )
    return np.concatenate([top.reshape(-1, 3), bottom.reshape(-1, 3)]), np.concatenate(
        [upper, upper[:, ::-1] + below, rim]
    )


def _strips(left: Indices, right: Indices) -> Indices:
    """Triangles between neighbouring columns of vertex numbers, (rows, columns) each."""
    a, b, c, d = left[:-1].ravel(), right[:-1].ravel(), left[1:].ravel(), right[1:].ravel()
    return np.concatenate([np.stack([a, b, c], -1), np.stack([b, d, c], -1)])
