"""The live curve of the quantity under test: aperture between thumb and index tip, or one joint angle."""

import threading
from collections import deque

import numpy as np

from estimators.hand_anatomy import ANGLES, FINGERS, JOINT
from estimators.quaternions import Array
from estimators.trajectory import Trajectory

LENGTH = 20.0  # s kept
SPACING = 1 / 60  # s between two points
DEFAULT = "aperture"


class Curve:
    """Points (t in s, value in mm or deg) of the newest LENGTH seconds; written by the tracker, read by viewers."""

    def __init__(self) -> None:
        self.what = DEFAULT
        self._points: deque[tuple[float, float]] = deque()
        self._lock = threading.Lock()

    @property
    def unit(self) -> str:
        return "mm" if self.what == "aperture" else "deg"

    @property
    def title(self) -> str:
        return "Thumb to index finger" if self.what == "aperture" else self.what.replace("_", " ")

    def follow(self, what: str | None) -> None:
        """Show another quantity from now on."""
        with self._lock:
            if what is not None and what != self.what:
                self.what = what
                self._points.clear()

    def add(self, rows: Trajectory) -> None:
        """Take new rows of the trajectory."""
        values = value_of(rows, self.what)
        with self._lock:
            for t, value in zip(rows.t, values):
                if np.isfinite(value) and (not self._points or t - self._points[-1][0] >= SPACING or t < self._points[-1][0]):
                    if self._points and t < self._points[-1][0]:
                        self._points.clear()
                    self._points.append((float(t), round(float(value), 2)))
            while self._points and self._points[0][0] < rows.t[-1] - LENGTH:
                self._points.popleft()

    def since(self, t: float) -> list[tuple[float, float]]:
        """Points later than t."""
        with self._lock:
            return [p for p in self._points if p[0] > t]


def value_of(rows: Trajectory, what: str) -> Array:
    """The quantity for people (n,): aperture in mm, an angle in deg."""
    if what == "aperture":
        gap = rows.tips[:, FINGERS.index("thumb")] - rows.tips[:, FINGERS.index("index")]
        return np.asarray(1e3 * np.sqrt((gap**2).sum(axis=-1)))
    joint, _, angle = what.rpartition("_")
    angles: Array = np.degrees(rows.angles[:, JOINT[joint], ANGLES.index(angle)])
    return angles
