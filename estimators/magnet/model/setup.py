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
        raise InputError("magnet.constellation_shape", shape=str(where.shape))
    distances = np.linalg.norm(where[:, None] - where[None], axis=-1)[
        ~np.eye(len(where), dtype=bool)
    ]
    away = float(np.linalg.norm(where, axis=1).max())
    if away > FARTHEST or (len(distances) and distances.max() > WIDEST):
        largest = max(away, float(distances.max(initial=0.0)))
        raise InputError("magnet.constellation_too_large", size=largest)
    if len(distances) and distances.min() < CLOSEST:
        raise InputError("magnet.magnetometers_too_close", distance=1000.0 * distances.min())
    turned = np.tile(quat.IDENTITY, (len(where), 1)) if q_bl is None else np.asarray(q_bl, float)
    if turned.shape != (len(where), 4) or not np.allclose(
        np.linalg.norm(turned, axis=-1), 1.0, atol=1e-3
    ):
        raise InputError("magnet.orientations_not_unit", count=len(where))
    return Constellation(where, quat.normalize(turned))


def make_magnet(moment: Array, place: Array | None = None) -> Magnet:
    """A magnet of moment (3,) A m^2 at place (3,) m of the target; InputError where it cannot be a
    magnet on a hand."""
    m, p = np.asarray(moment, float), np.zeros(3) if place is None else np.asarray(place, float)
    if m.shape != (3,) or p.shape != (3,) or not (np.isfinite(m).all() and np.isfinite(p).all()):
        raise InputError("magnet.magnet_not_finite")
    size, away = float(np.linalg.norm(m)), float(np.linalg.norm(p))
    if not WEAKEST <= size <= STRONGEST:
        raise InputError("magnet.moment_outside", size=size, least=WEAKEST, most=STRONGEST)
    if away > LARGEST_OFFSET:
        raise InputError("magnet.magnet_said_m_hand", away=away)
    return Magnet(m, p)


def require_field(mag: Array) -> None:
    """InputError unless readings (n, magnetometers, 3) can be T: the median of an array on a trunk
    is about the earth's field."""
    sizes = np.linalg.norm(mag, axis=-1)
    sizes = sizes[np.isfinite(sizes)]
    if not len(sizes):
        raise InputError("magnet.no_readings")
    middle = float(np.median(sizes))
    if 0.1 < middle < 10.0:
        raise InputError("magnet.field_of_magnet", strength=middle)
    if not 1e-6 < middle < 5e-3:
        raise InputError("magnet.field_implausible", strength=middle)
