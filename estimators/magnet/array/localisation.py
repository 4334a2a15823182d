"""Position and moment of a magnet from single readings of a magnetometer array, without inertial
sensors or history.

In      readings (n, magnetometers, 3), T; positions of the magnetometers; optionally the field
        without the magnet and the moment's size
Out     Localisation: position and moment in the base's frame with standard deviations, field
        without the magnet, residuals
Source  Kortier, thesis ch. 5, (5.7), (5.8); for a given position moment and field are linear (Golub
        & Pereyra 1973, SIAM J Numer Anal 10:413): grid search, then Levenberg-Marquardt from the
        best points, all readings at once
Limits  three magnetometers at least with an unknown field, two with a known one; the field must be
        homogeneous over them. With as many unknowns as values (three magnetometers, or two in a
        known field, without the moment's size) several positions fit exactly, and none is reported
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.magnet.array.dipole_fit import (
    ROUNDS,
    DipoleFitProblem,
    compute_residuals,
    grid_starts,
    noise_ratio_of_places,
    refine,
)
from handscope.estimators.magnet.model.setup import Constellation, require_field
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Bools

REGIONS = 2  # along each edge: the best point of every octant is a start
# a second position whose cost is less than this above the best one's is not ruled out
AMBIGUOUS = 12.0
LINEAR_SHARE = 0.05  # of the distance: linearised standard deviations do not hold beyond
MAX_SD = 0.05  # m
FIRST_ROUNDS = 12  # rounds of all starts, where errors of the magnetometers' positions count
# m between equal positions; positions of a reading that are refined further
SAME_PLACE, MAX_CANDIDATES = 1e-3, 8
CHUNK = 4096  # readings at once


@dataclass(frozen=True)
class Localisation:
    """Places (m) and moments (A m^2) of the magnet, reading by reading."""

    place: Array  # (n, 3) m, base frame; NaN where readings are missing
    moment: Array  # (n, 3) A m^2, base frame
    field: Array  # (n, 3) T, base frame: without the magnet
    place_sd: Array  # (n, 3) m
    moment_sd: Array  # (n, 3) A m^2
    residual_rms: Array  # (n,) RMS residual, T
    # (n,) the same in standard deviations, with errors of the magnetometers' positions
    misfit: Array
    contradicts_size: Bools  # (n,) beyond three standard deviations from the declared size
    is_located: Bools  # (n,) misfit below `max_misfit`, sd below `max_sd`


def locate(
    mag: Array,
    array: Constellation,
    field: Array | None = None,
    size: float | None = None,
    noise: float = 0.5e-6,
    reach: float = 0.5,
    max_sd: float = MAX_SD,
    size_sd: float = 1e-3,
    regions: int = REGIONS,
    place_sd: float = 0.0,
    max_misfit: float = 3.0,
    gradient_sd: float = 0.0,
) -> Localisation:
    """The magnet at every reading.

    `field` (3,) or (n, 3) T in the base's frame; `size` of the moment, A m^2, and `size_sd`, its
    share; noise T an axis; reach m; max_sd m; place_sd m of a magnetometer; max_misfit in standard
    deviations (RMS); gradient_sd T/m of the field (field_gradient_test.py). More `regions` find
    more of the positions that fit a reading as well.
    """
    if mag.ndim != 3 or mag.shape[1:] != (len(array), 3):
        raise InputError("magnet.readings_shape", array=len(array), shape=str(mag.shape))
    require_field(mag)
    unknowns, known = 6 + 3 * (field is None), 3 * len(array) + (size is not None)
    if known < unknowns:
        raise InputError("magnet.too_few_for_position", count=len(array))
    y = quat.rotate(array.q_bl, mag)
    background = (
        np.full((len(y), 3), np.nan) if field is None else np.broadcast_to(field, (len(y), 3))
    )
    good = np.isfinite(y).all(axis=(1, 2)) & (np.isfinite(background).all(axis=1) | (field is None))
    out = *np.full((2, len(y), 9), np.nan), *np.full((2, len(y)), np.nan), np.zeros(len(y))
    rows = np.flatnonzero(good)
    for part in np.array_split(rows, max(1, -(-len(rows) // CHUNK))):
        known_field, ones = (
            None if field is None else background[part],
            np.ones((len(part), len(array))),
        )
        problem = DipoleFitProblem(
            y[part], array.places, known_field, size, noise, size_sd, ones, gradient_sd
        ).with_noise_ratio(ones)
        values = _solve(problem, reach, regions, place_sd) if len(part) else ()
        for whole, piece in zip(out, values):
            whole[part] = piece
    x, sd, residual_rms, misfit, size_deviation = out
    is_located = (
        (known > unknowns)
        & np.isfinite(misfit)
        & (misfit < max_misfit)
        & (sd[:, :3].max(axis=1) < max_position_sd(x[:, :3], array, max_sd))
    )
    return Localisation(
        x[:, :3],
        x[:, 3:6],
        x[:, 6:] if field is None else background.copy(),
        sd[:, :3],
        sd[:, 3:6],
        residual_rms,
        misfit,
        size_deviation >= 3,
        is_located,
    )


def max_position_sd(place: Array, array: Constellation, max_sd: float = MAX_SD) -> Array:
    """Largest standard deviations (n,) m that positions (n, 3) may have."""
    return np.asarray(
        np.minimum(
            max_sd,
            LINEAR_SHARE * np.linalg.norm(place[:, None] - array.places, axis=-1).min(axis=1),
        )
    )


def _distinct_candidates(x: Array, cost: Array) -> tuple[Array, Array, int]:
    """The distinct solutions of lowest cost among starts (n, many, 9), and how many of each
    reading."""
    order = cost.argsort(axis=1)
    x, cost = (
        np.take_along_axis(x, order[..., None], axis=1),
        np.take_along_axis(cost, order, axis=1),
    )
    near = np.linalg.norm(x[:, :, None, :3] - x[:, None, :, :3], axis=-1) < SAME_PLACE
    is_repeated = (near & np.tri(x.shape[1], k=-1, dtype=bool)).any(axis=2)
    selected = np.argsort(is_repeated, axis=1, kind="stable")[:, :MAX_CANDIDATES]
    x, cost = (
        np.take_along_axis(x, selected[..., None], axis=1),
        np.take_along_axis(cost, selected, axis=1),
    )
    return x.reshape(-1, 9), cost.reshape(-1), selected.shape[1]


def estimate_noise(localisation: Localisation, many: int) -> float:
    """Standard deviation of readings of `many` magnetometers, T, from residuals (nine unknowns
    explain a part): noise with errors of positions and calibrations, however fast the magnet moves.
    """
    residual_rms = localisation.residual_rms[np.isfinite(localisation.residual_rms)]
    return (
        float(np.median(residual_rms)) * float(np.sqrt(3 * many / (3 * many - 9)))
        if len(residual_rms)
        else np.inf
    )


def _solve(
    problem: DipoleFitProblem, reach: float, regions: int, place_sd: float
) -> tuple[Array, Array, Array, Array, Array]:
    """Solutions (n, 9), standard deviations, RMS residuals (n,) in T and in standard deviations,
    deviation of the moment from the declared size in standard deviations (n,)."""
    initial = grid_starts(problem, reach, regions)  # (n, many, 9)
    n, many = initial.shape[:2]
    x, cost = refine(
        initial.reshape(n * many, 9),
        problem.repeat(many),
        ROUNDS if place_sd == 0 else FIRST_ROUNDS,
    )
    if place_sd > 0:
        x, cost, many = _distinct_candidates(x.reshape(n, many, 9), cost.reshape(n, many))
        x, cost = refine(x, problem.repeat(many))
        best = np.arange(n) * many + cost.reshape(n, many).argmin(axis=1)
        problem = problem.with_noise_ratio(noise_ratio_of_places(x[best], problem, place_sd))
        x, cost = refine(x, problem.repeat(many))
    cost = cost.reshape(n, many)
    best = np.arange(n) * many + cost.argmin(axis=1)
    separation = np.linalg.norm(x.reshape(n, many, 9)[..., :3] - x[best, None, :3], axis=-1)
    rival = np.where(cost < cost.min(axis=1, keepdims=True) + AMBIGUOUS, separation, 0.0).max(
        axis=1
    )
    r, A = compute_residuals(x[best], problem)
    _, s, Vt = np.linalg.svd(A, full_matrices=False)
    variance = (Vt**2 / np.maximum(s, 1e-9)[..., None] ** 2).sum(axis=1)
    size_deviation = np.zeros(n) if problem.size is None else np.abs(r[:, -1])
    r = r[:, : problem.y[0].size].reshape(problem.y.shape)
    misfit, residual_rms = (
        np.sqrt((r**2).mean(axis=(1, 2))),
        problem.noise * np.sqrt(((r * problem.noise_ratio[..., None]) ** 2).mean(axis=(1, 2))),
    )
    scale = np.repeat([1.0, 1.0, problem.noise], 3) if problem.field is None else np.ones(6)
    sd = np.zeros((n, 9))
    sd[:, : A.shape[2]] = np.sqrt(variance) * np.maximum(1.0, misfit)[:, None] * scale
    sd[:, :3] = (
        np.where(rival > 5 * np.linalg.norm(sd[:, :3], axis=1), rival, 0.0)[:, None] + sd[:, :3]
    )
    return x[best], sd, residual_rms, misfit, size_deviation
