"""What the fingers learn of how the hand's sensor sits, reported to the chains of thumb and wrist.

In      the filter's chains, each of which estimates the mounting of the hand's sensor for itself
Out     joints and mountings of the thumb's and the wrist's chain, corrected by what the fingers have learnt
Source  the information that an estimate has gained since it was reported last, as in a channel filter: Grime & Durrant-Whyte 1994, Control Eng Pract 2:849. Ours: a
        finger's axis of flexion is off the hand's by a random effect, whose size is learnt from how the fingers differ; what errs by the hand's own sensor is in
        all of them, so that four fingers that agree count as four for their axes alone
Limits  one way, so that nothing comes back to where it is from; first order in the mounting's errors
"""

from typing import NamedTuple

import numpy as np

from handscope.estimators.finger_ekf.between_chains import chain_estimates
from handscope.estimators.finger_ekf.between_chains.chain_estimates import Estimates
from handscope.estimators.finger_ekf.joint_compliance import ASSUMED
from handscope.estimators.finger_ekf.sensor_to_segment import ERROR
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Bools

FINGERS = slice(1, 5)  # chains
HAND = slice(ERROR.q_SB, ERROR.q_SB + 3)  # error states of a finger's chain
# chains that receive it, thumb and wrist, and which of their sensors is the hand's
RECEIVERS = ((0, 0), (5, 1))
EVERY = 5.0  # s
LEAST = 1e-3  # of what a chain knows itself, below which a change is none
WALKS = np.diag([1.0, 1.0, 0.0])  # axes about which a mounting walks: preintegration.py
SINGULAR = 1e-12  # rad^2, added to variances that may be zero


class Shared(NamedTuple):
    """What the fingers knew when sharing began, and what each chain has received since."""

    t: float  # s, when they were asked last
    information: Array  # (4, 3, 3) rad^-2, of the fingers, when sharing began
    information_vector: Array  # (4, 3) rad^-1, information times mounting
    reported: Array  # (2, 3, 3) rad^-2, by chain of RECEIVERS
    reported_vector: Array  # (2, 3) rad^-1


def begin(t: float, q_SB: Array, P: Array) -> Shared:
    """What the fingers know now is known to every chain; q_SB (F, 4, 4), P (F, 43, 43)."""
    return Shared(
        t, *_known(q_SB, P), np.zeros((len(RECEIVERS), 3, 3)), np.zeros((len(RECEIVERS), 3))
    )


def aged(shared: Shared, t: float, mounting_walk: float) -> Shared:
    """The same at t: what was known and what was received are worth less after a random walk of the mounting, rad/sqrt(s)."""
    walked = mounting_walk**2 * (t - shared.t) * WALKS
    # (information^-1 + walked)^-1 = kept information, also of a singular one; its mean stays
    kept, left = (
        np.linalg.inv(np.eye(3) + information @ walked)
        for information in (shared.information, shared.reported)
    )
    return Shared(
        t,
        kept @ shared.information,
        np.einsum("fij,fj->fi", kept, shared.information_vector),
        left @ shared.reported,
        np.einsum("kij,kj->ki", left, shared.reported_vector),
    )


def gained_since(
    shared: Shared, q_SB: Array, P: Array, known: Bools, axis_sd: float
) -> tuple[Array, Array]:
    """Information (3, 3) that the fingers together have gained since sharing began, and times its mean (3,).

    `known` (F, 3) joints; `axis_sd` rad by which a finger's axis is off the hand's where nothing is known of it.
    """
    counts = known[FINGERS, 0]
    now, vector = _known(q_SB, P)
    gained = _positive(np.where(counts[:, None, None], now - shared.information, 0.0))
    size = np.einsum("fii->f", gained)
    if size.sum() <= 0:
        return np.zeros((3, 3)), np.zeros(3)
    weight = size / size.sum()
    number = float(1.0 / (weight**2).sum())  # of fingers that gained much
    variance = _axis_variance(quat.log(q_SB[FINGERS, 0]), weight, number, axis_sd)
    # (number R + variance)^-1 of each, R = gained^-1: together (R + variance / number)^-1 where they know alike
    discount = np.linalg.inv(number * np.eye(3) + variance * gained)
    means = np.where(counts[:, None], vector - shared.information_vector, 0.0)
    together = np.asarray((discount @ gained).sum(axis=0))
    return 0.5 * (together + together.T), np.einsum("fij,fj->i", discount, means)


def report(
    shared: Shared, t: float, k: int, chain: Estimates, information: Array, vector: Array
) -> tuple[Shared, Estimates]:
    """Chain RECEIVERS[k] with what it has not received yet of the gains: information (3, 3), and times its mean (3,)."""
    shared = shared._replace(t=t)
    own = ERROR.q_SB + 3 * RECEIVERS[k][1] + np.arange(3)
    before = chain.P[np.ix_(own, own)] + SINGULAR * np.eye(3)
    more = information - shared.reported[k]
    if np.abs(np.linalg.eigvals(more @ before)).max() < LEAST:
        return shared, chain
    values, vectors = np.linalg.eigh(np.linalg.inv(before) + more)
    if values[0] <= 0:  # more would be taken back than the chain knows
        return shared, chain
    after = (vectors / values) @ vectors.T
    mounting = quat.log(chain.q_SB[RECEIVERS[k][1]])
    change = after @ (vector - shared.reported_vector[k] - more @ mounting)
    gain = np.linalg.solve(before, chain.P[own]).T
    P = chain.P + gain @ (after - before) @ gain.T
    reported, reported_vector = shared.reported.copy(), shared.reported_vector.copy()
    reported[k], reported_vector[k] = information, vector
    return (
        shared._replace(reported=reported, reported_vector=reported_vector),
        chain_estimates.corrected(chain, gain @ change, P),
    )


def _known(q_SB: Array, P: Array) -> tuple[Array, Array]:
    """Information (4, 3, 3) of the fingers on the hand's mounting, and times its mean (4, 3)."""
    information = np.asarray(np.linalg.inv(P[FINGERS, HAND, HAND] + SINGULAR * np.eye(3)))
    return information, np.einsum("fij,fj->fi", information, quat.log(q_SB[FINGERS, 0]))


def _axis_variance(mounting: Array, weight: Array, number: float, axis_sd: float) -> float:
    """Variance of the fingers' axes, rad^2: as assumed, and as they scatter about their mean about the two axes that flexion shows."""
    off = (mounting - weight @ mounting)[:, :2]
    scatter = 0.5 * float(weight @ (off**2).sum(axis=1))
    return (ASSUMED * axis_sd**2 + number * scatter) / (ASSUMED + number - 1.0)


def _positive(information: Array) -> Array:
    """Without directions in which something was lost."""
    values, vectors = np.linalg.eigh(0.5 * (information + information.transpose(0, 2, 1)))
    return np.asarray((vectors * np.maximum(values, 0.0)[:, None]) @ vectors.transpose(0, 2, 1))
