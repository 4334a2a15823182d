"""Circles drawn in the air with a straight index finger, from the knuckle: flexion against deviation.

In      a trajectory and the stretch of time of the task; or two angles (n,) in rad: `of_angles`
Out     turns, rate, half axes of the mean ellipse, its roundness, deviation of single turns from it
Source  task: Kortier, thesis Table 3.1, no. 15; ellipse from the covariance of both angles (a point that runs evenly round an ellipse has half its squared half axes as
        variances), rate from the angle about its centre: ours
Limits  the half axes are those of an ellipse run through evenly
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import DEVIATION, FLEXION, JOINT, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures.figure import Figure, Grade, Kind, grade_of, kinds
from handscope.estimators.measures.plot_data import Curve, PlotData
from handscope.estimators.measures.signals import resample_even
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest, words_of
from handscope.estimators.measures.time_window import task_samples
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array

TITLE = phrase("measure_title.circles")
SOURCE = phrase("figure_source.circles")
KINDS = kinds(
    Kind("circles_count", "1", phrase("figure_meaning.circles_count"), SOURCE),
    Kind("circles_rate", "Hz", phrase("figure_meaning.circles_rate"), SOURCE),
    Kind(
        "circles_long",
        "rad",
        phrase("figure_meaning.circles_long"),
        SOURCE,
    ),
    Kind("circles_short", "rad", phrase("figure_meaning.circles_short"), SOURCE),
    Kind("circles_roundness", "1", phrase("figure_meaning.circles_roundness"), SOURCE),
    Kind(
        "circles_scatter_share",
        "1",
        phrase("figure_meaning.circles_scatter_share"),
        SOURCE,
    ),
)
PART = "index_mcp"


@dataclass(frozen=True, kw_only=True)
class Params:
    """Options of the measure."""

    lowpass: float = option(10.0, "Hz", "what is faster is taken for noise", "ours", least=1.0)
    smallest: float = option(
        0.035, "rad", "a half axis below this is no circle", "ours: 2 deg, the methods' error"
    )


@dataclass(frozen=True)
class Circles:
    """Circles drawn: turns, rate, axes in rad."""

    turns: float  # NaN where not measured
    rate: float  # Hz
    long: float  # rad
    short: float
    scatter: float
    sd: float | None  # rad, of one angle
    grade: Grade
    reason: str
    curves: tuple[Curve, ...] = ()


def applies(task_name: str) -> bool:
    """Whether a task's name asks for this measure."""
    return bool(words_of(task_name) & {"circle", "circles", "circular"})


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> Circles:
    """Of the index finger's MCP joint."""
    part = task_samples(trajectory, onset, end)
    angles = part.angles[:, JOINT[PART]]
    if len(part) < 3 or np.isfinite(angles[:, [FLEXION, DEVIATION]]).all(axis=1).sum() < 3:
        return _nothing(phrase("measure.index_not_measured"))
    sd = (
        None
        if part.angles_sd is None
        else float(np.sqrt(np.nanmean(part.angles_sd[:, JOINT[PART], [FLEXION, DEVIATION]] ** 2)))
    )
    graded = grade_of(part.flags[:, [SEGMENT["hand"], SEGMENT["index_proximal"]]])
    return of_angles(part.t, angles[:, FLEXION], angles[:, DEVIATION], params, sd, graded)


def of_angles(
    t: Array,
    flexion: Array,
    deviation: Array,
    params: Params | None = None,
    sd: float | None = None,
    graded: tuple[Grade, str] = ("good", ""),
) -> Circles:
    """Circles in two angles (n,) in rad at times t (n,) s."""
    params = params or Params()
    signals = [resample_even(t, a, lowpass=params.lowpass) for a in (flexion, deviation)]
    n = min(len(s.t) for s in signals)
    xy = np.array([s.values[:n] - s.values[:n].mean() for s in signals])
    sizes, axes = np.linalg.eigh(np.cov(xy))
    short, long = (float(np.sqrt(2 * max(v, 0.0))) for v in sizes)
    curves = tuple(
        Curve(f"{PART}_{name}", "rad", s.t, s.values)
        for name, s in zip(("flexion", "deviation"), signals)
    )
    if short < params.smallest:
        return Circles(
            0.0,
            np.nan,
            long,
            short,
            np.nan,
            sd,
            "poor",
            phrase("measure.no_circle"),
            curves,
        )
    unit = axes.T @ xy / np.array([[short], [long]])  # on the mean ellipse of length 1
    turned = np.unwrap(np.arctan2(unit[1], unit[0]))
    turns = abs(float(turned[-1] - turned[0])) / (2 * np.pi)
    duration = float(signals[0].t[n - 1] - signals[0].t[0])
    scatter = float(np.sqrt(np.mean((np.linalg.norm(unit, axis=0) - 1) ** 2)))
    return Circles(turns, turns / duration, long, short, scatter, sd, *graded, curves)


def figures(c: Circles) -> list[Figure]:
    """The flat list of figures; both half axes have an angle's error at either end, independent."""
    graded, axis_sd = (c.grade, c.reason), None if c.sd is None else c.sd / np.sqrt(2.0)
    round_sd = (
        None
        if axis_sd is None or not c.long > 0
        else float(axis_sd / c.long * np.hypot(1.0, c.short / c.long))
    )
    scatter_sd = c.scatter / np.sqrt(2 * max(c.turns, 1.0)) if np.isfinite(c.scatter) else None
    rows: dict[str, tuple[float, float | None]] = {
        "circles_count": (float(np.floor(c.turns + 0.05)) if np.isfinite(c.turns) else np.nan, 0.0),
        "circles_rate": (
            c.rate,
            c.rate / max(c.turns, 1.0) * c.scatter / (2 * np.pi) if np.isfinite(c.rate) else None,
        ),
        "circles_long": (c.long, axis_sd),
        "circles_short": (c.short, axis_sd),
        "circles_roundness": (c.short / c.long if c.long > 0 else np.nan, round_sd),
        "circles_scatter_share": (c.scatter, scatter_sd),
    }
    return [KINDS[what].of(value, sd, *graded, PART) for what, (value, sd) in rows.items()]


def shown(c: Circles) -> PlotData:
    """Both angles over time."""
    return PlotData(c.curves)


def _nothing(reason: str) -> Circles:
    return Circles(np.nan, np.nan, np.nan, np.nan, np.nan, None, "poor", reason)
