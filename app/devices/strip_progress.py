"""Whether the samples that have come, a few strips at a time, complete a row of the trajectory.

In      blocks as they come
Out     whether the method is to step: for less than a row it would be called in vain
Source  ours; a row is at a sample of the fastest stream, once every stream has got that far
        (estimators/orientation/resampling.py)
"""

from bisect import bisect_right
from collections.abc import Iterable

import numpy as np

from handscope.estimators.data.samples import Block


class StripProgress:
    """A strip that has given nothing for `patience` s is not waited for."""

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self._rates: dict[str, float] = {}  # Hz, by the name of a stream that rows need
        self._times: dict[str, list[float]] = {}  # s, newest samples of these
        self._reached = -np.inf  # s, by all of them

    def take(self, blocks: Iterable[Block]) -> bool:
        """Whether these complete a row; also where there is no stream that rows need."""
        for block in blocks:
            if len(block.t) and (block.stream.inertial or block.stream.oriented):
                self._rates[block.stream.name] = block.stream.rate
                self._times.setdefault(block.stream.name, []).extend(block.t.tolist())
        newest = max((times[-1] for times in self._times.values()), default=-np.inf)
        waited_for = {n: t for n, t in self._times.items() if t[-1] >= newest - self._patience}
        if not waited_for:
            return True
        before, self._reached = self._reached, min(t[-1] for t in waited_for.values())
        rows = waited_for[max(waited_for, key=self._rates.__getitem__)]
        has_row = bisect_right(rows, before) < bisect_right(rows, self._reached)
        for times in self._times.values():
            del times[: min(bisect_right(times, self._reached), len(times) - 1)]
        return has_row
