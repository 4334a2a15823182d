"""Where a magnet is, reading by reading, from an array of magnetometers alone: no inertial sensor, no past.

In      readings of several magnetometers (n, magnetometers, 3), T; where they sit; the field without the magnet, or nothing of it; the moment's size, or nothing
Out     Located: place and moment of the magnet in the base's frame with standard deviations, the field without it, what is left unexplained
Source  Kortier, thesis ch. 5, (5.7), (5.8); for a given place moment and field are linear (Golub & Pereyra 1973, SIAM J Numer Anal 10:413): a grid of
        places is searched so, then Levenberg-Marquardt from the best ones, all readings at once
Limits  with an unknown field three magnetometers at least, with a known one two; the field must be the same at all of them. Where as much is unknown as
        is read (three magnetometers, or two in a known field, and no size told) several places explain a reading exactly, and nothing is found
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.magnet.array.dipole_fit import (
    ROUNDS,
    Told,
    by_places,
    improved,
    residuals,
    starts,
)
from handscope.estimators.magnet.model.setup import Constellation, require_field
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Bools

REGIONS = 2  # along each edge: the best place of every octant around the array is a start
AMBIGUOUS = (
    12.0  # a second place whose cost is less than this above the best one's cannot be ruled out
)
STRAIGHT = 0.05  # of the distance: a place less sure than this lies where the field bends, and standard deviations from its slope say nothing
SURE = 0.05  # m
FIRST = 12  # rounds of all starts, where errors of the magnetometers' places count
SAME, KEPT = (
    1e-3,
    8,
)  # m between places that are the same; places of a reading that are improved further
PIECE = 4096  # readings at once


@dataclass(frozen=True)
class Located:
    place: Array  # (n, 3) m, base frame; NaN where readings are missing
    moment: Array  # (n, 3) A m^2, base frame
    field: Array  # (n, 3) T, base frame: without the magnet
    place_sd: Array  # (n, 3) m
    moment_sd: Array  # (n, 3) A m^2
    left: Array  # (n,) RMS of what is left, T
    misfit: Array  # (n,) the same in standard deviations of readings, errors of the magnetometers' places counted
    disputed: Bools  # (n,) the size told is off by more than three of its standard deviations
    found: Bools  # (n,) explained to within `worst` of them, and known better than `sure`


def located(
    mag: Array,
    array: Constellation,
    field: Array | None = None,
    size: float | None = None,
    noise: float = 0.5e-6,
    reach: float = 0.5,
    sure: float = SURE,
    size_sd: float = 1e-3,
    regions: int = REGIONS,
    place_sd: float = 0.0,
    worst: float = 3.0,
    uneven: float = 0.0,
) -> Located:
    """The magnet at every reading; `field` (3,) or (n, 3) T in the base's frame, `size` of the moment in A m^2, noise T of an axis, reach m, sure m,
    `size_sd` as a share of the size, `place_sd` m of a magnetometer's place. What is left
    is `worst` standard deviations (RMS) at most. `uneven` T/m are the slopes of the field (magnet_uneven.py). More `regions` find more of the places that explain a reading as well."""
    if mag.ndim != 3 or mag.shape[1:] != (len(array), 3):
        raise InputError(
            f"Readings must be (n, {len(array)}, 3) for this constellation, they are {mag.shape}."
        )
    require_field(mag)
    unknowns, told = 6 + 3 * (field is None), 3 * len(array) + (size is not None)
    if told < unknowns:
        raise InputError(
            f"{len(array)} magnetometer{'s' * (len(array) > 1)} cannot tell place, moment and field of a magnet together: "
            "tell the field without the magnet and the moment's size, or use the tracker with inertial sensors."
        )
    y = quat.rotate(array.q_bl, mag)
    background = (
        np.full((len(y), 3), np.nan) if field is None else np.broadcast_to(field, (len(y), 3))
    )
    good = np.isfinite(y).all(axis=(1, 2)) & (np.isfinite(background).all(axis=1) | (field is None))
    out = *np.full((2, len(y), 9), np.nan), *np.full((2, len(y)), np.nan), np.zeros(len(y))
    rows = np.flatnonzero(good)
    for part in np.array_split(rows, max(1, -(-len(rows) // PIECE))):
        known, alike = None if field is None else background[part], np.ones((len(part), len(array)))
        told_here = Told(
            y[part], array.places, known, size, noise, size_sd, alike, uneven
        ).with_louder(alike)
        values = _solved(told_here, reach, regions, place_sd) if len(part) else ()
        for whole, piece in zip(out, values):
            whole[part] = piece
    x, sd, left, misfit, dispute = out
    found = (
        (told > unknowns)
        & np.isfinite(misfit)
        & (misfit < worst)
        & (sd[:, :3].max(axis=1) < surest(x[:, :3], array, sure))
    )
    return Located(
        x[:, :3],
        x[:, 3:6],
        x[:, 6:] if field is None else background.copy(),
        sd[:, :3],
        sd[:, 3:6],
        left,
        misfit,
        dispute >= 3,
        found,
    )


def surest(place: Array, array: Constellation, sure: float = SURE) -> Array:
    """Standard deviations (n,) m that places (n, 3) may have."""
    return np.asarray(
        np.minimum(
            sure, STRAIGHT * np.linalg.norm(place[:, None] - array.places, axis=-1).min(axis=1)
        )
    )


def _apart(x: Array, cost: Array) -> tuple[Array, Array, int]:
    """Of the places that starts (n, many, 9) led to those with the lowest cost, each once; how many of each reading."""
    order = cost.argsort(axis=1)
    x, cost = (
        np.take_along_axis(x, order[..., None], axis=1),
        np.take_along_axis(cost, order, axis=1),
    )
    near = np.linalg.norm(x[:, :, None, :3] - x[:, None, :, :3], axis=-1) < SAME
    again = (near & np.tri(x.shape[1], k=-1, dtype=bool)).any(axis=2)
    kept = np.argsort(again, axis=1, kind="stable")[:, :KEPT]
    x, cost = np.take_along_axis(x, kept[..., None], axis=1), np.take_along_axis(cost, kept, axis=1)
    return x.reshape(-1, 9), cost.reshape(-1), kept.shape[1]


def noise_left(found: Located, many: int) -> float:
    """Standard deviation of readings of `many` magnetometers, T, by what places leave of them (nine unknowns explain a part): the noise, and what places and
    calibrations are off by, whatever the magnet does between one reading and the next."""
    left = found.left[np.isfinite(found.left)]
    return (
        float(np.median(left)) * float(np.sqrt(3 * many / (3 * many - 9))) if len(left) else np.inf
    )


def _solved(
    told: Told, reach: float, regions: int, place_sd: float
) -> tuple[Array, Array, Array, Array, Array]:
    """Values (n, 9), their standard deviations, RMS left (n,) in T and in standard deviations, by how many of its own the size told is off (n,)."""
    begun = starts(told, reach, regions)  # (n, many, 9)
    n, many = begun.shape[:2]
    x, cost = improved(
        begun.reshape(n * many, 9), told.repeated(many), ROUNDS if place_sd == 0 else FIRST
    )
    if place_sd > 0:
        x, cost, many = _apart(x.reshape(n, many, 9), cost.reshape(n, many))
        x, cost = improved(x, told.repeated(many))
        best = np.arange(n) * many + cost.reshape(n, many).argmin(axis=1)
        told = told.with_louder(by_places(x[best], told, place_sd))
        x, cost = improved(x, told.repeated(many))
    cost = cost.reshape(n, many)
    best = np.arange(n) * many + cost.argmin(axis=1)
    apart = np.linalg.norm(x.reshape(n, many, 9)[..., :3] - x[best, None, :3], axis=-1)
    rival = np.where(cost < cost.min(axis=1, keepdims=True) + AMBIGUOUS, apart, 0.0).max(axis=1)
    r, A = residuals(x[best], told)
    _, s, Vt = np.linalg.svd(A, full_matrices=False)
    variance = (Vt**2 / np.maximum(s, 1e-9)[..., None] ** 2).sum(axis=1)
    dispute = np.zeros(n) if told.size is None else np.abs(r[:, -1])
    r = r[:, : told.y[0].size].reshape(told.y.shape)
    misfit, left = (
        np.sqrt((r**2).mean(axis=(1, 2))),
        told.noise * np.sqrt(((r * told.louder[..., None]) ** 2).mean(axis=(1, 2))),
    )
    scale = np.repeat([1.0, 1.0, told.noise], 3) if told.field is None else np.ones(6)
    sd = np.zeros((n, 9))
    sd[:, : A.shape[2]] = np.sqrt(variance) * np.maximum(1.0, misfit)[:, None] * scale
    sd[:, :3] = (
        np.where(rival > 5 * np.linalg.norm(sd[:, :3], axis=1), rival, 0.0)[:, None] + sd[:, :3]
    )
    return x[best], sd, left, misfit, dispute
