"""Heading of the thumb's metacarpal against the hand, held by the acceleration that both feel at their joint.

In      sums over a block of movement (block_sums.py), the thumb's chain
Out     the chain with its first joint's heading corrected; what was learnt of lever arms, accelerometers and noise
Source  relative heading from a common joint's acceleration: Kok et al. 2014, IFAC 47:79; Weygers & Kok 2020, IEEE Sens J 20:7969. Ours: block by block, with lever arms, biases and
        scales estimated along; the noise is that of the block's residuals, or larger as the innovations show (covariance matching, as in joint_compliance.py)
Limits  a hand that is not accelerated sideways tells nothing; lever arms and accelerometers are estimated with the block's heading as unknown, and
        their errors are treated as independent between blocks
"""

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from handscope.estimators.finger_ekf.between_chains import chain_estimates
from handscope.estimators.finger_ekf.between_chains.chain_estimates import Estimates
from handscope.estimators.finger_ekf.joint_acceleration import block_sums
from handscope.estimators.finger_ekf.joint_acceleration.block_sums import (
    DIFFERENCE,
    HEADING,
    INDEPENDENT,
    UNKNOWNS,
    BlockSums,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

EVERY = 10.0  # s; longer than errors of inclination last, shorter than a heading takes to drift
LEAST = 20.0  # boxes in a block that is used
# prior standard deviations, ours: m of a joint from a sensor, m/s^2, dimensionless
LEVER, ACC_BIAS, ACC_SCALE = 0.06, 0.1, 0.005
PRIOR = np.repeat([LEVER, ACC_BIAS, ACC_SCALE], [6, 6, 18]) ** 2
FORGOTTEN = 36000.0  # s after which the prior's variance was added once: seats and skin change
ASSUMED = 2.0  # blocks; weight of the prior that innovations are as large as expected
# squared sd beyond which a block is downweighted, unless the next one agrees with it
UNLIKELY = 9.0
FIRST = slice(0, 3)  # error states of the chain's first joint


class Noise(NamedTuple):
    """Differences of the two accelerations at the joint that lever arms, biases and scales do not explain."""

    density: float  # (m/s^2)/sqrt(Hz), the least assumed
    correlation: float  # s, correlation time of a block's residuals


@dataclass(frozen=True)
class JointAcceleration:
    """What is known of the two sensors, and the sums of the open block."""

    begun: float  # s
    heading: float  # rad, of the second fusion against the first when the block began
    sums: BlockSums
    unknowns: Array  # (UNKNOWNS,) lever arms m, biases m/s^2, scales
    P: Array  # (UNKNOWNS, UNKNOWNS)
    noise_stats: Array  # (2,) weighted sum of squared innovations over their expected variance, and sum of weights
    rejected: float = math.nan  # rad, innovation of the block before if it was rejected
    # its noise_stats, which count unless the next block agrees with it
    pending_stats: Array = field(default_factory=lambda: np.zeros(2))


def begin(
    t: float, q_pc: Array, q_EB: Array, before: JointAcceleration | None = None
) -> JointAcceleration:
    """A block from now on, at joint q_pc (4,) and orientations q_EB (2, 4) by the fusions."""
    heading = heading_between(q_pc, q_EB)
    sums = block_sums.begin(t, heading)
    if before is not None:
        return replace(before, begun=t, heading=heading, sums=sums)
    return JointAcceleration(t, heading, sums, np.zeros(UNKNOWNS), np.diag(PRIOR), np.zeros(2))


def interrupted(state: JointAcceleration) -> JointAcceleration:
    """Without the open block; the next begins with the next update."""
    return replace(state, begun=-math.inf, sums=block_sums.begin(0.0, 0.0))


def copied(state: JointAcceleration) -> JointAcceleration:
    """With sums of its own, which a kernel may fill."""
    return replace(state, sums=BlockSums(*(x.copy() for x in state.sums)))


def heading_between(q_pc: Array, q_EB: Array) -> float:
    """Heading (rad) of the second fusion's frame against the first's that the joint orientation q_pc implies."""
    q = quat.multiply(quat.multiply(q_EB[0], q_pc), quat.conjugate(q_EB[1]))
    return 2 * math.atan2(q[3], q[0])


def close(
    noise: Noise, state: JointAcceleration, thumb: Estimates, up: Array, q_EB: Array, t: float
) -> tuple[JointAcceleration, Estimates]:
    """End the block at t and correct the thumb's chain by its heading; `up` (3,) is the vertical in the frame of the metacarpal's sensor."""
    if state.sums.gram[0] < LEAST:
        return state, thumb
    normal = detrended(state.sums)
    energy = normal[HEADING, HEADING]
    if energy <= 0:
        return state, thumb
    share = normal[HEADING, :UNKNOWNS] / energy
    tangent = float(normal[HEADING, DIFFERENCE] / energy - share @ state.unknowns)
    # |a - b| = 2 tan(angle / 2) |a + b| / 2
    seen = 2 * math.atan(tangent / 2)
    own = float(up @ thumb.P[FIRST, FIRST] @ up)
    systematic = float(share @ state.P @ share)
    density = noise_density(noise, residual(state, normal, tangent))
    variance = excess(state.noise_stats) * density / (energy * INDEPENDENT) + 0.5 * own**2
    # the state's heading is compared at mid-block
    moved = wrapped(heading_between(thumb.q_pc[0], q_EB) - state.heading)
    innovation, S = seen - 0.5 * moved, own + systematic + variance
    squared = min(innovation**2, UNLIKELY * S)
    ratio = (squared - own - systematic) * energy * INDEPENDENT / density
    weight = (variance / S) ** 2
    is_unlikely = innovation**2 > UNLIKELY * S
    repeats = abs(innovation - state.rejected) < 3 * math.sqrt(2 * (systematic + variance))
    P_thumb = thumb.P.copy()
    if is_unlikely and repeats:  # two blocks agree that the filter's own heading is what is wrong
        P_thumb[FIRST, FIRST] += innovation**2 * np.outer(up, up)
        S += innovation**2
    elif is_unlikely:
        S = innovation**2
    unknowns, P = _learnt(state, normal, share, variance * energy, t)
    rejects, own_stats = is_unlikely and not repeats, weight * np.array([ratio, 1.0])
    state = replace(
        state,
        unknowns=unknowns,
        P=P,
        noise_stats=state.noise_stats
        + (np.zeros(2) if repeats else state.pending_stats)
        + (np.zeros(2) if is_unlikely else own_stats),
        rejected=innovation if rejects else math.nan,
        pending_stats=own_stats if rejects else np.zeros(2),
    )
    gain = P_thumb[:, FIRST] @ up / S
    P_thumb -= S * np.outer(gain, gain)
    return state, chain_estimates.corrected(thumb, gain * innovation, P_thumb)


def detrended(sums: BlockSums) -> Array:
    """Normal equations (COLUMNS, COLUMNS) after a constant and a slope of each component are projected out."""
    n, time, squared = sums.gram
    G = np.linalg.inv(np.array([[n, time], [time, squared]]))
    lower = sums.normal
    full = lower + np.tril(lower, -1).T
    return np.asarray(full - np.einsum("aik,ij,ajl->kl", sums.trend, G, sums.trend))


def residual(state: JointAcceleration, normal: Array, heading: float) -> float:
    """Mean square (m/s^2)^2 of a component of the residuals, with these unknowns and this heading."""
    x = np.concatenate([-state.unknowns, [-heading, 1.0]])
    return max(float(x @ normal @ x), 0.0) / (3.0 * float(state.sums.gram[0]))


def noise_density(noise: Noise, mean_square: float) -> float:
    """Power spectral density, (m/s^2)^2 s, of residuals with this mean square and correlation time; at least the assumed one."""
    return max(noise.density**2, mean_square * noise.correlation)


def excess(stats: Array) -> float:
    """Factor by which innovations exceed the assumed density, 1 at least."""
    return max(float((ASSUMED + stats[0]) / (ASSUMED + stats[1])), 1.0)


def wrapped(angle: float) -> float:
    """Between -pi and pi."""
    return math.remainder(angle, 2 * math.pi)


def _learnt(
    state: JointAcceleration, normal: Array, share: Array, noise: float, t: float
) -> tuple[Array, Array]:
    """Unknowns and their covariance, the block's heading marginalised out; `noise` (m/s^2)^2 of a box."""
    A = normal[:UNKNOWNS, :UNKNOWNS] - normal[HEADING, HEADING] * np.outer(share, share)
    b = normal[:UNKNOWNS, DIFFERENCE] - normal[HEADING, DIFFERENCE] * share
    information = np.linalg.inv(state.P + np.diag(PRIOR) * (t - state.begun) / FORGOTTEN)
    P = np.linalg.inv(information + A / noise)
    return P @ (information @ state.unknowns + b / noise), 0.5 * (P + P.T)
