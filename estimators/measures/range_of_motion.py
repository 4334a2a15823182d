"""Range of motion: the largest and smallest angle of every joint that was held, not a spike.

In      a trajectory and the stretch of time of the task
Out     for every freedom of every measured joint: largest and smallest angle, when, grade
Source  at least three repetitions, active or passive (VA worksheet DVBCHTF1); "held" as the running median over `hold`, so that a spike shorter than half of
        it changes nothing, at the ends of the task too, while a slow turning point loses little (1.2 % of the amplitude at 0.5 Hz with 0.2 s)
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from estimators.hand_anatomy import ANGLES, JOINTS, SEGMENT
from estimators.measures.figure import Figure, Grade, grade_of
from estimators.options import option
from estimators.quaternions import Array
from estimators.trajectory import Flag, Trajectory

TITLE = "Range of motion"
SOURCE = "ours after VA worksheet DVBCHTF1: extremes of the running median"
UNUSABLE = np.uint8(Flag.HEADING_LOST | Flag.MISSING | Flag.SATURATED | Flag.FAULTY)


@dataclass(frozen=True, kw_only=True)
class Params:
    hold: float = option(
        0.2, "s", "window of the running median: an angle counts when it lasts half of this", "ours: estimators/measures/range_of_motion.py"
    )


@dataclass(frozen=True)
class Range:
    """Extremes of one freedom of one joint."""

    joint: str
    angle: str
    largest: float  # rad
    smallest: float  # rad
    t_largest: float  # s
    t_smallest: float  # s
    grade: Grade
    reason: str

    @property
    def extent(self) -> float:
        return self.largest - self.smallest


def applies(task_name: str) -> bool:
    """Every task but tapping, whose small range says nothing about the joints."""
    return "tap" not in task_name.lower()


def measure(params: Params, trajectory: Trajectory, onset: float, end: float, geometry: object = None) -> list[Range]:
    """Ranges within [onset, end] of all joints that were measured there; unusable samples are left out of the extremes."""
    part = trajectory.between(onset, np.nextafter(end, np.inf))
    if len(part) < 3:
        return []
    period = float(np.median(np.diff(part.t)))
    window = max(1, round(params.hold / period)) | 1
    found = []
    for j, joint in enumerate(JOINTS):
        flags = part.flags[:, [SEGMENT[joint.parent], SEGMENT[joint.child]]]
        usable = ((flags & UNUSABLE) == 0).all(axis=1)
        for a in joint.dofs:
            held = _held(part.angles[:, j, a], usable, window)
            if held is None:
                continue
            high, low = int(np.nanargmax(held)), int(np.nanargmin(held))
            found.append(
                Range(joint.name, ANGLES[a], float(held[high]), float(held[low]), float(part.t[high]), float(part.t[low]), *grade_of(flags))
            )
    return found


def figures(ranges: list[Range]) -> list[Figure]:
    """The flat list of figures."""
    made = []
    for r in ranges:
        for word, value in (("max", r.largest), ("min", r.smallest), ("range", r.extent)):
            made.append(Figure(f"{r.joint}_{r.angle}_{word}", value, "rad", SOURCE, None, r.grade, r.reason))
    return made


def _held(angle: Array, usable: np.ndarray, window: int) -> Array | None:
    """The running median over usable samples, NaN where the window is not full; None where there are too few."""
    good = np.flatnonzero(usable & np.isfinite(angle))
    if len(good) < window:
        return None
    held, half = np.full(len(angle), np.nan), window // 2
    full = slice(half, len(good) - half)
    held[good[full]] = median_filter(angle[good], size=window)[full]
    return held
