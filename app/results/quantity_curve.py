"""The live curve of the quantity under test: aperture between thumb and index tip, or one joint angle."""

import threading
from collections import deque
from collections.abc import Sequence
from itertools import takewhile

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import ANGLES, FINGERS, JOINT
from handscope.estimators.measures.sustained_angle_measures import palm_turn
from handscope.estimators.measures.tapping import MARGIN
from handscope.estimators.numerics.typing import Array

LENGTH = 20.0  # s stored for viewers
LONGEST = 600.0  # s of an attempt stored for its numbers; later points are not counted
SPACING = 1 / 60  # s between two points
DEFAULT = "aperture"
TITLES = {"aperture": "Thumb to index finger", "palm_turn": "Turn of the palm"}


class Curve:
    """Points (t in s, value in mm or deg) of the newest LENGTH seconds, and all of the newest attempt; written by the tracker, read by viewers."""

    def __init__(self) -> None:
        self.what = DEFAULT
        self._points: deque[tuple[float, float]] = deque()
        self._attempt: list[tuple[float, float]] = []
        self._onset, self._end = np.inf, np.inf  # of the attempt, recording time
        self._lock = threading.Lock()

    @property
    def unit(self) -> str:
        return "mm" if self.what == "aperture" else "deg"

    @property
    def title(self) -> str:
        return TITLES.get(self.what, self.what.replace("_", " "))

    def follow(self, what: str | None) -> None:
        """Show another quantity from now on."""
        with self._lock:
            if what is not None and what != self.what:
                self.what = what
                self._clear()

    def add(self, rows: Trajectory) -> None:
        """Take new rows of the trajectory."""
        values = value_of(rows, self.what)
        with self._lock:
            for t, value in zip(rows.t, values):
                if np.isfinite(value) and (
                    not self._points
                    or t - self._points[-1][0] >= SPACING
                    or t < self._points[-1][0]
                ):
                    if self._points and t < self._points[-1][0]:
                        self._clear()
                    self._points.append((float(t), round(float(value), 2)))
                    if self._onset - MARGIN < t <= min(self._end, self._onset + LONGEST):
                        self._attempt.append(self._points[-1])
            while self._points and self._points[0][0] < rows.t[-1] - LENGTH:
                self._points.popleft()

    def since(self, t: float) -> list[tuple[float, float]]:
        """Points later than t, of which a viewer who follows has few to come."""
        with self._lock:
            return list(takewhile(lambda p: p[0] > t, reversed(self._points)))[::-1]

    def attempt(
        self, onset: float, end: float = np.inf, pauses: Sequence[tuple[float, float]] = ()
    ) -> None:
        """Store the points of an attempt from MARGIN before its onset to its end, without pauses, until another begins."""
        with self._lock:
            points = self._attempt if onset == self._onset else self._points
            self._attempt = [
                p
                for p in points
                if onset - MARGIN < p[0] <= end
                and not any(start < p[0] <= to for start, to in pauses)
            ]
            self._onset, self._end = onset, end

    def attempted(self) -> list[tuple[float, float]]:
        """Points of the attempt, and those of MARGIN before it."""
        with self._lock:
            return list(self._attempt)

    def _clear(self) -> None:
        self._points.clear()
        self._attempt.clear()


def value_of(rows: Trajectory, what: str) -> Array:
    """The quantity for people (n,): aperture in mm, an angle in deg."""
    if what == "aperture":
        gap = rows.tips[:, FINGERS.index("thumb")] - rows.tips[:, FINGERS.index("index")]
        return np.asarray(1e3 * np.sqrt((gap**2).sum(axis=-1)))
    if what == "palm_turn":
        return np.degrees(palm_turn(rows))
    joint, _, angle = what.rpartition("_")
    angles: Array = np.degrees(rows.angles[:, JOINT[joint], ANGLES.index(angle)])
    return angles
