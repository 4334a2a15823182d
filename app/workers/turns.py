"""Stations compute one after the other, in the order in which they ask, and rest so that all of them leave room.

In      how long each station computes for a batch of samples, s
Out     whose turn it is; for how long a station takes no more samples
Source  ours; docs/decisions/0010-what-breaks-first-with-many-stations.md
Limits  who has waited LONGEST_WAIT computes beside the others: a turn puts in order, it protects nothing
"""

import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager

FULL = 0.8  # share of the time in which stations compute: the rest is for pages and web sockets
LONGEST_REST = 0.06  # s between two batches; a viewer under load may be 80 ms late
LONGEST_WAIT = 0.1  # s for a turn, such as behind a method that is slow
SMOOTHING = 0.1  # of the newest batch in the mean cost of one


class Turns:
    """One for all stations of a process: its threads share one interpreter, and who is in the middle of a step should not have to ask for it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._is_taken = False
        self._first: deque[threading.Lock] = deque()  # who waits to finish a batch
        self._later: deque[threading.Lock] = deque()  # who waits to begin one
        self._costs: dict[Share, float] = {}  # s of a batch, mean
        self.background = threading.Lock()  # for work that nobody waits for: one at a time

    def share(self) -> "Share":
        """For one more station."""
        return Share(self)

    def set_cost(self, whose: "Share", newest: float) -> float:
        """Take the cost (s) of a station's newest batch; returns the time (s) between two of its batches."""
        with self._lock:
            mean = self._costs.get(whose, newest)
            self._costs[whose] = mean + SMOOTHING * (newest - mean)
            return sum(self._costs.values()) / FULL

    def leave(self, whose: "Share") -> None:
        """A station has ended."""
        with self._lock:
            self._costs.pop(whose, None)

    def take(self, first: bool) -> bool:
        """Wait for a turn; False where it did not come in time."""
        with self._lock:
            if not self._is_taken:
                self._is_taken = True
                return True
            gate = threading.Lock()
            gate.acquire()
            waiting = self._first if first else self._later
            waiting.append(gate)
        if gate.acquire(timeout=LONGEST_WAIT):
            return True
        with self._lock:
            if gate not in waiting:  # it came after all
                return True
            waiting.remove(gate)
            return False

    def pass_on(self) -> None:
        """The turn is over."""
        with self._lock:
            if waiting := self._first or self._later:
                waiting.popleft().release()
            else:
                self._is_taken = False


class Share:
    """What one station takes of the turns; for all of its threads."""

    def __init__(self, turns: Turns) -> None:
        self.turns = turns
        self._lock = threading.Lock()
        self._spent = 0.0  # s in turns since the newest batch

    @contextmanager
    def turn(self, first: bool = False) -> Iterator[None]:
        """Compute within; `first` where a batch is finished that was begun in an earlier turn."""
        has_turn = self.turns.take(first)
        began = time.monotonic()
        try:
            yield
        finally:
            with self._lock:
                self._spent += time.monotonic() - began
            if has_turn:
                self.turns.pass_on()

    def rest(self) -> float:
        """After a batch: for how long (s) to take no more samples, so that all stations keep to their share of the time."""
        with self._lock:
            spent, self._spent = self._spent, 0.0
        return min(LONGEST_REST, max(0.0, self.turns.set_cost(self, spent) - spent))

    def leave(self) -> None:
        """The station has ended."""
        self.turns.leave(self)
