"""How often a movement was repeated, counted while it goes on: there and back is one.

In      values (n,) of one angle or distance, in any unit; the least range, in the same unit, that counts as movement
Source  ours: two thresholds at 30 and 70 % of the range from the 5th to the 95th percentile, so that tremor at one end is no repetition
Limits  the thresholds follow the range as it grows; a repetition counts when its far end is reached
"""

import numpy as np

from handscope.estimators.numerics.typing import Array

LOW, HIGH = 0.3, 0.7


def count(values: Array, least: float) -> int:
    """Repetitions among values (n,), NaN left out: stays beyond the one threshold or beyond the other, whichever were fewer."""
    return len(far_ends(values, least))


def far_ends(values: Array, least: float) -> np.ndarray:
    """Of each repetition the index into values (n,) at which it went furthest; where the movement both began and ended there, the first is none."""
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return known
    bottom, top = np.percentile(values[known], [5, 95])
    if top - bottom < least:
        return known[:0]
    share = (values[known] - bottom) / (top - bottom)
    sides = (share > HIGH).astype(int) - (share < LOW)
    beyond = np.flatnonzero(sides)
    stays = np.split(beyond, np.flatnonzero(np.diff(sides[beyond])) + 1)
    far = [stay for stay in stays if len(stay) and sides[stay[0]] > 0]
    first = int(2 * len(far) > len(stays))
    return known[[stay[np.argmax(share[stay])] for stay in far[first:]]]
