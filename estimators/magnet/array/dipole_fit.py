"""Readings of an array of magnetometers fitted by the fields of one magnet or of several in a field that is the same everywhere, many readings at once.

In      Told: readings, places of the magnetometers, what else is known; unknowns x (n, 6 k + 3): place (m) and moment (A m^2) of each of k magnets, field (T)
Out     where to begin; whitened residuals with their slopes; x improved until nothing gets better
Source  Kortier, thesis ch. 5, (5.7), (5.8), (5.24); for a given place moment and field are linear (Golub & Pereyra 1973, SIAM J Numer Anal 10:413): a
        grid of places is searched so, then Levenberg-Marquardt
"""

from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.magnet.model import dipole
from handscope.estimators.numerics.typing import Array, Indices

GRID = 14  # places along each edge of the volume: even, so that none lies between two octants
ROUNDS = 30
FARTHEST = 1.0  # m: a step that leads further from the array is cut
OF_ONE = 6  # unknowns of a magnet
SLOPES = 5  # of a field without curl and divergence that changes linearly
_GRADIENTS = np.array(  # (5, 3, 3) orthonormal
    [
        *(
            [[0, 1, 0], [1, 0, 0], [0, 0, 0]],
            [[0, 0, 1], [0, 0, 0], [1, 0, 0]],
            [[0, 0, 0], [0, 0, 1], [0, 1, 0]],
        ),
        *([[1, 0, 0], [0, -1, 0], [0, 0, 0]], np.diag([1, 1, -2]) / np.sqrt(3.0)),
    ]
) / np.sqrt(2.0)


@dataclass(frozen=True)
class Told:
    """What is known of readings that are fitted together."""

    y: Array  # (n, magnetometers, 3) T, base frame
    places: Array  # (magnetometers, 3) m
    field: Array | None  # (n, 3) T
    size: float | None  # A m^2
    noise: float  # T
    size_sd: float  # share
    louder: Array  # (n, magnetometers) standard deviations of readings over the noise
    uneven: float = 0.0  # T/m, standard deviation of each slope of the field
    evened: Array | None = None  # (n, axes, 5) what whitening takes from residuals for that
    rate: Array | None = None  # (n, magnetometers, 3) T/s by which readings change, base frame

    def of(self, rows: Indices) -> "Told":
        field, evened, rate = (_at(values, rows) for values in (self.field, self.evened, self.rate))
        return replace(
            self, y=self.y[rows], field=field, louder=self.louder[rows], evened=evened, rate=rate
        )

    def with_louder(self, louder: Array) -> "Told":
        """Slopes of the field are unknowns that are known to `uneven`: (I + S S')^-1/2 = I - E E' with S what they add to residuals."""
        if not self.uneven:
            return replace(self, louder=louder)
        added = (
            linear(self.places) * self.uneven / (self.noise * louder[..., None, None])
        ).reshape(len(louder), -1, SLOPES)
        U, s, _ = np.linalg.svd(added, full_matrices=False)
        return replace(self, louder=louder, evened=U * np.sqrt(1 - 1 / np.sqrt(1 + s**2))[:, None])

    def evenly(self, values: Array) -> Array:
        """Whitened values (n, axes, any), slopes of the field taken up."""
        return (
            values
            if self.evened is None
            else values - self.evened @ (np.swapaxes(self.evened, 1, 2) @ values)
        )

    def repeated(self, times: int) -> "Told":
        return self.of(np.repeat(np.arange(len(self.y)), times))


def _at(values: Array | None, rows: Indices) -> Array | None:
    return None if values is None else values[rows]


def linear(places: Array) -> Array:
    """Fields (magnetometers, 3, 5) of slopes of 1 T/m, none in the middle."""
    return np.asarray(np.einsum("kij,lj->lik", _GRADIENTS, places - places.mean(axis=0)))


def starts(told: Told, reach: float, regions: int) -> Array:
    """The best place of every region of a grid around the array with the moment and field that fit there (n, regions^3, 9)."""
    y, places, field, size = told.y, told.places, told.field, told.size
    even = np.linspace(-1, 1, GRID)
    edge = (
        even * np.sqrt(np.abs(even)) * reach
    )  # closer together in the middle, where the field bends most
    grid = places.mean(axis=0) + np.stack(
        np.meshgrid(edge, edge, edge, indexing="ij"), axis=-1
    ).reshape(-1, 3)
    along = np.arange(GRID) * regions // GRID
    region = (
        np.stack(np.meshgrid(along, along, along, indexing="ij"), axis=-1).reshape(-1, 3)
        * [1, regions, regions**2]
    ).sum(axis=1)
    clear = np.linalg.norm(grid[:, None] - places, axis=-1).min(axis=1) > 0.02
    grid, region = grid[clear], region[clear]
    J = dipole.by_moment(grid[:, None] - places)  # (G, L, 3, 3)
    A = (
        J
        if field is not None
        else np.concatenate([J, np.broadcast_to(np.eye(3), J.shape)], axis=-1)
    )
    A = A.reshape(len(grid), -1, A.shape[-1])
    scale = np.abs(A).max(axis=1, keepdims=True)
    Q, R = np.linalg.qr(A / scale)
    flat = (y if field is None else y - field[:, None]).reshape(len(y), -1)
    along_Q = (flat @ np.moveaxis(Q, 1, 0).reshape(Q.shape[1], -1)).reshape(len(flat), len(Q), -1)
    unexplained = (flat**2).sum(axis=1)[:, None] - (along_Q**2).sum(axis=2)
    if size is not None:
        fit = np.einsum("gcd,ngd->ngc", np.linalg.inv(R), along_Q) / scale[:, 0]
        m = np.linalg.norm(fit[..., :3], axis=-1)
        strength = np.sqrt(
            (J**2).mean(axis=(1, 2, 3)) * 3
        )  # field of one A m^2 at the magnetometers
        unexplained = unexplained + ((m - size) * strength) ** 2
    best = np.stack(
        [
            np.flatnonzero(region == k)[unexplained[:, region == k].argmin(axis=1)]
            for k in np.unique(region)
        ],
        axis=1,
    )
    rows = np.arange(len(y))[:, None]
    solution = (
        np.einsum("nscd,nsd->nsc", np.linalg.inv(R)[best], along_Q[rows, best]) / scale[:, 0][best]
    )
    x = np.zeros((*best.shape, 9))
    x[..., :3], x[..., 3 : 3 + solution.shape[-1]] = grid[best], solution
    return x


def by_places(x: Array, told: Told, place_sd: float) -> Array:
    """How many times louder than its noise each magnetometer (n, magnetometers) is by the error of its place, where the magnet's field bends."""
    bends = dipole.by_place(x[:, None, :3] - told.places, x[:, None, 3:6])
    return np.asarray(
        np.sqrt(1.0 + (bends**2).mean(axis=(2, 3)) * 3 * (place_sd / told.noise) ** 2)
    )


def residuals(x: Array, told: Told) -> tuple[Array, Array]:
    """Whitened residuals (n, c) and their derivatives (n, c, 6 k or 6 k + 3) by places (m), moments (A m^2) and field (in units of the noise)."""
    left = told.y - (x[:, None, -3:] if told.field is None else told.field[:, None])
    noise = told.noise * told.louder[..., None]
    blocks = []
    for at in range(0, x.shape[1] - 3, OF_ONE):
        r, m = x[:, None, at : at + 3] - told.places, x[:, None, at + 3 : at + OF_ONE]
        left = left - dipole.field(r, m)
        blocks += [dipole.by_place(r, m) / noise[..., None], dipole.by_moment(r) / noise[..., None]]
    if told.field is None:
        blocks.append(np.eye(3) / told.louder[..., None, None])
    off, A = (
        (left / noise).reshape(len(x), -1),
        np.concatenate(blocks, axis=-1).reshape(len(x), told.y[0].size, -1),
    )
    off, A = told.evenly(off[..., None])[..., 0], told.evenly(A)
    if told.size is not None:  # of the first
        length = np.linalg.norm(x[:, 3:6], axis=1)
        sharp = 1.0 / (told.size_sd * told.size)
        row = np.zeros((len(x), 1, A.shape[2]))
        row[:, 0, 3:6] = x[:, 3:6] / np.maximum(length, 1e-9)[:, None] * sharp
        off, A = (
            np.concatenate([off, ((told.size - length) * sharp)[:, None]], axis=1),
            np.concatenate([A, row], axis=1),
        )
    return off, A


def improved(x: Array, told: Told, rounds: int = ROUNDS) -> tuple[Array, Array]:
    """x and its cost by Levenberg-Marquardt of all rows at once: a row that does not get better takes a shorter step next time."""
    damping = np.full(len(x), 1e-2)
    r, A = residuals(x, told)
    cost, k = (r**2).sum(axis=1), A.shape[2]
    unit, middle = (
        np.append(np.ones(x.shape[1] - 3), np.full(3, told.noise))[:k],
        told.places.mean(axis=0),
    )
    places = [slice(at, at + 3) for at in range(0, x.shape[1] - 3, OF_ONE)]
    going = np.ones(len(x), bool)
    for _ in range(rounds):
        rows = np.flatnonzero(going)
        if not len(rows):
            break
        N = np.swapaxes(A[rows], 1, 2) @ A[rows]
        diagonal = np.maximum(N[:, range(k), range(k)], 1e-12)
        N[:, range(k), range(k)] += damping[rows, None] * diagonal + 1e-12
        step = np.linalg.solve(N, (np.swapaxes(A[rows], 1, 2) @ r[rows, :, None]))[..., 0] * unit
        long = np.max([np.linalg.norm(step[:, place], axis=1) for place in places], axis=0)
        step *= np.minimum(1.0, 0.1 / np.maximum(long, 1e-12))[:, None]
        tried = x[rows].copy()
        tried[:, :k] += step
        for place in places:
            away = tried[:, place] - middle
            far = np.linalg.norm(away, axis=1)
            tried[:, place] = (
                middle + away * np.minimum(1.0, FARTHEST / np.maximum(far, 1e-9))[:, None]
            )
        new_r, new_A = residuals(tried, told.of(rows))
        new = (new_r**2).sum(axis=1)
        better = new < cost[rows]
        damping[rows] = np.where(better, damping[rows] * 0.2, damping[rows] * 5.0)
        going[rows] = np.where(
            better,
            (cost[rows] - new > 1e-6 * cost[rows]) | (new > 100 * r.shape[1]),
            damping[rows] < 1e6,
        )
        up = rows[better]
        x[up], r[up], A[up], cost[up] = tried[better], new_r[better], new_A[better], new[better]
    return x, cost
