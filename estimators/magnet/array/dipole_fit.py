"""Fit of one or several dipoles in a homogeneous field to readings of an array, many readings at
once.

In      DipoleFitProblem: readings, positions of the magnetometers, prior knowledge; unknowns x (n,
        6 k + 3): position (m) and moment (A m^2) of each of k magnets, field (T)
Out     starting points; whitened residuals with their Jacobian; x refined to convergence
Source  Kortier, thesis ch. 5, (5.7), (5.8), (5.24); for a given position moment and field are
        linear (Golub & Pereyra 1973, SIAM J Numer Anal 10:413): grid search, then
        Levenberg-Marquardt
"""

from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.magnet.model import dipole
from handscope.estimators.numerics.typing import Array, Indices

GRID = 14  # points along each edge of the grid: even, so that none lies between two octants
ROUNDS = 30
FARTHEST = 1.0  # m: largest distance from the array
PER_MAGNET = 6  # unknowns of a magnet
GRADIENT_TERMS = 5  # gradients of a field without curl and divergence
_GRADIENT_BASIS = np.array(  # (5, 3, 3) orthonormal
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
class DipoleFitProblem:
    """What is known of readings that are fitted together."""

    y: Array  # (n, magnetometers, 3) T, base frame
    places: Array  # (magnetometers, 3) m
    field: Array | None  # (n, 3) T
    size: float | None  # A m^2
    noise: float  # T
    size_sd: float  # share
    noise_ratio: Array  # (n, magnetometers) standard deviations over the noise
    gradient_sd: float = 0.0  # T/m, standard deviation of each gradient of the field
    whitening: Array | None = None  # (n, axes, 5) what whitening removes from residuals for that
    rate: Array | None = None  # (n, magnetometers, 3) T/s, rate of change of readings, base frame

    def select(self, rows: Indices) -> "DipoleFitProblem":
        field, whitening, rate = (
            _rows_of(values, rows) for values in (self.field, self.whitening, self.rate)
        )
        return replace(
            self,
            y=self.y[rows],
            field=field,
            noise_ratio=self.noise_ratio[rows],
            whitening=whitening,
            rate=rate,
        )

    def with_noise_ratio(self, noise_ratio: Array) -> "DipoleFitProblem":
        """Marginalise gradients known to `gradient_sd`: whiten by (I + S S')^-1/2 = I - E E', S
        their Jacobian."""
        if not self.gradient_sd:
            return replace(self, noise_ratio=noise_ratio)
        added = (
            gradient_fields(self.places)
            * self.gradient_sd
            / (self.noise * noise_ratio[..., None, None])
        ).reshape(len(noise_ratio), -1, GRADIENT_TERMS)
        U, s, _ = np.linalg.svd(added, full_matrices=False)
        return replace(
            self, noise_ratio=noise_ratio, whitening=U * np.sqrt(1 - 1 / np.sqrt(1 + s**2))[:, None]
        )

    def whiten(self, values: Array) -> Array:
        """Whitened values (n, axes, any), gradients marginalised."""
        return (
            values
            if self.whitening is None
            else values - self.whitening @ (np.swapaxes(self.whitening, 1, 2) @ values)
        )

    def repeat(self, times: int) -> "DipoleFitProblem":
        return self.select(np.repeat(np.arange(len(self.y)), times))


def _rows_of(values: Array | None, rows: Indices) -> Array | None:
    return None if values is None else values[rows]


def gradient_fields(places: Array) -> Array:
    """Fields (magnetometers, 3, 5) of gradients of 1 T/m, zero in the middle."""
    return np.asarray(np.einsum("kij,lj->lik", _GRADIENT_BASIS, places - places.mean(axis=0)))


def grid_starts(problem: DipoleFitProblem, reach: float, regions: int) -> Array:
    """Best point of every region of a grid around the array, with the moment and field that fit
    there (n, regions^3, 9)."""
    y, places, field, size = problem.y, problem.places, problem.field, problem.size
    even = np.linspace(-1, 1, GRID)
    edge = even * np.sqrt(np.abs(even)) * reach  # denser in the middle, where the field curves most
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
    J = dipole.field_by_moment(grid[:, None] - places)  # (G, L, 3, 3)
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
        strength = np.sqrt((J**2).mean(axis=(1, 2, 3)) * 3)  # field of 1 A m^2 at the magnetometers
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


def noise_ratio_of_places(x: Array, problem: DipoleFitProblem, place_sd: float) -> Array:
    """Standard deviations (n, magnetometers) over the noise, with errors of the magnetometers'
    positions."""
    bends = dipole.field_gradient(x[:, None, :3] - problem.places, x[:, None, 3:6])
    return np.asarray(
        np.sqrt(1.0 + (bends**2).mean(axis=(2, 3)) * 3 * (place_sd / problem.noise) ** 2)
    )


def compute_residuals(x: Array, problem: DipoleFitProblem) -> tuple[Array, Array]:
    """Whitened residuals (n, c) and their Jacobian (n, c, 6 k or 6 k + 3) by positions (m), moments
    (A m^2) and field (in units of the noise)."""
    misfit = problem.y - (x[:, None, -3:] if problem.field is None else problem.field[:, None])
    noise = problem.noise * problem.noise_ratio[..., None]
    blocks = []
    for at in range(0, x.shape[1] - 3, PER_MAGNET):
        r, m = x[:, None, at : at + 3] - problem.places, x[:, None, at + 3 : at + PER_MAGNET]
        misfit = misfit - dipole.field(r, m)
        blocks += [
            dipole.field_gradient(r, m) / noise[..., None],
            dipole.field_by_moment(r) / noise[..., None],
        ]
    if problem.field is None:
        blocks.append(np.eye(3) / problem.noise_ratio[..., None, None])
    residual, A = (
        (misfit / noise).reshape(len(x), -1),
        np.concatenate(blocks, axis=-1).reshape(len(x), problem.y[0].size, -1),
    )
    residual, A = problem.whiten(residual[..., None])[..., 0], problem.whiten(A)
    if problem.size is not None:  # of the first magnet
        length = np.linalg.norm(x[:, 3:6], axis=1)
        weight = 1.0 / (problem.size_sd * problem.size)
        row = np.zeros((len(x), 1, A.shape[2]))
        row[:, 0, 3:6] = x[:, 3:6] / np.maximum(length, 1e-9)[:, None] * weight
        residual, A = (
            np.concatenate([residual, ((problem.size - length) * weight)[:, None]], axis=1),
            np.concatenate([A, row], axis=1),
        )
    return residual, A


def refine(x: Array, problem: DipoleFitProblem, rounds: int = ROUNDS) -> tuple[Array, Array]:
    """x and its cost by Levenberg-Marquardt, all rows at once with a damping each."""
    damping = np.full(len(x), 1e-2)
    r, A = compute_residuals(x, problem)
    cost, k = (r**2).sum(axis=1), A.shape[2]
    unit, middle = (
        np.append(np.ones(x.shape[1] - 3), np.full(3, problem.noise))[:k],
        problem.places.mean(axis=0),
    )
    places = [slice(at, at + 3) for at in range(0, x.shape[1] - 3, PER_MAGNET)]
    is_active = np.ones(len(x), bool)
    for _ in range(rounds):
        rows = np.flatnonzero(is_active)
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
        new_r, new_A = compute_residuals(tried, problem.select(rows))
        new = (new_r**2).sum(axis=1)
        better = new < cost[rows]
        damping[rows] = np.where(better, damping[rows] * 0.2, damping[rows] * 5.0)
        is_active[rows] = np.where(
            better,
            (cost[rows] - new > 1e-6 * cost[rows]) | (new > 100 * r.shape[1]),
            damping[rows] < 1e6,
        )
        improved_rows = rows[better]
        x[improved_rows], r[improved_rows], A[improved_rows], cost[improved_rows] = (
            tried[better],
            new_r[better],
            new_A[better],
            new[better],
        )
    return x, cost
