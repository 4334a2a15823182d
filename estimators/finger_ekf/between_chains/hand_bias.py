"""What the fingers learn of the bias of the hand's gyroscope, reported to the thumb's chain.

In      the filter's chains, every one of which estimates the hand's gyroscope for itself
Out     bias, joints and mounting of the thumb's chain, corrected by what the fingers have learnt since the last time
Source  the information that an estimate has gained since it was reported last, as in a channel filter: Grime & Durrant-Whyte 1994, Control Eng Pract 2:849. Ours: the mean of
        the fingers' gains and not their sum, as the errors of the hand's own sensor are in all of them; a finger whose estimate disagrees with the median of the others' is left out
Limits  one way, so that nothing comes back to where it is from; a rest of the hand is seen by every chain alike and reported to none; of two fingers that
        agree and two that do not, which are right is not known
"""

from typing import NamedTuple

import numpy as np

from handscope.estimators.finger_ekf.between_chains import chain_estimates
from handscope.estimators.finger_ekf.between_chains.chain_estimates import Estimates
from handscope.estimators.finger_ekf.sensor_to_segment import ERROR
from handscope.estimators.numerics.typing import Array, Bools

THUMB, FINGERS = 0, slice(1, 5)  # chains
HAND = slice(ERROR.bias, ERROR.bias + 3)  # error states: the bias of a chain's first sensor
EVERY = 5.0  # s; longer than errors of verticals and joints last, so that gains are of their own
DISAGREES = (
    16.27  # squared normalised difference: of a chi-squared of three freedoms one in a thousand
)
LEAST = 1e-6  # share of what the thumb's chain knows itself below which a gain is none


class Reported(NamedTuple):
    """What the fingers knew of the hand's bias when they were last asked."""

    t: float  # s
    bias: Array  # (4, 3) rad/s
    P: Array  # (4, 3, 3) (rad/s)^2
    rest_rate: Array  # (4, 3) rad/s, of the hand's newest rest


def ask(t: float, bias: Array, P: Array, previous_rest_rate: Array) -> Reported:
    """What the fingers know now; bias (F, 4, 3), P (F, 43, 43), previous_rest_rate (F, 4, 3)."""
    return Reported(
        t,
        bias[FINGERS, 0].copy(),
        P[FINGERS, HAND, HAND].copy(),
        previous_rest_rate[FINGERS, 0].copy(),
    )


def gained(before: Reported, now: Reported, bias_walk: float) -> tuple[Array, Array]:
    """Mean information (3, 3) that the fingers gained on the hand's bias while it walked, and what it says, information times bias (3,); nothing where the hand rested.

    A finger counts if it agrees with the others now and agreed when it was asked last: what it gained since is the difference of the two.
    """
    counts = find_agreeing(before) & find_agreeing(now)
    rested = not np.array_equal(before.rest_rate, now.rest_rate, equal_nan=True)
    if rested or not counts.any():
        return np.zeros((3, 3)), np.zeros(3)
    walked = bias_walk**2 * (now.t - before.t) * np.eye(3)
    earlier, newer = np.linalg.inv(before.P + walked), np.linalg.inv(now.P)  # information
    information_vector = (newer @ now.bias[..., None] - earlier @ before.bias[..., None])[..., 0]
    return (newer - earlier)[counts].mean(axis=0), information_vector[counts].mean(axis=0)


def find_agreeing(known: Reported) -> Bools:
    """Which fingers (4,) agree with the median of the others, as well as both are known."""
    others = [[f for f in range(len(known.bias)) if f != own] for own in range(len(known.bias))]
    difference = known.bias - np.median(known.bias[others], axis=1)
    S = known.P + known.P[others].mean(axis=1)
    squared = (difference * np.linalg.solve(S, difference[..., None])[..., 0]).sum(axis=1)
    return np.asarray(squared <= DISAGREES)


def corrected(thumb: Estimates, information: Array, information_vector: Array) -> Estimates:
    """The thumb's chain after what was gained; directions in which nothing was are left out."""
    values, vectors = np.linalg.eigh(0.5 * (information + information.T))
    own = np.linalg.eigvalsh(thumb.P[HAND, HAND])[0]
    some = values * own > LEAST
    if not some.any():
        return thumb
    H, P = vectors[:, some].T, thumb.P
    innovation = H @ information_vector / values[some] - H @ thumb.bias[0]
    PH = P[:, HAND] @ H.T
    S = H @ PH[HAND] + np.diag(1.0 / values[some])
    K = np.linalg.solve(S, PH.T).T
    return chain_estimates.corrected(thumb, K @ innovation, P - K @ PH.T)
