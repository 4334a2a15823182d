"""What is declared before a magnet is tracked: magnetometers on the trunk and the magnet on the
hand.

Frames  base b: inertial sensor on the trunk; target t: inertial sensor on the hand; each
        magnetometer has its own axes l
Source  Kortier, thesis 5.2, Fig. 5.2
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

WIDEST, CLOSEST = 1.0, 0.004  # m between two magnetometers on one trunk
FARTHEST = 1.5  # m of a magnetometer from the base's inertial sensor
STRONGEST, WEAKEST = 20.0, 1e-3  # A m^2: 15 cm^3 of neodymium; invisible beyond some cm
LARGEST_OFFSET = 0.3  # m of the magnet from the hand's inertial sensor
# T: 22 to 67 uT on Earth (IGRF-13), more or less in a building
EARTH_WEAKEST, EARTH_STRONGEST = 15e-6, 90e-6


@dataclass(frozen=True)
class Constellation:
    """Magnetometers that are fixed on the base."""

    places: Array  # (magnetometers, 3) m, base frame
    q_bl: Array  # (magnetometers, 4) from each magnetometer's axes to the base's

    def __len__(self) -> int:
        return len(self.places)


@dataclass(frozen=True)
class Magnet:
    """A magnet that is fixed on the target."""

    moment: Array  # (3,) A m^2, target frame
    place: Array  # (3,) m, target frame

    @property
    def size(self) -> float:
        return float(np.linalg.norm(self.moment))


def make_constellation(places: Array, q_bl: Array | None = None) -> Constellation:
    """Magnetometers at places (magnetometers, 3) in m; InputError where they cannot be metres on a
    trunk."""
    where = np.atleast_2d(np.asarray(places, float))
    if where.ndim != 2 or where.shape[1] != 3 or not np.isfinite(where).all():
        raise InputError(
            f"The constellation must be finite places (magnetometers, 3) in metres, it is an array of shape {where.shape}."
        )
    apart = np.linalg.norm(where[:, None] - where[None], axis=-1)[~np.eye(len(where), dtype=bool)]
    away = float(np.linalg.norm(where, axis=1).max())
    if away > FARTHEST or (len(apart) and apart.max() > WIDEST):
        largest = max(away, float(apart.max(initial=0.0)))
        raise InputError(
            f"The constellation spans {largest:g} m: no trunk is that large. Places are in metres; were these millimetres or centimetres? Correct the places in MagnetSetup."
        )
    if len(apart) and apart.min() < CLOSEST:
        raise InputError(
            f"Two magnetometers of the constellation are {1e3 * apart.min():g} mm apart. Places are in metres; is one listed twice, or is the unit another?"
        )
    turned = np.tile(quat.IDENTITY, (len(where), 1)) if q_bl is None else np.asarray(q_bl, float)
    if turned.shape != (len(where), 4) or not np.allclose(
        np.linalg.norm(turned, axis=-1), 1.0, atol=1e-3
    ):
        raise InputError(
            f"The magnetometers' orientations must be {len(where)} unit quaternions [w, x, y, z], one a magnetometer."
        )
    return Constellation(where, quat.normalize(turned))


def make_magnet(moment: Array, place: Array | None = None) -> Magnet:
    """A magnet of moment (3,) A m^2 at place (3,) m of the target; InputError where it cannot be a
    magnet on a hand."""
    m, p = np.asarray(moment, float), np.zeros(3) if place is None else np.asarray(place, float)
    if m.shape != (3,) or p.shape != (3,) or not (np.isfinite(m).all() and np.isfinite(p).all()):
        raise InputError(
            "The magnet's moment and place must be three finite numbers each, A m^2 and m in the axes of the hand's sensor."
        )
    size, away = float(np.linalg.norm(m)), float(np.linalg.norm(p))
    if not WEAKEST <= size <= STRONGEST:
        raise InputError(
            f"A moment of {size:g} A m^2 is no magnet for a hand ({WEAKEST:g} to {STRONGEST:g}); a neodymium disc has about 1 A m^2 a cm^3."
        )
    if away > LARGEST_OFFSET:
        raise InputError(
            f"The magnet is said to be {away:g} m from the hand's sensor: too far for a hand. Places are in metres."
        )
    return Magnet(m, p)


def require_field(mag: Array) -> None:
    """InputError unless readings (n, magnetometers, 3) can be T: the median of an array on a trunk
    is about the earth's field."""
    sizes = np.linalg.norm(mag, axis=-1)
    sizes = sizes[np.isfinite(sizes)]
    if not len(sizes):
        raise InputError(
            "No magnetometer gave a single reading: check that the array is connected."
        )
    middle = float(np.median(sizes))
    if 0.1 < middle < 10.0:
        raise InputError(
            f"The magnetometers read {middle:.3g} on average: that is a field normalised to 1, not T. Multiply it by the strength of the earth's field where it was calibrated."
        )
    if not 1e-6 < middle < 5e-3:
        raise InputError(
            f"The magnetometers read {middle:.3g} T on average; the earth's field is about 5e-5 T. Is the unit uT, mG or G?"
        )
