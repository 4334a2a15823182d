"""Which samples of a block are missing: values that are not there, and instants at which nothing
came.

In      blocks of an inertial stream
Out     masks, and blocks with rows of NaN where the stream's clock expects a sample
Source  ours
"""

import math

import numpy as np

from handscope.estimators.data.samples import ACC, GYR, SATURATION, Block, exceeds_row
from handscope.estimators.numerics.jit import rowwise_bool
from handscope.estimators.numerics.typing import Array, Bools


def is_complete(block: Block) -> Bools:
    """Which rows (n, sensors) have all six inertial values; three exact zeros are an accelerometer
    that does not answer."""
    return _is_complete(block.of(GYR), block.of(ACC))


def check_samples(block: Block) -> tuple[Bools, Bools]:
    """Which samples (n, sensors) are whole: all six inertial values are there and the rate is
    within its limit, beyond which it is bridged as a missing one is; and which rates or
    accelerations are at the sensor's limit."""
    fastest, hardest = (
        SATURATION * block.stream.full_scale.get(quantity, math.nan) for quantity in (GYR, ACC)
    )
    whole, limit = _check_samples(block.of(GYR), block.of(ACC), fastest, hardest)
    return whole, limit


@rowwise_bool("(v),(v)->()")
def _is_complete(gyr: Array, acc: Array, complete: Bools) -> None:
    total = gyr[0] + gyr[1] + gyr[2] + acc[0] + acc[1] + acc[2]
    complete[0] = math.isfinite(total) and (acc[0] != 0 or acc[1] != 0 or acc[2] != 0)


is_complete_row = _is_complete.row  # as other kernels call it


@rowwise_bool("(v),(v),(),()->(),()")
def _check_samples(
    gyr: Array,
    acc: Array,
    fastest: float,
    hardest: float,
    whole: Bools,
    limit: Bools,
) -> None:
    is_complete_row(gyr, acc, whole)
    exceeds_row(gyr, fastest, limit)
    whole[0] = whole[0] and not limit[0]
    if not limit[0]:
        exceeds_row(acc, hardest, limit)


def insert_missing_instants(
    block: Block, newest: float, period: float, max_gap: float
) -> tuple[Block, Bools]:
    """Put rows of NaN where the stream's clock (`period` s, `newest` sample before the block) says
    that samples are missing; the mask tells the others."""
    if not _has_gap(block.t, newest, period, max_gap):
        return block, np.ones(len(block.t), bool)
    previous = np.concatenate([[newest], block.t[:-1]])
    jump = block.t - previous
    jump[np.isinf(jump)] = period
    counts = np.where(
        jump <= max_gap, np.rint(jump / period) - 1, np.where(jump > 1.5 * period, 1, 0)
    ).astype(int)
    counts = np.maximum(counts, 0)
    where = np.repeat(np.arange(len(block.t)), counts)
    rank = np.arange(len(where)) - np.repeat(np.cumsum(counts) - counts, counts) + 1
    t_missing = previous[where] + rank * jump[where] / (counts[where] + 1)
    filled = Block(
        block.stream,
        np.insert(block.t, where, t_missing),
        np.insert(block.values, where, np.nan, axis=0),
    )
    return filled, np.insert(np.ones(len(block.t), bool), where, False)


@rowwise_bool("(n),(),(),()->()")
def _has_gap(t: Array, newest: float, period: float, max_gap: float, gap: Bools) -> None:
    """Whether some sample is missing between those at t, or before them."""
    gap[0], before = False, newest
    for k in range(t.shape[0]):
        jump = t[k] - before
        if not math.isinf(jump):
            gap[0] = gap[0] or (
                np.rint(jump / period) > 1 if jump <= max_gap else jump > 1.5 * period
            )
        before = t[k]
