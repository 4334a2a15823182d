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
    known = values[np.isfinite(values)]
    if not len(known):
        return 0
    bottom, top = np.percentile(known, [5, 95])
    if top - bottom < least:
        return 0
    share = (known - bottom) / (top - bottom)
    sides = (share > HIGH).astype(int) - (share < LOW)
    sides = sides[sides != 0]
    stays = sides[np.flatnonzero(np.diff(sides, prepend=0))]
    return int(min(np.count_nonzero(stays > 0), np.count_nonzero(stays < 0)))
