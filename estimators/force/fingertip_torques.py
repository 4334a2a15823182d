"""Torques of a force sensor with six axes, at every instant of the hand's movement and without its zero.

In      a block with the torques of one sensor, when the sensor was free, the instants wanted
Out     torques (n, 3) Nm that the fingertip exerts about the sensor's origin, in the sensor's frame, and their standard deviation (n,)
Source  Kortier, thesis 6.2 and 6.4: six axes, read and brought to the filter's rate as the forces are; zero.py, interpolation.py
        What twists: a soft fingertip touches with M = r x F + m n (Bicchi, Salisbury & Brock 1993, Int J Robotics Res 12:249), so that m = M.F / n.F
Limits  a sensor is free where its forces say so: a torque without a force gives no zero, and is not used
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.samples import TORQUE, Block, exceeds
from handscope.estimators.force import interpolation, zero
from handscope.estimators.numerics.typing import Array, Bools

LEVER = 5e-3  # m: interpolation.py models how forces change; a torque is taken for one of them at this lever; ours
# Nm: 500 N at a lever of a centimetre; no fingertip does that, the unit is another
IMPOSSIBLE = 5.0
BRIDGED = 0.25  # s to the nearest sample, beyond which a torque counts as missing, as forces do
PUSHES = 0.5  # N along the normal, below which no twist is computed: ours
LEAST = 8  # samples of a sensor that is used


@dataclass(frozen=True)
class Torque:
    """Torques in N m with their standard deviation."""

    values: Array  # (n, 3) Nm
    sd: Array  # (n,) Nm, of each axis


def read_torques(
    block: Block,
    limited: Bools,
    drift: float,
    t: Array,
    free: Bools,
    at: Array,
) -> Torque | None:
    """The torques of a block with one sensor at the instants `at`; None where there are too few.

    `limited` (samples,) are at the end of a range, known or not, and are not used; `drift` is that of the zero, Nm a root of a second; `free` says for instants `t` of its forces whether it touched nothing.
    """
    raw = block.of(TORQUE)[:, 0]
    values = np.where((limited | exceeds(raw, IMPOSSIBLE))[:, None], np.nan, raw)
    if np.isfinite(values).all(axis=1).sum() < LEAST:
        return None
    noise = max(
        LEVER * float(interpolation.reading_noise(block.t, values[:, None] / LEVER)[0]), 1e-6
    )
    near = np.clip(np.searchsorted(t, block.t), 0, len(t) - 1)
    level, level_sd = zero.zero_from_others(block.t, values, free[near], noise, drift)
    interpolated = interpolation.interpolate(
        block.t, (values - level)[:, None] / LEVER, np.array([noise / LEVER]), at
    )
    then = np.clip(np.searchsorted(block.t, at), 0, len(block.t) - 1)
    lost = interpolated.distance[:, 0] > BRIDGED
    return Torque(
        np.where(lost[:, None], np.nan, LEVER * interpolated.values[:, 0]),
        np.hypot(LEVER * interpolated.sd[:, 0], level_sd[then]),
    )


def fingertip_twist(
    forces: Array, torques: Array, torques_sd: Array, normal: Array
) -> tuple[Array, Array]:
    """Torque (...) Nm about the normal (..., 3) of the contact, wherever that is, and its standard deviation; NaN where the force is small.

    Forces (..., 3) N, torques and their standard deviations (..., 3) Nm in one frame with the normal, which points out of the pad.
    """
    pushes = (forces * normal).sum(axis=-1)
    pushes = np.where(pushes > PUSHES, pushes, np.nan)
    return (torques * forces).sum(axis=-1) / pushes, np.sqrt(
        ((torques_sd * forces) ** 2).sum(axis=-1)
    ) / pushes


def is_impossible(block: Block) -> bool:
    """Whether any torque of a block with one sensor is larger than a fingertip can exert."""
    return bool(exceeds(block.of(TORQUE)[:, 0], IMPOSSIBLE).any())
