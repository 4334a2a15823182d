"""Stretches of samples that share a property, as half-open index intervals."""

import numpy as np

from handscope.estimators.numerics.typing import Bools


def find_runs(flags: Bools, gap: int = 0) -> list[tuple[int, int]]:
    """Intervals [first, stop) of true flags (n,); runs separated by at most `gap` false flags are merged."""
    true = np.flatnonzero(flags)
    if not len(true):
        return []
    breaks = np.flatnonzero(np.diff(true) > gap + 1)
    firsts = true[np.concatenate([[0], breaks + 1])]
    lasts = true[np.concatenate([breaks, [len(true) - 1]])]
    return [(int(a), int(b) + 1) for a, b in zip(firsts, lasts)]
