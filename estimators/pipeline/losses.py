"""Mark where samples were lost on their way: figures that rest on many such places are not graded good.

In      a movement, the blocks that it was computed from (one a stream)
Out     the flags LOST of segments and of the hand's place, for the instants at which samples of a stream are missing
Limits  a stream whose steps are not multiples of its nominal period (time stamps of arrival) shows no losses
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.magnet_streams import is_relevant
from handscope.estimators.data.samples import Block
from handscope.estimators.data.trajectory import Flag, PlaceFlag, Trajectory
from handscope.estimators.hand.anatomy import SEGMENT
from handscope.estimators.numerics.typing import Array

FEWEST = 20  # samples from which a period is known
REGULAR = 0.9  # share of steps that must be near a multiple of the period
NEAR = 0.25  # of the period: steps, and the period against the nominal one
TINY = 1e-9  # s, rounding of times
LOST = np.uint8(Flag.LOST)


def mark_losses(movement: Trajectory, blocks: Sequence[Block]) -> None:
    """Set the flags where they do not say already that samples are missing.

    The hand's place rests on several streams: the one that lost most counts, so that the share
    of flagged samples is the share that was lost.
    """
    of_place = [np.zeros(len(movement), bool)]
    for block in blocks:
        lost = _within_gaps(movement.t, block)
        if block.stream.inertial:
            segments = [SEGMENT[s] for s in block.stream.sensors if s in SEGMENT]
            known = (movement.flags[:, segments] & Flag.MISSING) == 0
            movement.flags[:, segments] |= np.where(lost[:, None] & known, LOST, np.uint8(0))
        if is_relevant(block.stream):
            of_place.append(lost)
    if movement.place_flags is not None:
        worst = max(of_place, key=np.count_nonzero)
        movement.place_flags[worst] |= np.uint8(PlaceFlag.LOST)


def _within_gaps(t: Array, block: Block) -> NDArray[np.bool_]:
    """Which of the instants `t` (n,) lie within a gap of the block, or end one."""
    within = np.zeros(len(t), bool)
    for onset, end in find_gaps(block.t, block.stream.rate):
        within[slice(*np.searchsorted(t, [onset + TINY, end + TINY], side="right"))] = True
    return within


def find_gaps(t: Array, rate: float) -> Iterator[tuple[float, float]]:
    """Begin and end (s) of each time for which a stream with the sample times `t` (n,) and the nominal `rate` (Hz) lacks samples."""
    steps = np.diff(t)
    period = float(np.median(steps)) if len(t) >= FEWEST else 0.0
    if abs(period * rate - 1.0) > NEAR:
        return
    periods = np.round(steps / period)
    if (np.abs(steps - periods * period) <= NEAR * period).mean() < REGULAR:
        return
    for k in np.flatnonzero(periods >= 2):
        yield float(t[k] + period), float(t[k + 1])
