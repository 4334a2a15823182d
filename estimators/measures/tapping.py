"""Finger tapping from the distance between the ends of the thumb's and the index finger's bones.

In      a trajectory and the stretch of time of the trial
Out     taps (complete opening-closing cycles): count, rate, intervals, amplitudes, opening and closing speeds, decrement
Source  cycles and closures as in ReTap (Habets 2023, doi 10.3390/s23115238); ours: closings are minima of prominence >= 25 % of the 5-95 % range, at
        least 0.1 s apart, linear drift inside each cycle removed so that closure is 0; decrement slope by ordinary least squares (Ling 2012, Djuric-Jovicic 2016), ratio of last and first five (ReTap)
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks

from estimators.hand_anatomy import CHAINS, FINGERS, SEGMENT
from estimators.measures.figure import Figure, Grade, grade_of
from estimators.options import option
from estimators.quaternions import Array
from estimators.trajectory import Trajectory

TITLE = "Finger tapping"
SOURCE = "ReTap (doi 10.3390/s23115238); Djuric-Jovicic 2016 (J Clin Neurosci 30:49)"
MARGIN = 0.5  # s looked at before and after the trial, so that a closing at its edge is seen as one


@dataclass(frozen=True, kw_only=True)
class Params:
    prominence: float = option(
        0.25, "", "least prominence of a closing, as a share of the 5-95 % range of the distance", "ours", least=0.01, most=1.0
    )
    cycle_min: float = option(0.1, "s", "shortest cycle", "ours", least=0.01)
    smallest: float = option(0.005, "m", "movement smaller than this is no tapping", "ours: below the tip error of the method")
    min_taps_for_decrement: int = option(8, "", "fewer taps have no decrement", "ReTap (doi 10.3390/s23115238)", least=2)
    ends: int = option(5, "", "taps at either end that the decrement ratio compares", "ReTap (doi 10.3390/s23115238)", least=1)


@dataclass(frozen=True)
class Tapping:
    """One trial; arrays are per tap, in order."""

    t: Array  # (n,) s, samples of the trial
    distance: Array  # (n,) m between the bone ends
    closings: Array  # (taps + 1,) s
    amplitudes: Array  # (taps,) m
    opening_speeds: Array  # (taps,) m/s
    closing_speeds: Array  # (taps,) m/s
    decrement_slope: float  # m per tap; NaN with too few taps
    decrement_ratio: float  # (last five - first five) / first five
    grade: Grade
    reason: str

    @property
    def count(self) -> int:
        return len(self.amplitudes)

    @property
    def intervals(self) -> Array:
        return np.diff(self.closings)

    @property
    def rate(self) -> float:
        """Taps per second from the first to the last closing, Hz."""
        return self.count / float(self.closings[-1] - self.closings[0]) if self.count else float("nan")


def applies(task_name: str) -> bool:
    return "tap" in task_name.lower()


def measure(params: Params, trajectory: Trajectory, onset: float, end: float, geometry: object = None) -> Tapping:
    """Taps within [onset, end]."""
    part = trajectory.between(onset - MARGIN, end + MARGIN)
    tips = part.tips[:, [FINGERS.index("thumb"), FINGERS.index("index")]]
    distance = np.sqrt(((tips[:, 0] - tips[:, 1]) ** 2).sum(axis=-1))
    segments = [SEGMENT[s] for f in ("thumb", "index") for s in CHAINS[f]]
    inside = (part.t >= onset) & (part.t <= end)
    grade, reason = grade_of(part.flags[inside][:, segments])
    if np.isfinite(distance).sum() < 3:
        return _nothing(part.t[inside], distance[inside], "thumb or index finger not measured")
    known = np.isfinite(distance)
    distance = np.interp(part.t, part.t[known], distance[known])
    closed = closings(params, part.t, distance)
    closed = closed[(part.t[closed] >= onset - params.cycle_min) & (part.t[closed] <= end + params.cycle_min)]
    cycles = [_cycle(part.t[a : b + 1], distance[a : b + 1]) for a, b in zip(closed[:-1], closed[1:])]
    if not cycles:
        return _nothing(part.t[inside], distance[inside], "no complete tap found")
    amplitudes, opening, closing = (np.array(column) for column in zip(*cycles))
    slope, ratio = _decrement(params, amplitudes)
    return Tapping(part.t[inside], distance[inside], part.t[closed], amplitudes, opening, closing, slope, ratio, grade, reason)


def figures(tapping: Tapping) -> list[Figure]:
    """The flat list of figures."""
    enough = tapping.count >= 2
    few = "" if np.isfinite(tapping.decrement_slope) else "too few taps for a decrement"
    rows: list[tuple[str, float, str, str]] = [
        ("count", float(tapping.count), "1", ""),
        ("rate", tapping.rate, "Hz", ""),
        ("interval_mean", float(tapping.intervals.mean()) if enough else np.nan, "s", ""),
        ("interval_cv", _cv(tapping.intervals), "1", ""),
        ("amplitude_mean", float(tapping.amplitudes.mean()) if tapping.count else np.nan, "m", ""),
        ("amplitude_cv", _cv(tapping.amplitudes), "1", ""),
        ("opening_speed_mean", float(tapping.opening_speeds.mean()) if tapping.count else np.nan, "m/s", ""),
        ("closing_speed_mean", float(tapping.closing_speeds.mean()) if tapping.count else np.nan, "m/s", ""),
        ("decrement_slope", tapping.decrement_slope, "m", few),
        ("decrement_ratio", tapping.decrement_ratio, "1", few),
    ]
    return [Figure(f"tapping_{name}", v, unit, SOURCE, None, tapping.grade, why or tapping.reason) for name, v, unit, why in rows]


def closings(params: Params, t: Array, distance: Array) -> np.ndarray:
    """Indices of the samples at which the fingers close: minima of a distance (n,) in m."""
    low, high = np.percentile(distance, [5, 95])
    if high - low < params.smallest:
        return np.empty(0, int)
    period = float(np.median(np.diff(t)))
    apart = max(1, round(params.cycle_min / period))
    return np.asarray(find_peaks(-distance, prominence=params.prominence * (high - low), distance=apart)[0])


def _cycle(t: Array, distance: Array) -> tuple[float, float, float]:
    """Amplitude, opening and closing speed of one cycle, linear drift removed."""
    level = distance - np.interp(t, [t[0], t[-1]], [distance[0], distance[-1]])
    top = int(np.argmax(level))
    speed = np.gradient(level, t)
    return float(level[top]), float(speed[: top + 1].max()), float(-speed[top:].min())


def _decrement(params: Params, amplitudes: Array) -> tuple[float, float]:
    n = len(amplitudes)
    if n < params.min_taps_for_decrement:
        return float("nan"), float("nan")
    slope = float(np.polynomial.polynomial.polyfit(np.arange(n), amplitudes, 1)[1])
    first, last = amplitudes[: params.ends].mean(), amplitudes[-params.ends :].mean()
    return slope, float((last - first) / first)


def _cv(values: Array) -> float:
    """Coefficient of variation: sample SD over mean; NaN with fewer than two."""
    return float(values.std(ddof=1) / values.mean()) if len(values) >= 2 else float("nan")


def _nothing(t: Array, distance: Array, reason: str) -> Tapping:
    none = np.empty(0)
    return Tapping(t, distance, none, none, none, none, float("nan"), float("nan"), "poor", reason)
