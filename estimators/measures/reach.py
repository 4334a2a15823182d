"""Reaching: how long, how smooth, and how the hand opens on the way.

In      a trajectory, the stretch of time of the task; marks `reach` where it was called, else the whole stretch is one reach
Out     means over the reaches: movement time, peak speed, when it is reached, smoothness (SPARC, LDLJ), how far the hand turned, grip aperture
Source  start and end at 2 % of the peak speed, time to peak: drinking task (Alt Murphy; JNER 2021, 10.1186/s12984-021-00895-3, Table 2); grip aperture: Valevicius 2018
        (PLoS ONE 0199549); SPARC and LDLJ: smoothness.py
        position of the hand by a magnet: reach_place.py
Limits  a glove alone gives no position: speed is the hand's angular speed; where the hand hardly turns, that of the fingertips against the wrist, as it opens and closes
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import FINGERS, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures import reach_place
from handscope.estimators.measures.figure import Figure, Grade, Kind, grade_of, kinds, worse
from handscope.estimators.measures.plot_data import Curve, PlotData
from handscope.estimators.measures.reach_place import PlaceMeasure, ReachPlaces
from handscope.estimators.measures.signals import Even, angular_rates, resample_even
from handscope.estimators.measures.smoothness import log_dimensionless_jerk, sparc
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest, words_of
from handscope.estimators.measures.time_window import task_samples
from handscope.estimators.measures.trunk_displacement import declared_height
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array

TITLE = phrase("measure_title.reach")
DRINKING = phrase("figure_source.drinking_turn")
BALASUBRAMANIAN = phrase("figure_source.sparc_turn")
FINGERTIPS = phrase("measure.from_fingertip_speed")
VALEVICIUS = "Valevicius 2018 (PLoS ONE 0199549)"
OWN = kinds(
    Kind("reach_count", "1", phrase("figure_meaning.reach_count"), phrase("figure_source.ours")),
    Kind(
        "reach_time",
        "s",
        phrase("figure_meaning.reach_time"),
        DRINKING,
    ),
    Kind("reach_peak_speed", "rad/s", phrase("figure_meaning.reach_peak_speed"), DRINKING),
    Kind("reach_peak_share", "1", phrase("figure_meaning.reach_peak_share"), DRINKING),
    Kind(
        "reach_path",
        "rad",
        phrase("figure_meaning.reach_path"),
        phrase("figure_source.angular_path"),
    ),
    Kind(
        "reach_sparc",
        "1",
        phrase("figure_meaning.reach_sparc"),
        BALASUBRAMANIAN,
    ),
    Kind(
        "reach_ldlj",
        "1",
        phrase("figure_meaning.reach_ldlj"),
        BALASUBRAMANIAN,
    ),
    Kind(
        "reach_aperture_max",
        "m",
        phrase("figure_meaning.reach_aperture_max"),
        VALEVICIUS,
    ),
    Kind(
        "reach_aperture_share",
        "1",
        phrase("figure_meaning.reach_aperture_share"),
        VALEVICIUS,
    ),
)
KINDS = {**OWN, **reach_place.KINDS}


@dataclass(frozen=True, kw_only=True)
class Params(PlaceMeasure):
    """Options of the measure."""

    threshold: float = option(
        0.02,
        "",
        "share of the peak speed at which a movement begins and ends",
        DRINKING,
        least=0.001,
        most=0.5,
    )
    lowpass: float = option(
        10.0,
        "Hz",
        "what is faster is taken for noise",
        "ours: the highest frequency of SPARC",
        least=2.0,
    )
    smallest: float = option(
        0.35, "rad/s", "a peak speed of the hand below this is no reach", "ours: 20 deg/s"
    )
    smallest_tips: float = option(
        0.02,
        "m/s",
        "a peak speed of the fingertips below this is none",
        "drinking task (JNER 2021): movement units above 20 mm/s",
    )
    highest: float = option(
        10.0,
        "Hz",
        "highest frequency of SPARC",
        "Balasubramanian, Python; 20 in his Matlab",
        least=1.0,
    )


@dataclass(frozen=True)
class SingleReach:
    """One reach."""

    onset: float  # s
    end: float  # s
    values: dict[str, float]  # by what, without reach_


@dataclass(frozen=True)
class Reach:
    """Reaches with their speed (m/s) and opening of the hand, graded."""

    reaches: tuple[SingleReach, ...]
    relative_sd: float  # of an angular speed
    aperture_sd: float | None  # m
    turned: bool  # whether speed is the hand's angular speed, else that of the fingertips against the wrist
    grade: Grade
    reason: str
    t: Array
    speed: Array  # (n,) rad/s, or m/s
    where: ReachPlaces | None = None  # from the position of the hand by a magnet


def applies(task_name: str) -> bool:
    """Whether a task's name asks for this measure."""
    return "reach" in words_of(task_name)


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> Reach:
    """Every reach that was called."""
    part, none = task_samples(trajectory, onset, end), np.empty(0)
    q = part.q_GS[:, SEGMENT["hand"]]
    if len(part) < 3 or np.isfinite(q).all(axis=1).sum() < 3:
        return Reach((), 0.0, None, True, "poor", phrase("measure.hand_not_measured"), none, none)
    signal = resample_even(
        part.t, np.linalg.norm(angular_rates(part.t, q), axis=1), lowpass=params.lowpass
    )
    tips = part.tips[:, [FINGERS.index("thumb"), FINGERS.index("index")]]
    offset = tips[:, 0] - tips[:, 1]
    aperture = np.interp(signal.t, part.t, np.sqrt((offset**2).sum(axis=-1)))
    spans = [(m.onset, m.end) for m in asked.marks if m.phase == "reach"] or [(onset, end)]
    reaches, turned = _find_reaches(params, signal, aperture, spans, params.smallest), True
    if not reaches and np.isfinite(tips).all(axis=(1, 2)).sum() >= 3:
        speed = np.linalg.norm(np.gradient(tips.mean(axis=1), part.t, axis=0), axis=1)
        signal, turned = resample_even(part.t, speed, lowpass=params.lowpass), False
        reaches = _find_reaches(
            params,
            signal,
            np.interp(signal.t, part.t, np.sqrt((offset**2).sum(axis=-1))),
            spans,
            params.smallest_tips,
        )
    sd = None
    if part.tips_sd is not None:
        both = np.sqrt(
            (part.tips_sd[:, [FINGERS.index("thumb"), FINGERS.index("index")]] ** 2)
            .sum(axis=1)
            .mean(axis=-1)
        )
        sd = float(np.nanmean(both)) if np.isfinite(both).any() else None
    graded: tuple[Grade, str] = ("poor", phrase("measure.hand_hardly_moved"))
    if reaches:
        graded = grade_of(part.flags[:, [SEGMENT["hand"]]])
        graded = graded if turned else worse(graded, ("fair", FINGERTIPS))
    where = reach_place.measure_places(
        params,
        part,
        spans,
        lambda t, speed, smallest: _as_stretch(of_speed(params, t, speed, None, smallest)),
        declared_height(asked.details),
    )
    # 1 %: a gyroscope's scale
    return Reach(tuple(reaches), 0.01, sd, turned, *graded, signal.t, signal.values, where)


def _as_stretch(reach: SingleReach | None) -> reach_place.Found | None:
    return None if reach is None else (reach.onset, reach.end, reach.values)


def _find_reaches(
    params: Params,
    signal: Even,
    aperture: Array,
    spans: Sequence[tuple[float, float]],
    smallest: float,
) -> list[SingleReach]:
    reaches = []
    for a, b in spans:
        inside = (signal.t >= a) & (signal.t <= b)
        if inside.sum() >= 8 and signal.known[inside].all():
            reach = of_speed(
                params, signal.t[inside], signal.values[inside], aperture[inside], smallest
            )
            reaches += [reach] if reach else []
    return reaches


def of_speed(
    params: Params, t: Array, speed: Array, aperture: Array | None = None, smallest: float = 0.0
) -> SingleReach | None:
    """One reach in a speed (n,) on an even grid t (n,) s; None where nothing moved."""
    peak = int(np.argmax(speed))
    least = params.threshold * speed[peak]
    if not speed[peak] > smallest:
        return None
    slow = speed < least
    before, after = np.flatnonzero(slow[:peak]), np.flatnonzero(slow[peak:])
    a = int(before[-1]) if len(before) else 0
    b = peak + int(after[0]) if len(after) else len(t) - 1
    if b - a < 8:
        return None
    period, profile = float(t[1] - t[0]), speed[a : b + 1]
    time = float(t[b] - t[a])
    values = {
        "time": time,
        "peak_speed": float(speed[peak]),
        "peak_share": float((t[peak] - t[a]) / time),
        "path": float(profile.sum() * period),
        "sparc": sparc(profile, 1 / period, params.highest),
        "ldlj": log_dimensionless_jerk(profile, 1 / period),
    }
    if aperture is not None and np.isfinite(aperture[a : b + 1]).all():
        widest = a + int(np.argmax(aperture[a : b + 1]))
        values |= {
            "aperture_max": float(aperture[widest]),
            "aperture_share": float((t[widest] - t[a]) / time),
        }
    return SingleReach(float(t[a]), float(t[b]), values)


def figures(r: Reach) -> list[Figure]:
    """The flat list of figures: means over the reaches, with the standard error of their scatter and the instrument's."""
    graded, made = (
        (r.grade, r.reason),
        [OWN["reach_count"].of(float(len(r.reaches)), 0.0, r.grade, r.reason)],
    )
    for kind in list(OWN.values())[1:]:
        each = np.array(
            [
                w.values[what]
                for w in r.reaches
                if (what := kind.what.removeprefix("reach_")) in w.values
            ]
        )
        each = each[np.isfinite(each)] if r.turned or not kind.unit.startswith("rad") else each[:0]
        mean = float(each.mean()) if len(each) else np.nan
        own = (
            r.aperture_sd
            if kind.unit == "m"
            else r.relative_sd * abs(mean)
            if kind.unit.startswith("rad")
            else 0.0
        )
        scatter = float(each.std(ddof=1) / np.sqrt(len(each))) if len(each) > 1 else None
        sd = None if scatter is None and not own else float(np.hypot(scatter or 0.0, own or 0.0))
        made.append(kind.of(mean, sd, *graded))
    of_place = reach_place.figures(r.where)
    # metres first, where there are any
    return [*made, *of_place] if r.where is None else [made[0], *of_place, *made[1:]]


def shown(r: Reach) -> PlotData:
    """The hand's angular speed with the beginnings and ends of the reaches."""
    if not len(r.t):
        return PlotData()
    marks = {
        "movement_start": np.array([w.onset for w in r.reaches]),
        "movement_end": np.array([w.end for w in r.reaches]),
    }
    curve = (
        Curve("hand_speed", "rad/s", r.t, r.speed)
        if r.turned
        else Curve("fingertip_speed", "m/s", r.t, r.speed)
    )
    if r.where is None:
        return PlotData((curve,), marks)
    of_trunk = (
        Curve("hand_distance", "m", r.where.t, r.where.distance),
        Curve("trunk_forward", "m", r.where.t, r.where.forward),
    )
    return PlotData((curve, *of_trunk), marks)
