"""Whether readings of an array are those of two magnets rather than of one: what one magnet leaves is either noise or looks like another one.

In      readings, the magnet that explains them best (magnet_localisation.py), all in the base's frame
Out     probability that noise alone would be explained so much better by a second magnet, and where that then is
Source  F test of nested models (Seber & Wild, Nonlinear regression, 1989, 5.3), which needs no size of the noise; the search as in magnet_fit.py
Limits  with fewer than eight magnetometers too little is left over to tell; iron, and a magnet that is long against its distance, look like a second one, too
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution

from handscope.estimators.magnet.array.dipole_fit import (
    OF_ONE,
    SLOPES,
    Told,
    by_places,
    improved,
    residuals,
    starts,
)
from handscope.estimators.magnet.array.localisation import Located
from handscope.estimators.magnet.model import dipole
from handscope.estimators.magnet.model.setup import Constellation
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

FEWEST = 8  # magnetometers: nine axes above the unknowns of two magnets and the field
ROUNDS = 15
REACH = 0.5  # m around the array in which a second magnet is looked for


@dataclass(frozen=True)
class Second:
    chance: (
        Array  # (n,) that noise alone would be explained so much better; NaN where nothing is known
    )
    place: Array  # (n, 3) m, base frame


def second(
    mag: Array,
    array: Constellation,
    found: Located,
    noise: float,
    place_sd: float,
    size: float | None = None,
    size_sd: float = 1e-3,
    uneven: float = 0.0,
) -> Second:
    """Of readings (n, magnetometers, 3), T, in which `found` is the one magnet, in a field that nobody told; the rest as told to `located`."""
    out = Second(np.full(len(mag), np.nan), np.full((len(mag), 3), np.nan))
    rows = np.flatnonzero(np.isfinite(found.misfit))
    if len(array) < FEWEST or not len(rows):
        return out
    one = np.concatenate([found.place, found.moment, found.field], axis=1)[rows]
    told = Told(
        quat.rotate(array.q_bl, mag[rows]),
        array.places,
        None,
        size,
        noise,
        size_sd,
        np.ones((len(rows), len(array))),
        uneven,
    )
    told = told.with_louder(by_places(one, told, place_sd))
    left = (
        told.y
        - one[:, None, OF_ONE:]
        - dipole.field(one[:, None, :3] - told.places, one[:, None, 3:OF_ONE])
    )
    other = starts(Told(left, told.places, None, None, noise, size_sd, told.louder), REACH, 1)[:, 0]
    both, with_two = improved(
        np.concatenate(
            [one[:, :OF_ONE], other[:, :OF_ONE], one[:, OF_ONE:] + other[:, OF_ONE:]], axis=1
        ),
        told,
        ROUNDS,
    )
    off, A = residuals(one, told)
    with_one, spare = (
        (off**2).sum(axis=1),
        max(1, off.shape[1] - A.shape[2] - OF_ONE - SLOPES * (uneven > 0)),
    )
    better = (with_one - with_two) / OF_ONE / np.maximum(with_two / spare, 1e-12)
    out.chance[rows], out.place[rows] = (
        f_distribution.sf(better, OF_ONE, spare),
        both[:, OF_ONE : OF_ONE + 3],
    )
    return out
