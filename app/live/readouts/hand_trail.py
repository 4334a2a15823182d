"""The hand's path in the last seconds, computed only on request.

In      the hand's samples since the last time, its orientation by the method
Out     places (n, 3) m in the global frame
Source  estimators/orientation/zupt_navigation.py
Limits  after a time in which nobody asked it begins REACH ago as after a gap: at rest, with the biases estimated until then
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
PARAMS = HandFilterParams(update=0.1)  # twice as long as in a measurement: this path is only drawn
REACH = 10.0  # s; older samples are skipped: within them a hand stands still once, and the path is accurate after that
AT_ONCE = 1.0  # s of samples in one call: ten of them cost 30 ms, which every station waits for
PAST = 3.0  # s of the path: between standstills it is accurate for no longer


class HandTrail:
    """Not for several threads at once."""

    def __init__(self) -> None:
        self._state: zupt_navigation.State | None = None
        self._path: deque[HandPath] = deque()
        self._is_behind = False  # samples are still to come that there are

    def begin(self, calibration: Calibration | None) -> None:
        """Drop the path and start from a pose."""
        self._state = (
            None
            if calibration is None
            else replace(zupt_navigation.start(PARAMS, calibration), t=calibration.t)
        )
        self._path.clear()
        self._is_behind = False

    def follow(self, blocks: Sequence[Block], q_GH_at: Callable[[float], Array | None]) -> None:
        """Go on through blocks (the hand's, in order) as far as they are new, AT_ONCE in a call; `q_GH_at` gives the hand's orientation (4,) at an instant, where it is known."""
        if self._state is None or not blocks:
            return
        state, seen, newest = self._state, self._seen(self._state), float(blocks[-1].t[-1])
        if newest - seen < PARAMS.update:  # too few for an update
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
        later = join([*takewhile(lambda b: b.t[-1] > seen, reversed(blocks))][::-1]).between(
            np.nextafter(seen, np.inf), np.inf
        )
        new = later.between(later.t[0], later.t[0] + AT_ONCE)
        self._is_behind = len(new.t) < len(later.t)
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
        """Of the last seconds, seen from the newest; oldest first. None while there are samples to go on through."""
        if self._is_behind:
            return np.empty((0, 3))
        pieces = [p for p in self._path if p.t[-1] >= self._path[-1].t[-1] - seconds]
        if not pieces:
            return np.empty((0, 3))
        t, places = np.concatenate([p.t for p in pieces]), np.concatenate([p.p for p in pieces])
        return np.asarray(places[t >= t[-1] - seconds] - places[-1])

    def _seen(self, state: zupt_navigation.State) -> float:
        return float(state.waiting_t[-1]) if len(state.waiting_t) else state.t
