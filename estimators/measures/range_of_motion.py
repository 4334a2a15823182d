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
from estimators.hand_geometry import HandGeometry
from estimators.measures.asked import UNKNOWN, Asked, words_of
from estimators.measures.figure import Figure, Grade, Kind, grade_of, kinds
from estimators.measures.shown import NOTHING, Shown
from estimators.options import option
from estimators.quaternions import Array
from estimators.trajectory import Flag, Trajectory

TITLE = "Range of motion"
SOURCE = "ours after VA worksheet DVBCHTF1: extremes of the running median"
UNUSABLE = np.uint8(Flag.HEADING_LOST | Flag.MISSING | Flag.SATURATED | Flag.FAULTY)
WORDS = {"max": "the largest {} held", "min": "the smallest {} held", "range": "from the smallest to the largest {} held"}
KINDS = kinds(*(Kind(f"{a}_{end}", "rad", words.format(a), SOURCE) for a in ANGLES for end, words in WORDS.items()))
ELSEWHERE = frozenset({"tremor", "check", "pinch", "reach"})  # tasks that move joints little, or not for their range


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
    sd_largest: float | None = None  # rad, of the error at the largest angle; None: not known
    sd_smallest: float | None = None

    @property
    def extent(self) -> float:
        return self.largest - self.smallest


def applies(task_name: str) -> bool:
    """Every task but those whose small range says nothing about the joints: tapping, tremor, pinch, contacts, reach."""
    return "tap" not in task_name.lower() and not words_of(task_name) & ELSEWHERE


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: Asked = UNKNOWN,
) -> list[Range]:
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
            ends = (float(held[high]), float(held[low]), float(part.t[high]), float(part.t[low]))
            sds = (None, None) if part.angles_sd is None else (float(part.angles_sd[high, j, a]), float(part.angles_sd[low, j, a]))
            found.append(Range(joint.name, ANGLES[a], *ends, *grade_of(flags), *sds))
    return found


def figures(ranges: list[Range]) -> list[Figure]:
    """The flat list of figures; the errors of a range's two ends count as independent."""
    made = []
    for r in ranges:
        both = None if r.sd_largest is None or r.sd_smallest is None else float(np.hypot(r.sd_largest, r.sd_smallest))
        for end, value, sd in (("max", r.largest, r.sd_largest), ("min", r.smallest, r.sd_smallest), ("range", r.extent, both)):
            made.append(KINDS[f"{r.angle}_{end}"].of(value, sd, r.grade, r.reason, r.joint))
    return made


def shown(ranges: list[Range]) -> Shown:
    """Nothing: a page has the angles themselves."""
    return NOTHING


def _held(angle: Array, usable: np.ndarray, window: int) -> Array | None:
    """The running median over usable samples, NaN where the window is not full; None where there are too few."""
    good = np.flatnonzero(usable & np.isfinite(angle))
    if len(good) < window:
        return None
    held, half = np.full(len(angle), np.nan), window // 2
    full = slice(half, len(good) - half)
    held[good[full]] = median_filter(angle[good], size=window)[full]
    return held
