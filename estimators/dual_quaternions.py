"""Unit dual quaternions: a rotation and a translation in one product.

Convention  Q_ab = [q_r, q_d] as one array (..., 8), real part first; takes points from frame b to frame a
Source      Salchow-Hoemmen 2019, 2.3, (7)-(16), after Leclercq et al. 2013
"""

import numpy as np

from estimators import quaternions as quat
from estimators.quaternions import Array


def rotation(q_ab: Array) -> Array:
    """Pure rotation: (..., 4) -> (..., 8). (14)"""
    return np.concatenate([q_ab, np.zeros_like(q_ab)], axis=-1)


def translation(p_a: Array) -> Array:
    """Pure translation by p (..., 3) in metres: (..., 8). (15)"""
    Q = np.zeros((*p_a.shape[:-1], 8))
    Q[..., 0] = 1.0
    Q[..., 5:] = 0.5 * p_a
    return Q


def link(q_ab: Array, p_b: Array) -> Array:
    """A rotation and behind it a translation by p_b (..., 3) in the turned frame, (14) times (15): (..., 8)."""
    q_r = np.broadcast_to(q_ab, (*np.broadcast_shapes(q_ab.shape[:-1], p_b.shape[:-1]), 4))
    half = np.concatenate([np.zeros((*p_b.shape[:-1], 1)), 0.5 * p_b], axis=-1)
    return np.concatenate([q_r, quat.multiply(q_ab, half)], axis=-1)


def multiply(Q_ab: Array, Q_bc: Array) -> Array:
    """Chain two rigid motions: Q_ac (..., 8). (8)

    The paper prints the second dual term as q_Br q_Ad; the order must be q_Ad q_Br, quaternions do not commute.
    """
    ar, ad, br, bd = Q_ab[..., :4], Q_ab[..., 4:], Q_bc[..., :4], Q_bc[..., 4:]
    return np.concatenate([quat.multiply(ar, br), quat.multiply(ar, bd) + quat.multiply(ad, br)], axis=-1)


def apply(Q_ab: Array, p_b: Array) -> Array:
    """The operator L(p, Q): take points p_b (..., 3) to p_a (..., 3). (13)"""
    return quat.rotate(Q_ab[..., :4], p_b) + origin(Q_ab)


def origin(Q_ab: Array) -> Array:
    """Where b's origin lies in a, L(0, Q): (..., 8) -> (..., 3). (27)"""
    return 2.0 * quat.multiply(Q_ab[..., 4:], quat.conjugate(Q_ab[..., :4]))[..., 1:]
