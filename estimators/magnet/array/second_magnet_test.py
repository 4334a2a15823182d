"""F test for a second magnet: the residuals of one magnet are noise, or look like another one.

In      readings and the magnet that fits them best (localisation.py), in the base's frame
Out     p value of one magnet against two, and the second one's position
Source  F test of nested models (Seber & Wild, Nonlinear regression, 1989, 5.3), which needs no
        noise level; the search as in dipole_fit.py
Limits  fewer than eight magnetometers leave too few degrees of freedom; iron, or a magnet long
        against its distance, looks like a second one
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.magnet.array.dipole_fit import (
    GRADIENT_TERMS,
    PER_MAGNET,
    DipoleFitProblem,
    compute_residuals,
    grid_starts,
    noise_ratio_of_places,
    refine,
)
from handscope.estimators.magnet.array.localisation import Localisation
from handscope.estimators.magnet.model import dipole
from handscope.estimators.magnet.model.setup import Constellation
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.tail_probabilities import f_sf
from handscope.estimators.numerics.typing import Array

MIN_MAGNETOMETERS = 8  # magnetometers: nine degrees of freedom beyond two magnets and the field
ROUNDS = 15
REACH = 0.5  # m around the array, for the second magnet


@dataclass(frozen=True)
class SecondMagnetTest:
    """p value of the test, and where the second magnet would be, m."""

    p_value: Array  # (n,); NaN where nothing is known
    place: Array  # (n, 3) m, base frame


def second_magnet_f_test(
    mag: Array,
    array: Constellation,
    localisation: Localisation,
    noise: float,
    place_sd: float,
    size: float | None = None,
    size_sd: float = 1e-3,
    gradient_sd: float = 0.0,
) -> SecondMagnetTest:
    """Test readings (n, magnetometers, 3), T, explained by `localisation` in an unknown field;
    other arguments as of `locate`."""
    out = SecondMagnetTest(np.full(len(mag), np.nan), np.full((len(mag), 3), np.nan))
    rows = np.flatnonzero(np.isfinite(localisation.misfit))
    if len(array) < MIN_MAGNETOMETERS or not len(rows):
        return out
    one = np.concatenate([localisation.place, localisation.moment, localisation.field], axis=1)[
        rows
    ]
    problem = DipoleFitProblem(
        quat.rotate(array.q_bl, mag[rows]),
        array.places,
        None,
        size,
        noise,
        size_sd,
        np.ones((len(rows), len(array))),
        gradient_sd,
    )
    problem = problem.with_noise_ratio(noise_ratio_of_places(one, problem, place_sd))
    remaining = (
        problem.y
        - one[:, None, PER_MAGNET:]
        - dipole.field(one[:, None, :3] - problem.places, one[:, None, 3:PER_MAGNET])
    )
    other = grid_starts(
        DipoleFitProblem(
            remaining, problem.places, None, None, noise, size_sd, problem.noise_ratio
        ),
        REACH,
        1,
    )[:, 0]
    both, with_two = refine(
        np.concatenate(
            [
                one[:, :PER_MAGNET],
                other[:, :PER_MAGNET],
                one[:, PER_MAGNET:] + other[:, PER_MAGNET:],
            ],
            axis=1,
        ),
        problem,
        ROUNDS,
    )
    residual, A = compute_residuals(one, problem)
    with_one, spare = (
        (residual**2).sum(axis=1),
        max(1, residual.shape[1] - A.shape[2] - PER_MAGNET - GRADIENT_TERMS * (gradient_sd > 0)),
    )
    better = (with_one - with_two) / PER_MAGNET / np.maximum(with_two / spare, 1e-12)
    out.p_value[rows], out.place[rows] = (
        f_sf(better, PER_MAGNET, spare),
        both[:, PER_MAGNET : PER_MAGNET + 3],
    )
    return out
