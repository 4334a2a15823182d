"""Map one clock onto another from pairs of readings that were delayed on the way.

In      pairs (remote, local): a remote time stamp and the local time at which it arrived, s; arrival is late by a varying delay, never early
Out     local = offset + rate * remote along the lower edge of the delays: jitter and bursts do not move it, drift is followed
Source  convex-hull lower bound: Moon, Skelly & Towsley 1999, INFOCOM, "Estimation and removal of clock skew from network delay measurements"
"""

import itertools
from dataclasses import dataclass, field

WINDOW = 120  # s of local time that the line is drawn through
BIN = 1.0  # s; of each bin only the least delayed pair counts
SETTLED = 5.0  # s of pairs before a drift is used


@dataclass
class ClockMap:
    """Feed pairs in order of arrival; `local` maps at any time."""

    offset: float | None = None  # s
    rate: float = 1.0
    origin: float = 0.0  # remote time at which `offset` holds
    # (remote, local - remote), one a bin
    _best: list[tuple[float, float]] = field(default_factory=list)

    def update(self, remote: float, local: float) -> None:
        """Take a pair; the line is drawn anew when a bin is full."""
        delay = local - remote
        if self.offset is None:
            self.offset, self.origin = delay, remote
        bins = remote // BIN - self._best[-1][0] // BIN if self._best else 1.0
        if bins > 0:
            self._redraw()
            self._best.append((remote, delay))
            while self._best[0][0] < remote - WINDOW:
                self._best.pop(0)
        elif bins == 0 and delay < self._best[-1][1]:
            self._best[-1] = (remote, delay)
        if delay < self.offset + (self.rate - 1.0) * (remote - self.origin):
            # earlier than thought possible: the line lies lower
            self.offset = delay - (self.rate - 1.0) * (remote - self.origin)

    def local(self, remote: float) -> float:
        """The local time of a remote time stamp."""
        assert self.offset is not None, "no pair yet"
        return remote + self.offset + (self.rate - 1.0) * (remote - self.origin)

    def remote(self, local: float) -> float:
        """The remote time at a local time: the inverse of `local`."""
        assert self.offset is not None, "no pair yet"
        return self.origin + (local - self.offset - self.origin) / self.rate

    def _redraw(self) -> None:
        if len(self._best) < 2 or self._best[-1][0] - self._best[0][0] < SETTLED:
            return
        hull: list[tuple[float, float]] = []
        for point in self._best:
            while len(hull) >= 2 and _turn(hull[-2], hull[-1], point) <= 0:
                hull.pop()
            hull.append(point)
        middle = sum(x for x, _ in self._best) / len(self._best)
        (x0, y0), (x1, y1) = next((a, b) for a, b in itertools.pairwise(hull) if b[0] >= middle)
        slope = (y1 - y0) / (x1 - x0)
        self.rate, self.origin, self.offset = 1.0 + slope, x0, y0


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
