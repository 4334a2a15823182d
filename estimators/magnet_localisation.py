"""Where a magnet is, reading by reading, from an array of magnetometers alone: no inertial sensor, no past.

In      readings of several magnetometers (n, magnetometers, 3), T; where they sit; the field without the magnet, or nothing of it; the moment's size, or nothing
Out     Located: place and moment of the magnet in the base's frame with standard deviations, the field without it, what is left unexplained
Source  Kortier, thesis ch. 5, (5.7), (5.8); for a given place moment and field are linear (Golub & Pereyra 1973, SIAM J Numer Anal 10:413): a grid of
        places is searched so, then Levenberg-Marquardt from the best ones, all readings at once
Limits  with an unknown field three magnetometers at least, with a known one two; the field must be the same at all of them. Where as much is unknown as
        is read (three magnetometers, or two in a known field, and no size told) several places explain a reading exactly, and nothing is found
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimators import dipole
from estimators import quaternions as quat
from estimators.errors import InputError
from estimators.magnet_setup import Constellation, require_field
from estimators.quaternions import Array

GRID = 14  # places along each edge of the volume: even, so that none lies between two octants
REGIONS = 2  # along each edge: the best place of every octant around the array is a start
AMBIGUOUS = 12.0  # a second place whose cost is less than this above the best one's cannot be ruled out
ROUNDS = 30
STRAIGHT = (
    0.05  # of the distance: a place less sure than this lies where the field bends, and standard deviations from its slope say nothing
)
PIECE = 4096  # readings at once
FARTHEST = 1.0  # m: a step that leads further from the array is cut


@dataclass(frozen=True)
class Located:
    place: Array  # (n, 3) m, base frame; NaN where readings are missing
    moment: Array  # (n, 3) A m^2, base frame
    field: Array  # (n, 3) T, base frame: without the magnet
    place_sd: Array  # (n, 3) m
    moment_sd: Array  # (n, 3) A m^2
    left: Array  # (n,) RMS of what is left, T
    misfit: Array  # (n,) the same in standard deviations of readings, errors of the magnetometers' places counted
    disputed: NDArray[np.bool_]  # (n,) the size told is off by more than three of its standard deviations
    found: NDArray[np.bool_]  # (n,) explained to within `worst` of them, and known better than `sure`


@dataclass(frozen=True)
class Told:
    """What is known of readings that are solved together."""

    y: Array  # (n, magnetometers, 3) T, base frame
    places: Array  # (magnetometers, 3) m
    field: Array | None  # (n, 3) T
    size: float | None  # A m^2
    noise: float  # T
    size_sd: float  # share
    louder: Array  # (n, magnetometers) standard deviations of readings over the noise

    def of(self, rows: NDArray[np.intp]) -> "Told":
        return replace(self, y=self.y[rows], field=None if self.field is None else self.field[rows], louder=self.louder[rows])

    def repeated(self, times: int) -> "Told":
        return self.of(np.repeat(np.arange(len(self.y)), times))


def located(
    mag: Array,
    array: Constellation,
    field: Array | None = None,
    size: float | None = None,
    noise: float = 0.5e-6,
    reach: float = 0.5,
    sure: float = 0.05,
    size_sd: float = 1e-3,
    regions: int = REGIONS,
    place_sd: float = 0.0,
    worst: float = 3.0,
) -> Located:
    """The magnet at every reading; `field` (3,) or (n, 3) T in the base's frame, `size` of the moment in A m^2, noise T of an axis, reach m, sure m,
    `size_sd` as a share of the size, `place_sd` m of a magnetometer's place. What is left
    is `worst` standard deviations (RMS) at most. More `regions` find more of the places that explain a reading as well."""
    if mag.ndim != 3 or mag.shape[1:] != (len(array), 3):
        raise InputError(f"Readings must be (n, {len(array)}, 3) for this constellation, they are {mag.shape}.")
    require_field(mag)
    unknowns, told = 6 + 3 * (field is None), 3 * len(array) + (size is not None)
    if told < unknowns:
        raise InputError(
            f"{len(array)} magnetometer{'s' * (len(array) > 1)} cannot tell place, moment and field of a magnet together: "
            "tell the field without the magnet and the moment's size, or use the tracker with inertial sensors."
        )
    y = quat.rotate(array.q_bl, mag)
    background = np.full((len(y), 3), np.nan) if field is None else np.broadcast_to(field, (len(y), 3))
    good = np.isfinite(y).all(axis=(1, 2)) & (np.isfinite(background).all(axis=1) | (field is None))
    out = *np.full((2, len(y), 9), np.nan), *np.full((2, len(y)), np.nan), np.zeros(len(y))
    rows = np.flatnonzero(good)
    for part in np.array_split(rows, max(1, -(-len(rows) // PIECE))):
        known, alike = None if field is None else background[part], np.ones((len(part), len(array)))
        values = _solved(Told(y[part], array.places, known, size, noise, size_sd, alike), reach, regions, place_sd) if len(part) else ()
        for whole, piece in zip(out, values):
            whole[part] = piece
    x, sd, left, misfit, dispute = out
    distance = np.linalg.norm(x[:, None, :3] - array.places, axis=-1).min(axis=1)
    found = (told > unknowns) & np.isfinite(misfit) & (misfit < worst) & (sd[:, :3].max(axis=1) < np.minimum(sure, STRAIGHT * distance))
    return Located(
        x[:, :3], x[:, 3:6], x[:, 6:] if field is None else background.copy(), sd[:, :3], sd[:, 3:6], left, misfit, dispute >= 3, found
    )


def _solved(told: Told, reach: float, regions: int, place_sd: float) -> tuple[Array, Array, Array, Array, Array]:
    """Values (n, 9), their standard deviations, RMS left (n,) in T and in standard deviations, by how many of its own the size told is off (n,)."""
    starts = _starts(told, reach, regions)  # (n, many, 9)
    n, many = starts.shape[:2]
    each = told.repeated(many)
    x, cost = _improved(starts.reshape(n * many, 9), each)
    if place_sd > 0:
        best = np.arange(n) * many + cost.reshape(n, many).argmin(axis=1)
        louder = _by_places(x[best], told, place_sd)
        told, each = replace(told, louder=louder), replace(each, louder=np.repeat(louder, many, axis=0))
        x, cost = _improved(x, each)
    cost = cost.reshape(n, many)
    best = np.arange(n) * many + cost.argmin(axis=1)
    apart = np.linalg.norm(x.reshape(n, many, 9)[..., :3] - x[best, None, :3], axis=-1)
    rival = np.where(cost < cost.min(axis=1, keepdims=True) + AMBIGUOUS, apart, 0.0).max(axis=1)
    r, A = _residuals(x[best], told)
    _, s, Vt = np.linalg.svd(A, full_matrices=False)
    variance = (Vt**2 / np.maximum(s, 1e-9)[..., None] ** 2).sum(axis=1)
    dispute = np.zeros(n) if told.size is None else np.abs(r[:, -1])
    r = r[:, : told.y[0].size].reshape(told.y.shape)
    misfit, left = np.sqrt((r**2).mean(axis=(1, 2))), told.noise * np.sqrt(((r * told.louder[..., None]) ** 2).mean(axis=(1, 2)))
    scale = np.repeat([1.0, 1.0, told.noise], 3) if told.field is None else np.ones(6)
    sd = np.zeros((n, 9))
    sd[:, : A.shape[2]] = np.sqrt(variance) * np.maximum(1.0, misfit)[:, None] * scale
    sd[:, :3] = np.where(rival > 5 * np.linalg.norm(sd[:, :3], axis=1), rival, 0.0)[:, None] + sd[:, :3]
    return x[best], sd, left, misfit, dispute


def _by_places(x: Array, told: Told, place_sd: float) -> Array:
    """How many times louder than its noise each magnetometer (n, magnetometers) is by the error of its place, where the magnet's field bends."""
    bends = dipole.by_place(x[:, None, :3] - told.places, x[:, None, 3:6])
    return np.asarray(np.sqrt(1.0 + (bends**2).mean(axis=(2, 3)) * 3 * (place_sd / told.noise) ** 2))


def _starts(told: Told, reach: float, regions: int) -> Array:
    """The best place of every region of a grid around the array with the moment and field that fit there (n, regions^3, 9)."""
    y, places, field, size = told.y, told.places, told.field, told.size
    even = np.linspace(-1, 1, GRID)
    edge = even * np.sqrt(np.abs(even)) * reach  # closer together in the middle, where the field bends most
    grid = places.mean(axis=0) + np.stack(np.meshgrid(edge, edge, edge, indexing="ij"), axis=-1).reshape(-1, 3)
    along = np.arange(GRID) * regions // GRID
    region = (np.stack(np.meshgrid(along, along, along, indexing="ij"), axis=-1).reshape(-1, 3) * [1, regions, regions**2]).sum(axis=1)
    clear = np.linalg.norm(grid[:, None] - places, axis=-1).min(axis=1) > 0.02
    grid, region = grid[clear], region[clear]
    J = dipole.by_moment(grid[:, None] - places)  # (G, L, 3, 3)
    A = J if field is not None else np.concatenate([J, np.broadcast_to(np.eye(3), J.shape)], axis=-1)
    A = A.reshape(len(grid), -1, A.shape[-1])
    scale = np.abs(A).max(axis=1, keepdims=True)
    Q, R = np.linalg.qr(A / scale)
    flat = (y if field is None else y - field[:, None]).reshape(len(y), -1)
    along_Q = np.einsum("nk,gkc->ngc", flat, Q)
    unexplained = (flat**2).sum(axis=1)[:, None] - (along_Q**2).sum(axis=2)
    if size is not None:
        fit = np.einsum("gcd,ngd->ngc", np.linalg.inv(R), along_Q) / scale[:, 0]
        m = np.linalg.norm(fit[..., :3], axis=-1)
        strength = np.sqrt((J**2).mean(axis=(1, 2, 3)) * 3)  # field of one A m^2 at the magnetometers
        unexplained = unexplained + ((m - size) * strength) ** 2
    best = np.stack([np.flatnonzero(region == k)[unexplained[:, region == k].argmin(axis=1)] for k in np.unique(region)], axis=1)
    rows = np.arange(len(y))[:, None]
    solution = np.einsum("nscd,nsd->nsc", np.linalg.inv(R)[best], along_Q[rows, best]) / scale[:, 0][best]
    x = np.zeros((*best.shape, 9))
    x[..., :3], x[..., 3 : 3 + solution.shape[-1]] = grid[best], solution
    return x


def _residuals(x: Array, told: Told) -> tuple[Array, Array]:
    """Whitened residuals (n, k) and their derivatives (n, k, 6 or 9) by place (m), moment (A m^2) and field (in units of the noise)."""
    r, m = x[:, None, :3] - told.places, x[:, None, 3:6]
    background = x[:, None, 6:] if told.field is None else told.field[:, None]
    noise = told.noise * told.louder[..., None]
    off = ((told.y - background - dipole.field(r, m)) / noise).reshape(len(x), -1)
    blocks = [dipole.by_place(r, m) / noise[..., None], dipole.by_moment(r) / noise[..., None]]
    if told.field is None:
        blocks.append(np.eye(3) / told.louder[..., None, None])
    A = np.concatenate(blocks, axis=-1).reshape(len(x), off.shape[1], -1)
    if told.size is not None:
        length = np.linalg.norm(x[:, 3:6], axis=1)
        sharp = 1.0 / (told.size_sd * told.size)
        row = np.zeros((len(x), 1, A.shape[2]))
        row[:, 0, 3:6] = x[:, 3:6] / np.maximum(length, 1e-9)[:, None] * sharp
        off, A = np.concatenate([off, ((told.size - length) * sharp)[:, None]], axis=1), np.concatenate([A, row], axis=1)
    return off, A


def _improved(x: Array, told: Told) -> tuple[Array, Array]:
    """Levenberg-Marquardt of all rows at once: a row that does not get better takes a shorter step next time."""
    damping = np.full(len(x), 1e-2)
    r, A = _residuals(x, told)
    cost, k = (r**2).sum(axis=1), A.shape[2]
    unit, middle = np.repeat([1.0, 1.0, told.noise], 3)[:k], told.places.mean(axis=0)
    going = np.ones(len(x), bool)
    for _ in range(ROUNDS):
        rows = np.flatnonzero(going)
        if not len(rows):
            break
        N = np.swapaxes(A[rows], 1, 2) @ A[rows]
        diagonal = np.maximum(N[:, range(k), range(k)], 1e-12)
        N[:, range(k), range(k)] += damping[rows, None] * diagonal + 1e-12
        step = np.linalg.solve(N, (np.swapaxes(A[rows], 1, 2) @ r[rows, :, None]))[..., 0] * unit
        long = np.linalg.norm(step[:, :3], axis=1)
        step *= np.minimum(1.0, 0.1 / np.maximum(long, 1e-12))[:, None]
        tried = x[rows].copy()
        tried[:, :k] += step
        away = tried[:, :3] - middle
        far = np.linalg.norm(away, axis=1)
        tried[:, :3] = middle + away * np.minimum(1.0, FARTHEST / np.maximum(far, 1e-9))[:, None]
        new_r, new_A = _residuals(tried, told.of(rows))
        new = (new_r**2).sum(axis=1)
        better = new < cost[rows]
        damping[rows] = np.where(better, damping[rows] * 0.2, damping[rows] * 5.0)
        going[rows] = np.where(better, (cost[rows] - new > 1e-6 * cost[rows]) | (new > 100 * r.shape[1]), damping[rows] < 1e6)
        up = rows[better]
        x[up], r[up], A[up], cost[up] = tried[better], new_r[better], new_A[better], new[better]
    return x, cost
