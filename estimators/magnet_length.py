"""What the length of a magnet does to a place that was found as if it had none: a rod or a disc near the array is no dipole.

In      readings with the dipole that explains them best (magnet_fit.py)
Out     whether readings show it; how far each place is drawn by it
Source  a rod of length 2 a is a line of dipoles: to second order its field is B + a^2/6 (u.grad)^2 B, u along the moment, and a disc's has the other sign
        (Jackson, Classical electrodynamics, 4.1); F test of nested models, linear around the fit, one length for all readings. Errors of calibrations and of places
        are the same in all of them, so that all together have no more degrees of freedom than one
Limits  to second order: further off than twice the magnet's half length
"""

import numpy as np
from scipy.stats import f as f_distribution

from estimators import dipole
from estimators.magnet_fit import OF_ONE, Told, residuals
from estimators.quaternions import Array

CHANCE = 0.01  # below which errors that are everywhere the same hardly look so; a length that is none only costs certainty
STEP = 1e-3  # m


def shown(told: Told, x: Array) -> float:
    """a^2 / 6 of the magnet, m^2, that readings with unknowns x (n, 9) show; 0: none."""
    off, A = residuals(x, told)
    spare = off.shape[1] - A.shape[2] - 1
    if spare < 1:
        return 0.0
    Q, _ = np.linalg.qr(A)
    left, added = (values - Q @ (np.swapaxes(Q, 1, 2) @ values) for values in (off[..., None], _lengthened(x, told, off.shape[1])))
    square = float((added**2).sum())
    length = float((added * left).sum()) / max(square, 1e-30)
    explained = length**2 * square
    rest = (float((left**2).sum()) - explained) / spare
    return length if f_distribution.sf(explained / max(rest, 1e-12), 1, spare) < CHANCE else 0.0


def drawn(told: Told, x: Array, length: float) -> Array:
    """By how much (n, 6) place and moment of unknowns x (n, 9) are drawn by it."""
    _, A = residuals(x, told)
    return np.asarray((np.linalg.pinv(A) @ _lengthened(x, told, A.shape[1]))[:, :OF_ONE, 0] * length)


def _lengthened(x: Array, told: Told, rows: int) -> Array:
    """What a^2 / 6 of 1 m^2 adds to whitened residuals (n, rows, 1)."""
    r, m = x[:, None, :3] - told.places, x[:, None, 3:OF_ONE]
    along = STEP * m / np.maximum(np.linalg.norm(m, axis=-1, keepdims=True), 1e-12)
    bent = (dipole.field(r + along, m) + dipole.field(r - along, m) - 2 * dipole.field(r, m)) / STEP**2
    added = told.evenly((bent / (told.noise * told.louder[..., None])).reshape(len(x), -1, 1))
    return np.pad(added, ((0, 0), (0, rows - added.shape[1]), (0, 0)))
