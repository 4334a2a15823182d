"""Whether the field around a magnet changes across the array: what one magnet in an even field leaves is noise, or has the shape of a field that varies linearly.

In      readings with the magnet that explains them best (magnet_fit.py); a field without curl and divergence has five slopes
Out     Uneven: probability that noise alone would look so much like slopes, and how large they are; by how much slopes misplace the magnet
Source  F test of nested models (Seber & Wild, Nonlinear regression, 1989, 5.3), linear around the fit, over many readings. Errors of calibrations and of places are
        the same in all of them, so that all together have no more degrees of freedom than one
Limits  with fewer than seven magnetometers too little is left over to tell; iron near the array bends the field more than linearly
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution

from handscope.estimators.magnet.array.dipole_fit import SLOPES, Told, linear, residuals
from handscope.estimators.numerics.typing import Array

FEWEST = 7  # magnetometers: seven axes above the unknowns of magnet, field and slopes
CHANCE = 0.01  # below which errors that are everywhere the same hardly look so; slopes that are none only cost certainty


@dataclass(frozen=True)
class Uneven:
    chance: float
    size: float  # T/m, standard deviation of each of the five slopes


def uneven(told: Told, x: Array) -> Uneven:
    """Of readings with unknowns x (n, 9); the noise need not be known."""
    off, A = residuals(x, told)
    spare = off.shape[1] - A.shape[2] - SLOPES
    if len(told.places) < FEWEST:
        return Uneven(1.0, 0.0)
    Q, _ = np.linalg.qr(A)
    U, s, _ = np.linalg.svd(_across(Q, _slopes(told, off.shape[1])), full_matrices=False)
    left = _across(Q, off[..., None])
    explained = float(((np.swapaxes(U, 1, 2) @ left) ** 2).sum())
    rest = (float((left**2).sum()) - explained) / (len(x) * spare)
    chance = float(
        f_distribution.sf(explained / (len(x) * SLOPES) / max(rest, 1e-12), SLOPES, spare)
    )
    square = (explained - len(x) * SLOPES * rest) / max(float((s**2).sum()), 1e-12)
    return Uneven(chance, float(np.sqrt(max(square, 0.0))))


def misplaced(told: Told, x: Array, size: float) -> Array:
    """How far (n,) m a field that changes by `size` T/m in some direction draws the place, if it is not counted."""
    off, A = residuals(x, told)
    drawn = (np.linalg.pinv(A) @ _slopes(told, off.shape[1]))[:, :3]
    return np.asarray(slope_of(size) * np.sqrt((drawn**2).sum(axis=(1, 2))))


def slope_of(change: float) -> float:
    """Standard deviation of each of the five slopes of a field that changes by so many T/m (RMS over directions)."""
    return float(change * np.sqrt(3.0 / SLOPES))


def change_of(slope: float) -> float:
    """The inverse."""
    return float(slope * np.sqrt(SLOPES / 3.0))


def _slopes(told: Told, rows: int) -> Array:
    """What slopes of 1 T/m add to whitened residuals (n, rows, 5); nothing to the row of a moment that is told."""
    noise = told.noise * told.louder[..., None, None]
    added = told.evenly((linear(told.places) / noise).reshape(len(told.y), -1, SLOPES))
    return np.pad(added, ((0, 0), (0, rows - added.shape[1]), (0, 0)))


def _across(Q: Array, values: Array) -> Array:
    """Without the part that the unknowns can take up."""
    return np.asarray(values - Q @ (np.swapaxes(Q, 1, 2) @ values))
