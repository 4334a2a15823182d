"""Error of accelerometers, estimated from the recording: their readings at rest against gravity.

In      blocks of inertial sensors, the prior standard deviation of an axis, m/s^2
Out     the posterior standard deviation: larger for bad sensors, smaller for good ones
Source  ours: what a sensor reads too much at rest is its bias and scale along the vertical, of the size of what tilts it. The sensors of a glove are alike, so that they
        tell it together; inverse gamma prior (Gelman et al. 2013, Bayesian Data Analysis, 2.6), worth LIKELY readings
Limits  what is across the vertical in every inclination is not seen; gravity differs from place to place by 0.03 m/s^2, which counts as an error
"""

from collections.abc import Sequence

import numpy as np

from handscope.estimators.data.samples import ACC, GYR, Block, every
from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array

LIKELY = 2.0  # sensors at rest that the prior counts as; ours
WINDOW = 1.0  # s
SETTLED = 0.1  # m/s^2, standard deviation of the size within a window: ours
RATE = np.radians(3.0)  # rad/s, and of the angular rate: ours
DISTINCT = np.cos(np.radians(45.0))  # larger differences of inclination show another axis; ours
GLOVE = {"hand", *(segment for chain in CHAINS.values() for segment in chain)}


def error_sd_at_rest(likely: float, blocks: Sequence[Block]) -> float:
    """The standard deviation of an axis, m/s^2."""
    missed = np.concatenate(
        [
            _gravity_residuals(b, k)
            for b in blocks
            if b.stream.inertial
            for k, s in enumerate(b.stream.sensors)
            if s in GLOVE
        ]
        or [np.empty(0)]
    )
    return float(np.sqrt((LIKELY * likely**2 + missed @ missed) / (LIKELY + len(missed))))


def _gravity_residuals(block: Block, k: int) -> Array:
    """Residuals (m,) m/s^2 of the k-th sensor at rest against gravity, one for each inclination."""
    acc, gyr = block.of(ACC)[:, k], block.of(GYR)[:, k]
    known = every(np.isfinite(acc)) & every(np.isfinite(gyr))
    starts = (
        np.searchsorted(block.t, np.arange(block.t[0], block.t[-1], WINDOW))
        if len(block.t)
        else np.empty(0, int)
    )
    found: list[tuple[Array, list[float]]] = []  # an inclination, and what was read in it
    for a, b in zip(starts, starts[1:]):
        if b - a > 3 and known[a:b].all() and _find_rests(acc[a:b], gyr[a:b]):
            mean = acc[a:b].mean(axis=0)
            size = float(np.linalg.norm(mean))
            near = next((sizes for along, sizes in found if along @ mean > DISTINCT * size), None)
            if near is None:
                found.append((mean / size, [size]))
            else:
                near.append(size)
    return np.array([np.mean(sizes) - GRAVITY for _, sizes in found])


def _find_rests(acc: Array, gyr: Array) -> bool:
    return (
        float(np.linalg.norm(acc, axis=1).std()) < SETTLED
        and float(np.linalg.norm(gyr.std(axis=0))) < RATE
    )
