"""A closed triangle mesh where a smooth field is zero.

In      a function (n, 3) -> (n,), negative inside; a box that holds the whole body; the size of a cell
Out     vertices (V, 3) and faces (F, 3), counter-clockwise seen from outside
Source  naive surface nets: Gibson 1998, MICCAI:888; then points are moved evenly along the surface and onto it (Newton)
Limits  features thinner than two cells are lost
"""

from collections.abc import Callable

import numpy as np
from scipy import sparse

from handscope.app.scene.mesh.skinned_mesh import Indices
from handscope.estimators.numerics.typing import Array

Field = Callable[[Array], Array]
_CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
_EDGES = np.array(
    [
        [a, b]
        for a in range(8)
        for b in range(a + 1, 8)
        if np.abs(_CORNERS[a] - _CORNERS[b]).sum() == 1
    ]
)


def surface(
    field: Field, low: Array, high: Array, cell: float, relax: int = 6
) -> tuple[Array, Indices]:
    """Mesh the zero level of `field` between the corners `low` and `high` (3,) with cells of size `cell`."""
    size = np.ceil((high - low) / cell).astype(int) + 1
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in size), indexing="ij"), axis=-1)
    values = field((low + cell * grid).reshape(-1, 3)).reshape(size)
    index, places = _cell_points(values)
    faces = _quads(values, index)
    vertices = low + cell * places
    rings = neighbours(len(vertices), faces)
    for _ in range(relax):
        vertices = _onto(field, vertices + 0.6 * (rings @ vertices - vertices), 0.2 * cell)
    return _onto(field, vertices, 0.2 * cell), _triangles(vertices, faces)


def neighbours(n: int, faces: Indices) -> sparse.csr_array:
    """A matrix (n, n) that averages each vertex's neighbours in a mesh of n vertices."""
    a, b = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    ones = np.ones(2 * len(a))
    links = sparse.csr_array((ones, (np.concatenate([a, b]), np.concatenate([b, a]))), shape=(n, n))
    links.data[:] = 1.0
    return sparse.csr_array(sparse.diags_array(1.0 / links.sum(axis=1)) @ links)


def _cell_points(values: Array) -> tuple[Indices, Array]:
    """One point in every cell that the surface passes: the mean of where it crosses the cell's edges. Unused cells have index -1."""
    n = np.array(values.shape) - 1
    corners = np.stack(
        [values[i : i + n[0], j : j + n[1], k : k + n[2]] for i, j, k in _CORNERS], axis=-1
    )
    mixed = (corners < 0).any(axis=-1) & (corners >= 0).any(axis=-1)
    cells, f = np.argwhere(mixed), corners[mixed]
    total, count = np.zeros((len(cells), 3)), np.zeros(len(cells))
    for a, b in _EDGES:
        crossing = (f[:, a] < 0) != (f[:, b] < 0)
        share = f[crossing, a] / (f[crossing, a] - f[crossing, b])
        total[crossing] += _CORNERS[a] + share[:, None] * (_CORNERS[b] - _CORNERS[a])
        count[crossing] += 1
    index = np.full(n, -1)
    index[mixed] = np.arange(len(cells))
    return index, cells + total / count[:, None]


def _quads(values: Array, index: Indices) -> Indices:
    """A quadrilateral round every grid edge that the surface crosses, turned outward."""
    quads = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        f = np.moveaxis(values, (axis, u, v), (0, 1, 2))
        cells = np.moveaxis(index, (axis, u, v), (0, 1, 2))
        start, stop = f[:-1, 1:-1, 1:-1], f[1:, 1:-1, 1:-1]
        i, j, k = np.nonzero((start < 0) != (stop < 0))
        ring = np.stack(
            [cells[i, j, k], cells[i, j + 1, k], cells[i, j + 1, k + 1], cells[i, j, k + 1]],
            axis=-1,
        )
        outward = start[i, j, k] < 0
        quads.append(np.where(outward[:, None], ring, ring[:, ::-1]))
    return np.concatenate(quads)


def _onto(field: Field, points: Array, step: float) -> Array:
    """Move points onto the zero level along the field's gradient."""
    shifts = step * np.eye(3)
    value = field(points)
    gradient = np.stack([field(points + s) - field(points - s) for s in shifts], axis=-1) / (
        2 * step
    )
    onto: Array = (
        points - (value / np.maximum(np.sum(gradient**2, axis=-1), 1e-6))[:, None] * gradient
    )
    return onto


def _triangles(vertices: Array, quads: Indices) -> Indices:
    """Cut each quadrilateral along its shorter diagonal."""
    a, b, c, d = (vertices[quads[:, k]] for k in range(4))
    first = np.linalg.norm(a - c, axis=1) <= np.linalg.norm(b - d, axis=1)
    halves = np.where(first[:, None], quads[:, [0, 1, 2, 0, 2, 3]], quads[:, [0, 1, 3, 1, 2, 3]])
    return halves.reshape(-1, 3)
