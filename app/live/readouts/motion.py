"""How much each sensor moves now.

In      blocks of an inertial stream's last second
Out     Motion by segment
Source  ours
"""

from collections import deque
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from handscope.estimators.data.samples import ACC, GYR, ORIENTATION, Block, Stream, every


@dataclass(frozen=True)
class Motion:
    """Movement of one sensor."""

    rate: float  # rad/s, mean angular rate over the last second against its own mean
    seen: float  # s, newest sample


def latest(blocks: deque[Block], seconds: float) -> list[Block]:
    """The newest blocks of so many seconds, in order; none of a stream that gives neither rates nor orientations."""
    if not blocks or not _is_moving_part(blocks[-1].stream):
        return []
    recent = list(takewhile(lambda b: b.t[-1] >= blocks[-1].t[-1] - seconds, reversed(blocks)))
    return recent[::-1]


def motions(block: Block) -> dict[str, Motion]:
    """Motion of every sensor with complete samples; of orientations by how they turn from one to the next."""
    if ORIENTATION in block.stream.quantities:
        return _turns(block)
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


def _is_moving_part(stream: Stream) -> bool:
    return stream.inertial or ORIENTATION in stream.quantities


def _turns(block: Block) -> dict[str, Motion]:
    """The same of orientations q (n, sensors, 4): the path turned over the time it took, slow turning included."""
    q = block.of(ORIENTATION)
    whole = every(np.isfinite(q))
    cosines = np.minimum(1.0, np.abs(np.einsum("nsa,nsa->ns", q[1:], q[:-1])))  # of half the angles
    turned = np.nansum(2 * np.arccos(cosines), axis=0)
    span = max(float(block.t[-1] - block.t[0]), 1.0 / block.stream.rate)
    return {
        s: Motion(float(turned[k] / span), float(block.t[whole[:, k]][-1]))
        for k, s in enumerate(block.stream.sensors)
        if whole[:, k].any()
    }
