"""How much each sensor moves now.

In      blocks of an inertial stream's last second
Out     Motion by segment
Source  ours
"""

from collections import deque
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from handscope.estimators.data.samples import ACC, GYR, Block, every


@dataclass(frozen=True)
class Motion:
    """Movement of one sensor."""

    rate: float  # rad/s, mean angular rate over the last second against its own mean
    seen: float  # s, newest sample


def latest(blocks: deque[Block], seconds: float) -> list[Block]:
    """The newest blocks of so many seconds, in order; none of a stream without inertial sensors."""
    if not blocks or not blocks[-1].stream.inertial:
        return []
    recent = list(takewhile(lambda b: b.t[-1] >= blocks[-1].t[-1] - seconds, reversed(blocks)))
    return recent[::-1]


def motions(block: Block) -> dict[str, Motion]:
    """Motion of every sensor with complete samples."""
    gyr, sensors = block.of(GYR), block.stream.sensors
    whole = every(np.isfinite(gyr)) & every(np.isfinite(block.of(ACC)))  # (n, sensors)
    samples = np.maximum(whole.sum(axis=0), 1)
    mean = np.where(whole[..., None], gyr, 0.0).sum(axis=0) / samples[:, None]
    off = np.where(whole[..., None], gyr - mean, 0.0)
    rates = np.sqrt(np.einsum("nsa,nsa->s", off, off) / samples)
    newest = block.t[len(block.t) - 1 - whole[::-1].argmax(axis=0)]
    return {
        s: Motion(float(rates[k]), float(newest[k]))
        for k, s in enumerate(sensors)
        if whole[:, k].any()
    }
