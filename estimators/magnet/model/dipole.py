"""The field of a permanent magnet that is small against its distance, with its derivatives.

In      r between magnet and position, m (the field is even in r); moment, A m^2; one frame
Out     flux density in T; its derivatives by r (T/m) and by the moment (T / (A m^2))
Source  Kortier, thesis ch. 5, (5.7), (5.8), (5.24); his moment is mu0 / 4 pi times ours
Limits  not a dipole within about two lengths of the magnet (rod of 2 mm, 14 mm across: some percent
        off at 4 cm)
"""

import numpy as np

from handscope.estimators.numerics.constants import MU0_4PI
from handscope.estimators.numerics.typing import Array


def field(r: Array, moment: Array) -> Array:
    """J(r) m (..., 3) in T. (5.7)"""
    square = (r * r).sum(axis=-1, keepdims=True)
    along = (r * moment).sum(axis=-1, keepdims=True)
    return np.asarray(MU0_4PI * (3 * along * r - square * moment) / square**2.5)


def field_by_moment(r: Array) -> Array:
    """J(r) (..., 3, 3): symmetric. (5.8)"""
    square = (r * r).sum(axis=-1)[..., None, None]
    return np.asarray(
        MU0_4PI * (3 * r[..., :, None] * r[..., None, :] - square * np.eye(3)) / square**2.5
    )


def field_gradient(r: Array, moment: Array) -> Array:
    """d(J(r) m)/dr (..., 3, 3): symmetric and without trace. (5.24)"""
    square = (r * r).sum(axis=-1)[..., None, None]
    along = (r * moment).sum(axis=-1)[..., None, None]
    rr, rm = r[..., :, None] * r[..., None, :], r[..., :, None] * moment[..., None, :]
    return np.asarray(
        3
        * MU0_4PI
        * (along * np.eye(3) + rm + np.swapaxes(rm, -1, -2) - 5 * along * rr / square)
        / square**2.5
    )
