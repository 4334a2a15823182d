"""Localisation of a magnet throughout a recording of an array, with tests of what contradicts one
magnet in a homogeneous field.

In      readings (n, magnetometers, 3), T, with times; positions of the magnetometers; noise
        estimated from differences
Out     LocalisationResult: positions without those that are not to be trusted, and why; the noise
        from residuals
Source  localisation.py, second_magnet_test.py, field_gradient_test.py, timestamp_offsets.py,
        systematic_errors.py
Limits  eight magnetometers or more separate a second magnet or iron from noise; fewer only where it
        leaves more than noise
"""

from dataclasses import dataclass, fields, replace

import numpy as np

from handscope.estimators.magnet.array import localisation as magnet_localisation
from handscope.estimators.magnet.array import (
    timestamp_offsets,
)
from handscope.estimators.magnet.array.dipole_fit import (
    GRADIENT_TERMS,
    DipoleFitProblem,
    noise_ratio_of_places,
)
from handscope.estimators.magnet.array.localisation import Localisation
from handscope.estimators.magnet.model.setup import Constellation
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Indices

UNKNOWNS = 9  # position, moment, field
MISFIT_PER_DOF = 1.7  # standard deviations a degree of freedom
FEW_MAGNETOMETERS, MANY_REGIONS = 9, 3  # so few magnetometers are explained by several positions


@dataclass(frozen=True)
class Search:
    """Calibrated readings and their magnetometers."""

    t: Array  # (n,) s
    mag: Array  # (n, magnetometers, 3) T
    array: Constellation
    noise: float  # T
    place_sd: float  # m
    gradient_sd: float = 0.0  # T/m, of each gradient of the field
    rate: Array | None = None  # (n, magnetometers, 3) T/s, rate of change of readings

    def select(self, rows: Indices) -> "Search":
        return replace(
            self,
            t=self.t[rows],
            mag=self.mag[rows],
            rate=None if self.rate is None else self.rate[rows],
        )

    def of_magnetometers(self, chips: Indices) -> "Search":
        array = Constellation(self.array.places[chips], self.array.q_bl[chips])
        return replace(
            self,
            mag=self.mag[:, chips],
            array=array,
            rate=None if self.rate is None else self.rate[:, chips],
        )

    def with_offsets(self, offsets: Array) -> "Search":
        """With readings of magnetometers shifted by their timestamp offsets (magnetometers,) s."""
        mag = timestamp_offsets.shift_readings(self.t, self.mag, offsets)
        return replace(self, mag=mag, rate=timestamp_offsets.change_rates(self.t, mag))

    def group_by_available(self) -> list[tuple[Indices, Indices]]:
        """Rows with the same magnetometers answering, and which."""
        patterns, pattern = np.unique(
            np.isfinite(self.mag).all(axis=2), axis=0, return_inverse=True
        )
        return [
            (np.flatnonzero(pattern.ravel() == k), np.flatnonzero(answered))
            for k, answered in enumerate(patterns)
        ]

    def locate(self, size: float | None, size_sd: float) -> Localisation:
        """Positions that agree with the declared size of the moment, by the magnetometers that
        answer."""
        out = _empty_localisation(len(self.t))
        for rows, chips in self.group_by_available():
            if len(chips) < len(self.array) and 3 * len(chips) + (size is not None) <= UNKNOWNS:
                continue
            part = self.select(rows).of_magnetometers(chips)._locate(size, size_sd)
            for field in fields(Localisation):
                getattr(out, field.name)[rows] = getattr(part, field.name)
        return out

    def _locate(self, size: float | None, size_sd: float) -> Localisation:
        regions = (
            MANY_REGIONS if len(self.array) <= FEW_MAGNETOMETERS else magnet_localisation.REGIONS
        )
        max_misfit = float(misfit_limit(len(self.array), self.gradient_sd))
        options = {
            "size_sd": size_sd,
            "place_sd": self.place_sd,
            "max_misfit": max_misfit,
            "gradient_sd": self.gradient_sd,
        }
        localisation = magnet_localisation.locate(
            self.mag, self.array, None, size, self.noise, regions=regions, **options
        )
        return replace(
            localisation, is_located=localisation.is_located & ~localisation.contradicts_size
        )


def misfit_limit(many: int | Indices, gradient_sd: float = 0.0) -> Array:
    """Largest RMS residual of so many magnetometers, standard deviations: the unknowns and the
    gradients explain a part, the more the fewer there are."""
    axes = np.maximum(3.0 * np.asarray(many), 1.0)
    return np.asarray(
        MISFIT_PER_DOF
        * np.sqrt(np.maximum(axes - UNKNOWNS - GRADIENT_TERMS * (gradient_sd > 0), 1.0) / axes)
    )


def _empty_localisation(n: int) -> Localisation:
    place, moment, field, place_sd, moment_sd = np.full((5, n, 3), np.nan)
    left, misfit = np.full((2, n), np.nan)
    return Localisation(
        place,
        moment,
        field,
        place_sd,
        moment_sd,
        left,
        misfit,
        np.zeros(n, bool),
        np.zeros(n, bool),
    )


def build_problem(
    search: Search,
    localisation: Localisation,
    size: float | None,
    size_sd: float,
    rows: Indices,
) -> tuple[DipoleFitProblem, Array]:
    """The fit problem of localised readings, by the magnetometers that answer in all of them, and
    their unknowns (n, 9)."""
    x = np.concatenate([localisation.place, localisation.moment, localisation.field], axis=1)[rows]
    y, ones = (
        quat.rotate(search.array.q_bl, search.mag[rows]),
        np.ones((len(rows), len(search.array))),
    )
    problem = DipoleFitProblem(
        y, search.array.places, None, size, search.noise, size_sd, ones, search.gradient_sd
    )
    problem = (
        problem
        if search.rate is None
        else replace(problem, rate=quat.rotate(search.array.q_bl, search.rate[rows]))
    )
    return problem.with_noise_ratio(noise_ratio_of_places(x, problem, search.place_sd)), x
