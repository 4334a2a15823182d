"""Where the hand has been in the last seconds, followed only when somebody asks.

In      the hand's samples since the last time, its orientation as the method tells it
Out     places (n, 3) m in the global frame
Source  estimators/orientation/zupt_navigation.py
Limits  after a time in which nobody asked it begins REACH ago as after a gap: at rest, with the biases learnt until then
"""

import logging
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import takewhile

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import Block, join
from handscope.estimators.numerics.typing import Array
from handscope.estimators.orientation import zupt_navigation
from handscope.estimators.orientation.zupt_navigation import HandFilterParams, HandPath

log = logging.getLogger(__name__)
PARAMS = HandFilterParams(
    update=0.1
)  # twice as long as where the path is measured: this one is only drawn, and each look costs
REACH = 10.0  # s; more that nobody asked for is left out: within them a hand stands still once, behind which the path is good again
PAST = 3.0  # s of the path kept: between standstills it is good for no longer


class HandTrail:
    """Not for several threads at once."""

    def __init__(self) -> None:
        self._state: zupt_navigation.State | None = None
        self._path: deque[HandPath] = deque()

    def begin(self, calibration: Calibration | None) -> None:
        """Forget what was, and go on from a pose."""
        self._state = (
            None
            if calibration is None
            else replace(zupt_navigation.start(PARAMS, calibration), t=calibration.t)
        )
        self._path.clear()

    def follow(self, kept: Sequence[Block], q_GH_at: Callable[[float], Array | None]) -> None:
        """Go on through blocks (the hand's, in order) as far as they are new; `q_GH_at` gives the hand's orientation (4,) at an instant, where it is known."""
        if self._state is None or not kept:
            return
        state, seen, newest = self._state, self._seen(self._state), float(kept[-1].t[-1])
        if newest - seen < PARAMS.update:  # so few tell nothing new
            return
        if newest - seen > REACH:
            seen, nothing = newest - REACH, state.waiting[:0]
            q_GH = q_GH_at(seen)
            state = replace(
                state,
                q_GH=state.q_GH if q_GH is None else q_GH,
                waiting=nothing,
                waiting_t=nothing[:, 0],
            )
        new = join([*takewhile(lambda b: b.t[-1] > seen, reversed(kept))][::-1]).between(
            np.nextafter(seen, np.inf), np.inf
        )
        try:
            self._state, piece = zupt_navigation.step(PARAMS, state, new)
        except Exception:  # nothing else depends on it
            log.exception(
                "the hand's path could not be followed; there is none until the next calibration"
            )
            self.begin(None)
            return
        if len(piece):
            self._path.append(piece)
            while self._path[0].t[-1] < piece.t[-1] - PAST:
                self._path.popleft()

    def places(self, seconds: float) -> Array:
        """Of the last seconds, seen from the newest; oldest first."""
        pieces = [p for p in self._path if p.t[-1] >= self._path[-1].t[-1] - seconds]
        if not pieces:
            return np.empty((0, 3))
        t, places = np.concatenate([p.t for p in pieces]), np.concatenate([p.p for p in pieces])
        return np.asarray(places[t >= t[-1] - seconds] - places[-1])

    def _seen(self, state: zupt_navigation.State) -> float:
        return float(state.waiting_t[-1]) if len(state.waiting_t) else state.t
