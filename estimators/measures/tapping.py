"""Finger tapping: from the distance between the ends of thumb and index finger, from an opening angle, or from two gyroscopes.

In      a trajectory and the stretch of time of the trial; or plain arrays: `of_distance`, `of_angle` (a camera's), `of_rates` (gyroscopes on both nails)
Out     taps (complete opening-closing cycles): count, rate, intervals, amplitudes in m and rad, opening and closing speeds, decrement, fatigue, interruptions, freezes
Source  cycles.py and cycle_figures.py. The angle in rad is how far thumb and index finger turn against each other: the sum of the angular rates of their last
        phalanges (against the hand, where that is measured), each about its principal axis, as the reference values of the ETF database were computed.
        Interruptions are looked for in the angle thumb tip - wrist - index tip, as Islam 2023 has them in the image, from the first closing to
        the end of the trial; in plain arrays, which do not say when a trial ended, to the last closing
Limits  a tap smaller than a quarter of the trial's range is not counted
"""

from dataclasses import dataclass, field, replace

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import (
    CHAINS,
    FINGER_JOINTS,
    FINGERS,
    FLEXION,
    JOINT,
    SEGMENT,
)
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures import cycle_figures, cycles
from handscope.estimators.measures.cycle_figures import (
    CycleWords,
    size_kinds,
    stop_kinds,
    time_kinds,
)
from handscope.estimators.measures.cycles import Cycles, Params, Stops
from handscope.estimators.measures.figure import Figure, Grade, grade_of, kinds
from handscope.estimators.measures.plot_data import Curve, PlotData
from handscope.estimators.measures.signals import Even, angular_rates, resample_even
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest
from handscope.estimators.messages.sentence import join, phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

TITLE = phrase("measure_title.tapping")
MARGIN = 0.5  # s looked at before and after the trial, so that a closing at its edge is seen as one
PREFIX, ANGLE = "tapping", "tapping_angle"
TAPS = CycleWords(phrase("cycle_word.tap"), phrase("cycle_word.taps"))
TIMES = time_kinds(PREFIX, TAPS)
DISTANCES = size_kinds(PREFIX, TAPS, "m", phrase("cycle_opening.thumb_index_distance"))
ANGLES = size_kinds(ANGLE, TAPS, "rad", phrase("cycle_opening.thumb_index_turn"))
STOPS = stop_kinds(PREFIX, phrase("cycle_angle.thumb_index"))
KINDS = kinds(*TIMES.values(), *DISTANCES.values(), *ANGLES.values(), *STOPS.values())
# factors on the speed that counts as hardly any movement: 1, and two that show how the counts
# depend on it
STILL = 1.0, 0.8, 1.2
LONGEST, WIDEST = 0.4, 2 * np.pi  # m and rad that no hand opens by
NOT_MEASURED, NO_TAP = phrase("measure.thumb_or_index_not_measured"), phrase("measure.no_tap")

__all__ = [
    "Params",
    "Tapping",
    "applies",
    "count",
    "figures",
    "measure",
    "of_angle",
    "of_distance",
    "of_rates",
    "shown",
]


@dataclass(frozen=True)
class Tapping:
    """One trial; arrays are per tap, in order."""

    t: Array  # (n,) s, samples of the trial
    distance: Array  # (n,) m between the bone ends; NaN where only an angle is known
    closings: Array  # s
    amplitudes: Array  # (taps,) m; rad where only an angle is known
    opening_speeds: Array  # (taps,) m/s, or rad/s
    closing_speeds: Array  # (taps,)
    decrement_slope: float  # m per tap, or rad; NaN with too few taps
    decrement_ratio: float  # (last five - first five) / first five
    grade: Grade
    reason: str
    params: Params = field(default_factory=Params)
    taps: Cycles | None = None  # of the distance
    turns: Cycles | None = None  # of the angle, where one is known
    # at STILL times the threshold speed; none where no angle is known
    stops: tuple[Stops, ...] = ()
    distance_sd: float | None = None  # m, of the error at one instant
    angle_sd: float | None = None  # rad

    @property
    def cycles(self) -> Cycles | None:
        """The cycles of the distance, else of the angle."""
        return self.taps or self.turns

    @property
    def count(self) -> int:
        """Number of taps."""
        return len(self.amplitudes)

    @property
    def intervals(self) -> Array:
        """Time (taps,) s from closing to closing."""
        return self.cycles.intervals if self.cycles else np.diff(self.closings)

    @property
    def rate(self) -> float:
        """Taps per second of the time that complete taps took, Hz."""
        return self.count / float(self.intervals.sum()) if self.count else float("nan")


def applies(task_name: str) -> bool:
    """Whether a task's name asks for this measure."""
    return "tap" in task_name.lower()


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> Tapping:
    """Taps within [onset, end]."""
    part = trajectory.between(onset - MARGIN, end + MARGIN)
    tips = part.tips[:, [FINGERS.index("thumb"), FINGERS.index("index")]]
    offset = tips[:, 0] - tips[:, 1]
    distance = np.sqrt((offset**2).sum(axis=-1))
    segments = [SEGMENT[s] for f in ("thumb", "index") for s in CHAINS[f]]
    inside = (part.t >= onset) & (part.t <= end)
    grade = grade_of(part.flags[inside][:, segments])
    if np.isfinite(distance).sum() < 3:
        return _without_taps(params, part.t[inside], distance[inside], NOT_MEASURED)
    signal = resample_even(part.t, distance, params.max_gap, params.lowpass)
    taps = cycles.find_cycles(params, part.t, distance, params.smallest, (onset, end))
    if not taps.count:
        return _without_taps(params, part.t[inside], distance[inside], NO_TAP)
    turned = _relative_turn(params, part, signal)
    turns = (
        cycles.cycles_between(
            params, turned, np.searchsorted(signal.t, taps.closings - 0.5 * signal.period)
        )
        if turned is not None
        else None
    )
    seen = _angle_from_wrist(tips)
    stops = (
        tuple(
            cycles.find_stops(params, part.t, seen, (float(taps.closings[0]), end), share)
            for share in STILL
        )
        if np.isfinite(seen).sum() >= 3
        else ()
    )
    return _make_trial(
        params,
        part.t[inside],
        distance[inside],
        taps,
        turns,
        stops,
        grade,
        _distance_sd(part, offset),
        _angle_sd(part),
    )


def count(params: Params, t: Array, distance: Array, onset: float, end: float) -> int:
    """How many taps `measure` finds within [onset, end] in a distance (n,) in m that reaches MARGIN beyond."""
    return cycles.count_cycles(params, t, distance, params.smallest, (onset, end))


def of_distance(
    t: Array, distance: Array, params: Params | None = None, sd: float | None = None
) -> Tapping:
    """Taps in a distance (n,) in m between thumb and index finger at times t (n,) s; `sd` is that of its error."""
    cycles.require_fast(params or Params(), t, distance)
    _require_unit(distance, LONGEST, "distance", "metres")
    return _measure_signal(params or Params(), t, distance, "m", sd)


def of_angle(
    t: Array, angle: Array, params: Params | None = None, sd: float | None = None
) -> Tapping:
    """Taps in an opening angle (n,) in rad: of a camera, the angle thumb tip - wrist - index tip."""
    cycles.require_fast(params or Params(), t, angle)
    _require_unit(angle, WIDEST, "angle", "radians")
    return _measure_signal(params or Params(), t, angle, "rad", sd)


def of_rates(
    t: Array, thumb: Array, index: Array, params: Params | None = None, sd: float | None = None
) -> Tapping:
    """Taps in the angular rates of thumb and index finger, rad/s: (n, 3) as the gyroscopes read, or (n,) about the joints' axis, opening positive."""
    params = params or Params()
    opening = opening_of_rates(params, t, thumb, index)
    cycles.require_fast(params, opening.t, opening.values)
    # the rates were filtered
    return _measure_signal(replace(params, lowpass=0.0), opening.t, opening.gapped, "rad", sd)


def opening_of_rates(params: Params, t: Array, thumb: Array, index: Array) -> Even:
    """How far thumb and index finger have turned apart, rad: the integral of both rates about their principal axes; smallest where they close."""
    thumb, index = (np.asarray(w, float) for w in (thumb, index))
    if (
        len(np.atleast_1d(t)) != len(np.atleast_1d(thumb))
        or thumb.shape != index.shape
        or thumb.ndim not in (1, 2)
        or (thumb.ndim == 2 and thumb.shape[1] != 3)
    ):
        raise InputError(
            "measure.finger_rates_shape",
            t=np.size(t),
            shape=str(thumb.shape),
            shape2=str(index.shape),
        )
    known = np.asarray(np.isfinite(np.column_stack([thumb, index])).all(axis=1))
    if known.sum() < 3:
        raise InputError("measure.finger_rates_too_short", known=int(known.sum()))
    rates = [_about_principal(params, t, w, known) for w in (thumb, index)]
    both = rates[0].values - rates[0].values.mean(), rates[1].values - rates[1].values.mean()
    aligned = thumb.ndim == 1
    rate = both[0] + (1.0 if aligned or both[0] @ both[1] >= 0 else -1.0) * both[1]
    if not aligned:
        rate = rate * _impact_sign(rate)
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (rate[:-1] + rate[1:])) * rates[0].period])
    return Even(rates[0].t, angle, rates[0].known, rates[0].period)


def figures(tapping: Tapping) -> list[Figure]:
    """All figures as a flat list; of plain arrays those that can be computed from them."""
    graded, c, p = (tapping.grade, tapping.reason), tapping.cycles, tapping.params
    if c is None:
        return []
    made = cycle_figures.time_figures(p, TIMES, PREFIX, c, graded)
    if tapping.taps:
        made += cycle_figures.size_figures(
            p, DISTANCES, PREFIX, tapping.taps, tapping.distance_sd, graded
        )
    if tapping.turns:
        made += cycle_figures.size_figures(
            p, ANGLES, ANGLE, tapping.turns, tapping.angle_sd, graded
        )
    if tapping.stops and c.count:
        made += cycle_figures.stop_figures(p, STOPS, PREFIX, c, tapping.stops, graded)
    elif tapping.taps:
        reason = tapping.reason or phrase("measure.angle_needed")
        made += [k.of(np.nan, None, "poor", reason) for k in STOPS.values()]
    return made


def shown(tapping: Tapping) -> PlotData:
    """The opening over time with closings and freezes, and the amplitude of every tap."""
    c = tapping.cycles
    if c is None or not len(tapping.t):
        return PlotData()
    number = np.arange(1.0, c.count + 1)
    unit, name = ("m", "tapping_distance") if tapping.taps else ("rad", "tapping_opening")
    curves = [
        Curve(name, unit, c.t, c.opening),
        Curve("tapping_amplitude", unit, number, c.amplitudes, "1"),
    ]
    if tapping.taps and tapping.turns and tapping.turns.count == c.count:
        curves.append(
            Curve("tapping_angle_amplitude", "rad", number, tapping.turns.amplitudes, "1")
        )
    marks = {"closing": tapping.closings}
    if tapping.stops and not tapping.stops[0].hide(c):
        marks["freeze"] = tapping.stops[0].lasting(tapping.params.freeze)
    return PlotData(tuple(curves), marks)


def _measure_signal(
    params: Params, t: Array, values: Array, unit: str, sd: float | None
) -> Tapping:
    """Taps in a distance (unit "m") or an angle ("rad") alone, with `sd` of its error."""
    distance = unit == "m"
    c = cycles.find_cycles(params, t, values, params.smallest if distance else params.smallest_turn)
    lost = c.lost / max(len(c.t) * c.period, 1e-9)
    grade: tuple[Grade, str] = (
        ("good", "")
        if not lost
        else (
            "fair" if lost <= 0.2 else "poor",
            phrase("measure.time_without_samples", share=100 * lost),
        )
    )
    tapped = (float(c.closings[0]), float(c.closings[-1])) if c.count else (0.0, 0.0)
    stops = (
        ()
        if distance
        else tuple(cycles.find_stops(params, t, values, tapped, share) for share in STILL)
    )
    grade = ("poor", join([NO_TAP, grade[1]])) if not c.count else grade
    samples = np.asarray(t, float)
    drawn = np.asarray(values, float) if distance else np.full(len(samples), np.nan)
    return _make_trial(
        params,
        samples,
        drawn,
        c if distance else None,
        None if distance else c,
        stops,
        grade,
        sd if distance else None,
        None if distance else sd,
    )


def _require_unit(values: Array, most: float, what: str, unit: str) -> None:
    """InputError where an opening is wider than any hand's: millimetres or degrees given for metres or radians."""
    low, high = np.nanpercentile(np.asarray(values, float), [5, 95])
    if high - low > most:
        raise InputError("measure.aperture_implausible", what=what, high=high - low, unit=unit)


def _make_trial(  # noqa: PLR0913
    params: Params,
    t: Array,
    distance: Array,
    taps: Cycles | None,
    turns: Cycles | None,
    stops: tuple[Stops, ...],
    graded: tuple[Grade, str],
    distance_sd: float | None = None,
    angle_sd: float | None = None,
) -> Tapping:
    c = taps or turns
    assert c is not None
    graded = cycles.grade_cycles(c, graded)
    slope, ratio = cycle_figures.decrement(params, c.amplitudes)
    each = (c.closings, c.amplitudes, c.opening_speeds, c.closing_speeds, slope, ratio)
    return Tapping(t, distance, *each, *graded, params, taps, turns, stops, distance_sd, angle_sd)


def _without_taps(params: Params, t: Array, distance: Array, reason: str) -> Tapping:
    none = np.empty(0)
    empty = Cycles(none, none, none, none, none, none, none, none)
    return _make_trial(params, t, distance, empty, empty, (), ("poor", reason))


def _relative_turn(params: Params, part: Trajectory, signal: Even) -> Even | None:
    """How far the last phalanges have turned apart, on the distance's time base and in its sense; None where they are not measured."""
    q_GH = part.q_GS[:, SEGMENT["hand"]]
    rates = []
    for finger in ("thumb", "index"):
        q = part.q_GS[:, SEGMENT[CHAINS[finger][-1]]]
        q_HS = quat.relative(q_GH, q) if np.isfinite(q_GH).all() else q
        if not np.isfinite(q_HS).all() or len(q_HS) < 3 or not (np.abs(q_HS).sum(axis=1) > 0).all():
            return None
        rates.append(angular_rates(part.t, q_HS))
    angle = opening_of_rates(params, part.t, *rates)
    values = np.interp(signal.t, angle.t, angle.values)
    sense = 1.0 if np.gradient(values) @ np.gradient(signal.values) >= 0 else -1.0
    return Even(signal.t, sense * values, signal.known, signal.period)


def _about_principal(params: Params, t: Array, rate: Array, known: np.ndarray) -> Even:
    """A gyroscope's rate about the axis about which it turned most."""
    if rate.ndim == 2 and known.any():
        spread = rate[known] - rate[known].mean(axis=0)
        rate = rate @ np.linalg.svd(spread, full_matrices=False)[2][0]
    return resample_even(t, np.where(known, rate, np.nan), params.max_gap, params.lowpass)


def _impact_sign(rate: Array) -> float:
    """+1 where the rate is positive in opening: fingers that meet stop more suddenly than fingers that open widest."""
    jerk = np.diff(rate)
    return 1.0 if ((jerk - jerk.mean()) ** 3).mean() >= 0 else -1.0


def _angle_from_wrist(tips: Array) -> Array:
    """Angle (n,) between the directions to thumb and index tip (n, 2, 3), seen from the wrist, rad."""
    across = np.linalg.norm(np.cross(tips[:, 0], tips[:, 1]), axis=-1)
    return np.asarray(np.arctan2(across, (tips[:, 0] * tips[:, 1]).sum(axis=-1)))


def _distance_sd(part: Trajectory, offset: Array) -> float | None:
    """Of the distance, from both tips' standard deviations along the line between them, rms over the trial; their errors count as independent."""
    if part.tips_sd is None:
        return None
    both = (part.tips_sd[:, [FINGERS.index("thumb"), FINGERS.index("index")]] ** 2).sum(axis=1)
    size = (offset**2).sum(axis=-1)
    known = np.isfinite(size) & (size > 0)
    return (
        float(np.sqrt(np.nanmean((offset[known] ** 2 * both[known]).sum(axis=-1) / size[known])))
        if known.any()
        else None
    )


def _angle_sd(part: Trajectory) -> float | None:
    """Of the turn against each other: of both last phalanges as of the flexions of their fingers, independent."""
    if part.angles_sd is None:
        return None
    joints = {f: [JOINT[j] for j in FINGER_JOINTS[f]] for f in ("thumb", "index")}
    return float(np.sqrt(sum((part.angles_sd[:, joints[f], FLEXION] ** 2).mean() for f in joints)))
