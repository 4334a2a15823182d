"""Power and work that fingertips exchange with what they hold.

In      forces (n, S, 3) N that the fingertips exert and velocities (n, S, 3) m/s of the places where they touch, in one frame; with a six-axis sensor torques
        (n, S, 3) Nm about those places and angular rates (n, S, 3) rad/s as well
Out     power (n,) W into the object, work (n,) J since the first instant
Source  Kortier, thesis (1.15): P = F'v + M'w, integrated. Of an object of mass m that is held alone, F = m (g + a): from rest to height h at the speed v the
        forces do m g h + m v^2 / 2, whichever way it takes; what they do along the horizontal is part of it
"""

import numpy as np

from handscope.estimators.numerics.typing import Array


def exchange_power(
    forces: Array, velocities: Array, torques: Array | None = None, rates: Array | None = None
) -> Array:
    """Summed over the fingertips; without torques that of the forces alone."""
    total = (forces * velocities).sum(axis=(1, 2))
    return np.asarray(
        total if torques is None or rates is None else total + rotational_power(torques, rates)
    )


def rotational_power(torques: Array, rates: Array) -> Array:
    """The part M'w of the torques alone, summed over the fingertips."""
    return np.asarray((torques * rates).sum(axis=(1, 2)))


def integrate_power(t: Array, watts: Array) -> Array:
    """By trapezoids."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (watts[1:] + watts[:-1]) * np.diff(t))])
