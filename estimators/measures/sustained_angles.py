"""How far something goes: the largest of an angle that was held, for measures that ask for that and nothing more.

In      a trajectory, the stretch of time of a task, the angles to look at
Out     of each the largest held value, when, its standard deviation, its grade
Source  "held" as in range_of_motion.py
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import JOINT, JOINTS, SEGMENT
from handscope.estimators.measures.figure import Figure, Grade, Kind
from handscope.estimators.measures.plot_data import Curve, PlotData
from handscope.estimators.measures.time_window import (
    grade_window,
    running_median,
    task_samples,
    usable_samples,
    window_length,
)
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array

SEGMENTS_OF = {j.name: [SEGMENT[j.parent], SEGMENT[j.child]] for j in JOINTS}


@dataclass(frozen=True, kw_only=True)
class Params:
    """Options of the measures: how long an angle must be held, s."""

    hold: float = option(
        0.2,
        "s",
        "window of the running median: an angle counts when it lasts half of this",
        "ours: as range_of_motion",
    )


@dataclass(frozen=True)
class SustainedAngle:
    """One angle's largest value; NaN where it could not be measured."""

    kind: Kind
    part: str
    value: float  # rad
    t: float  # s
    sd: float | None
    grade: Grade
    reason: str
    curve: Curve | None = None


@dataclass(frozen=True)
class Angle:
    """An angle (n,) over the task, with what it rests on."""

    kind: Kind
    part: str
    values: Array
    sd: Array | None  # (n,)
    segments: list[int]


def joint_angle(
    kind: Kind, part: str, moved: Trajectory, weights: Sequence[tuple[str, int, float]]
) -> Angle:
    """A weighted sum of joint angles (joint, angle, weight); their errors count as independent."""
    values = sum(w * moved.angles[:, JOINT[j], a] for j, a, w in weights)
    known = moved.angles_sd
    sd = (
        None
        if known is None
        else np.sqrt(sum((w * known[:, JOINT[j], a]) ** 2 for j, a, w in weights))
    )
    return Angle(
        kind,
        part,
        np.asarray(values),
        sd,
        sorted({s for j, _, _ in weights for s in SEGMENTS_OF[j]}),
    )


def largest_sustained(
    hold: float,
    trajectory: Trajectory,
    onset: float,
    end: float,
    angles: Callable[[Trajectory], list[Angle]],
) -> list[SustainedAngle]:
    """The largest held value of every angle that `angles` makes of the task's samples."""
    part = task_samples(trajectory, onset, end)
    if len(part) < 3:
        return []
    window, found = window_length(part.t, hold), []
    for a in angles(part):
        kept = running_median(a.values, usable_samples(part, a.segments), window)
        if kept is None:
            if np.isfinite(part.q_GS[:, a.segments]).any():
                found.append(
                    SustainedAngle(
                        a.kind,
                        a.part,
                        np.nan,
                        np.nan,
                        None,
                        "poor",
                        phrase("measure.no_usable_samples"),
                    )
                )
            continue
        at = int(np.nanargmax(kept))
        sd = None if a.sd is None else float(a.sd[at])
        curve = Curve(f"{a.part}_{a.kind.what}" if a.part else a.kind.what, "rad", part.t, a.values)
        found.append(
            SustainedAngle(
                a.kind,
                a.part,
                float(kept[at]),
                float(part.t[at]),
                sd,
                *grade_window(part, a.segments),
                curve,
            )
        )
    return found


def figures(found: Sequence[SustainedAngle]) -> list[Figure]:
    """The flat list of figures."""
    return [r.kind.of(r.value, r.sd, r.grade, r.reason, r.part) for r in found]


def shown(found: Sequence[SustainedAngle]) -> PlotData:
    """The angles over time."""
    return PlotData(tuple(r.curve for r in found if r.curve is not None))
