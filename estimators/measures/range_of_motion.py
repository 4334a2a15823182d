"""Range of motion: the largest and smallest angle of every joint that was held, not a spike.

In      a trajectory and the stretch of time of the task
Out     for every freedom of every measured joint: largest and smallest angle, when, grade; the smallest flexion from when extension was asked for
        (asked_extension.py), of a fist and stretch that of the stretch that gives the finger's total active motion
Source  at least three repetitions, active or passive (VA worksheet DVBCHTF1); "held" as the running median over `hold`, so that a spike shorter than half of
        it changes nothing, at the ends of the task too, while a slow turning point loses little (1.2 % of the amplitude at 0.5 Hz with 0.2 s)
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import ANGLES, FLEXION, JOINTS, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures import total_active_motion
from handscope.estimators.measures.asked_extension import extension_begin
from handscope.estimators.measures.figure import Figure, Grade, Kind, grade_of, kinds
from handscope.estimators.measures.plot_data import NOTHING, PlotData
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest, words_of
from handscope.estimators.measures.time_window import (
    least_from,
    running_median,
    task_samples,
    usable_samples,
    window_length,
)
from handscope.estimators.messages.sentence import phrase

TITLE = phrase("measure_title.range_of_motion")
SOURCE = phrase("figure_source.running_extremes")
ANGLE_WORDS = {
    "flexion": phrase("angle_word.flexion"),
    "deviation": phrase("angle_word.deviation"),
    "pronation": phrase("angle_word.pronation"),
}
KINDS = kinds(
    *(
        Kind(f"{angle}_{end}", "rad", meaning, SOURCE)
        for angle, word in ANGLE_WORDS.items()
        for end, meaning in (
            ("max", phrase("figure_meaning.angle_max", angle=word)),
            ("min", phrase("figure_meaning.angle_min", angle=word)),
            ("range", phrase("figure_meaning.angle_range", angle=word)),
        )
    )
)
ELSEWHERE = frozenset(
    {"tremor", "check", "selfcheck", "pinch", "pinches", "reach", "lift", "squeeze"}
)  # tasks that move joints little, or not for their range


@dataclass(frozen=True, kw_only=True)
class Params:
    """Options of the measure: how long an angle must be held, s."""

    hold: float = option(
        0.2,
        "s",
        "window of the running median: an angle counts when it lasts half of this",
        "ours: estimators/measures/range_of_motion.py",
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
    """Every task but those whose small range says nothing about the joints: tapping, tremor, pinch, contacts, reach, lift, squeeze."""
    return "tap" not in task_name.lower() and not words_of(task_name) & ELSEWHERE


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> list[Range]:
    """Ranges within [onset, end] of all joints that were measured there; unusable samples are left out of the extremes."""
    part = task_samples(trajectory, onset, end)
    if len(part) < 3:
        return []
    window = window_length(part.t, params.hold)
    begin, found = extension_begin(part, window, asked), []
    for j, joint in enumerate(JOINTS):
        segments = [SEGMENT[joint.parent], SEGMENT[joint.child]]
        flags, usable = part.flags[:, segments], usable_samples(part, segments)
        for a in joint.dofs:
            kept = running_median(part.angles[:, j, a], usable, window)
            if kept is None:
                continue
            high, low = int(np.nanargmax(kept)), least_from(begin if a == FLEXION else 0, kept)
            ends = (float(kept[high]), float(kept[low]), float(part.t[high]), float(part.t[low]))
            sds = (
                (None, None)
                if part.angles_sd is None
                else (float(part.angles_sd[high, j, a]), float(part.angles_sd[low, j, a]))
            )
            found.append(Range(joint.name, ANGLES[a], *ends, *grade_of(flags), *sds))
    return list(_composite_extension(found, params, trajectory, onset, end, asked))


def _composite_extension(
    ranges: list[Range],
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    asked: TaskRequest,
) -> Iterator[Range]:
    """Ranges of a fist and stretch with the extension of total active motion, so that a joint has one value; other tasks' as they are."""
    found = {}
    if total_active_motion.applies(asked.task):
        tam = total_active_motion.Params(hold=params.hold)
        for m in total_active_motion.measure(tam, trajectory, onset, end, asked=asked):
            for joint, left in m.extensions.items():
                found[joint] = (left, m.t_stretch, m.extension_sd.get(joint))
    for r in ranges:
        if r.angle == ANGLES[FLEXION] and r.joint in found:
            left, t, sd = found[r.joint]
            yield replace(r, smallest=left, t_smallest=t, sd_smallest=sd)
        else:
            yield r


def figures(ranges: list[Range]) -> list[Figure]:
    """The flat list of figures; the errors of a range's two ends count as independent."""
    made = []
    for r in ranges:
        both = (
            None
            if r.sd_largest is None or r.sd_smallest is None
            else float(np.hypot(r.sd_largest, r.sd_smallest))
        )
        for end, value, sd in (
            ("max", r.largest, r.sd_largest),
            ("min", r.smallest, r.sd_smallest),
            ("range", r.extent, both),
        ):
            made.append(KINDS[f"{r.angle}_{end}"].of(value, sd, r.grade, r.reason, r.joint))
    return made


def shown(ranges: list[Range]) -> PlotData:
    """Nothing: a page has the angles themselves."""
    return NOTHING
