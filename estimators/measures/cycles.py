"""Repetitive movements - taps, fists, forearm rotation -, cut into complete cycles.

In      times t (n,) s and an opening (n,) in m or rad that is smallest where a cycle begins and ends; sampled anyhow, NaN where unknown
Out     complete cycles: when, how wide, how fast; how intervals and amplitudes change; stretches of hardly any movement
Source  closings are minima of prominence >= 25 % of the 5-95 % range, at least 0.1 s apart; in a closed rest before the first or after the last opening, the
        minimum next to that opening; linear drift inside each cycle removed, so that a closing is 0: ours,
        after ReTap (Habets 2023, doi 10.3390/s23115238); interruptions and freezes: Islam 2023 (npj Digit Med 6:156), the constants of its code
Limits  a cycle smaller than a quarter of the range is not counted; a cycle with a gap longer than `max_gap` is left out of all figures
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.signal import find_peaks

from handscope.estimators.data.options import option
from handscope.estimators.errors import InputError
from handscope.estimators.measures.figure import Grade, worse
from handscope.estimators.measures.signals import Even, check_signal, resample_even, stretches
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array

DEG = np.pi / 180
ISLAM = phrase("figure_source.islam_constants")
SMALL = 0.4  # of the least prominence: a tenth of the range, movement that is seen but no cycle
OVERLOOKED = 0.1  # share of such movements from which on the trial's reason mentions them
RETAP = "ReTap (Habets 2023, doi 10.3390/s23115238)"


@dataclass(frozen=True, kw_only=True)
class Params:
    """Options of the cutting into cycles."""

    prominence: float = option(
        0.25,
        "",
        "least prominence of a closing, as a share of the 5-95 % range",
        "ours",
        least=0.01,
        most=1.0,
    )
    cycle_min: float = option(0.1, "s", "shortest cycle", "ours", least=0.01)
    smallest: float = option(
        0.005,
        "m",
        "movement smaller than this is none, where distances are measured",
        "ours: below the methods' tip error",
    )
    smallest_turn: float = option(
        5.1 * DEG,
        "rad",
        "movement smaller than this is none, where angles are measured",
        "Stamatakis 2013 (Comput Intell Neurosci 717853), smallest of 86",
    )
    lowpass: float = option(
        20.0,
        "Hz",
        "what is faster is taken for noise; 0: nothing",
        "ours: as the reference values were computed",
    )
    max_gap: float = option(
        0.1, "s", "longest hole in the samples that is bridged", "ours: the shortest cycle"
    )
    min_taps_for_decrement: int = option(8, "", "fewer cycles have no decrement", RETAP, least=2)
    ends: int = option(
        5, "", "cycles at either end that the decrement ratio compares", RETAP, least=1
    )
    first: int = option(
        10,
        "",
        "cycles that the figures of the first ones rest on",
        "MDS-UPDRS items 3.4 to 3.6: ten movements",
        least=2,
    )
    still_speed: float = option(50 * DEG, "rad/s", "slower than this is hardly any movement", ISLAM)
    interruption: float = option(
        0.2, "s", "hardly any movement for this long is an interruption", ISLAM
    )
    freeze: float = option(0.3, "s", "and for this long a freeze", ISLAM)


@dataclass(frozen=True)
class Cycles:
    """Complete cycles in order of time; `opening` is in m or rad."""

    t: Array  # (n,) s, even
    opening: Array  # (n,) NaN in holes
    closings: Array  # (m,) s, all that were found
    onsets: Array  # (k,) s, the closing at which a complete cycle begins
    ends: Array  # (k,) s, and at which it ends
    amplitudes: Array  # (k,)
    opening_speeds: Array  # (k,) per s, the fastest
    closing_speeds: Array  # (k,)
    lost: float = 0.0  # s in holes
    count_sd: float = 0.0  # how far the count hangs on the threshold
    smaller: int = 0  # movements that are too small to be cycles

    @property
    def count(self) -> int:
        return len(self.amplitudes)

    @property
    def intervals(self) -> Array:
        return self.ends - self.onsets

    @property
    def period(self) -> float:
        """s from sample to sample."""
        return float(self.t[1] - self.t[0]) if len(self.t) > 1 else float("nan")

    @property
    def rate(self) -> float:
        """Cycles per second of their own time, Hz."""
        return self.count / float(self.intervals.sum()) if self.count else float("nan")

    def first(self, n: int) -> "Cycles":
        """The first n of them."""
        each = ("onsets", "ends", "amplitudes", "opening_speeds", "closing_speeds")
        return replace(self, **{name: getattr(self, name)[:n] for name in each})


@dataclass(frozen=True)
class Stops:
    """Stretches of hardly any movement."""

    onsets: Array = field(default_factory=lambda: np.empty(0))  # s
    durations: Array = field(default_factory=lambda: np.empty(0))  # s

    def lasting(self, least: float) -> Array:
        """When those began (s) that lasted at least that long."""
        return self.onsets[self.durations >= least - 1e-9]

    def hide(self, c: Cycles) -> bool:
        """Whether a whole cycle lies within a stop: then the movement itself is hardly any, and stops cannot be told from it."""
        starts, ends = self.onsets[:, None], (self.onsets + self.durations)[:, None]
        return bool(((starts <= c.onsets + c.period) & (c.ends <= ends + c.period)).any())


def find_cycles(
    params: Params,
    t: Array,
    opening: Array,
    smallest: float,
    within: tuple[float, float] = (-np.inf, np.inf),
) -> Cycles:
    """The complete cycles between two instants; closings are found in the whole signal."""
    signal = resample_even(t, opening, params.max_gap, params.lowpass)
    closed, counts = _closings_within(params, signal, smallest, within), []
    for share in (0.8, 1.2):
        looser = _closings_within(
            replace(params, prominence=min(1.0, share * params.prominence)),
            signal,
            smallest,
            within,
        )
        counts.append(len(_complete_cycles(signal, looser)))
    small = len(
        _complete_cycles(
            signal,
            _closings_within(
                replace(params, prominence=SMALL * params.prominence), signal, smallest, within
            ),
        )
    )
    made = cycles_between(params, signal, closed)
    return replace(
        made, count_sd=0.5 * abs(counts[0] - counts[1]), smaller=max(0, small - made.count)
    )


def count_cycles(
    params: Params, t: Array, opening: Array, smallest: float, within: tuple[float, float]
) -> int:
    """How many cycles `find_cycles` finds."""
    signal = resample_even(t, opening, params.max_gap, params.lowpass)
    return len(_complete_cycles(signal, _closings_within(params, signal, smallest, within)))


def grade_cycles(c: Cycles, graded: tuple[Grade, str]) -> tuple[Grade, str]:
    """Grade and reason of a trial, with what its cycles leave out."""
    if c.count and c.smaller > OVERLOOKED * c.count:
        return worse(
            graded,
            ("fair", phrase("measure.small_movements", count=c.smaller)),
        )
    return graded


def require_fast(params: Params, t: Array, values: Array) -> None:
    """InputError where an array is sampled too slowly for the shortest cycle: most often milliseconds, or the numbers of samples, given for seconds."""
    t, values = check_signal(t, values)
    period = float(np.median(np.diff(t)))
    if period > params.cycle_min:
        raise InputError("measure.samples_too_slow", period=period, least=params.cycle_min)


def cycles_between(params: Params, signal: Even, closed: np.ndarray) -> Cycles:
    """The cycles between closings (indices) that are known already."""
    pairs = _complete_cycles(signal, closed)
    amplitudes, opening, closing = (
        np.array([_describe_cycle(signal, a, b) for a, b in pairs]).reshape(-1, 3).T
    )
    onsets, ends = (signal.t[[pair[k] for pair in pairs]] for k in (0, 1))
    return Cycles(
        signal.t,
        signal.gapped,
        signal.t[closed],
        onsets,
        ends,
        amplitudes,
        opening,
        closing,
        signal.lost,
    )


def find_closings(params: Params, signal: Even, smallest: float) -> np.ndarray:
    """Indices of the samples at which a cycle begins or ends."""
    low, high = np.percentile(signal.values[signal.known], [5, 95])
    if high - low < smallest:
        return np.empty(0, int)
    shortest = max(1, round(params.cycle_min / signal.period))
    least = params.prominence * (high - low)
    # beyond its ends the signal counts as open, so that a rest there is a minimum as well
    opened = np.pad(signal.values, 1, constant_values=low + 2 * least)
    closed = find_peaks(-opened, prominence=least, distance=shortest)[0] - 1
    last = len(signal.values) - 1
    closed = _move_to_first_opening(signal.values, closed, SMALL * least)
    return (
        last - _move_to_first_opening(signal.values[::-1], last - closed[::-1], SMALL * least)[::-1]
    )


def find_stops(
    params: Params, t: Array, angle: Array, within: tuple[float, float], share: float = 1.0
) -> Stops:
    """Stretches between two instants in which an angle (rad) changes by at most a share of `still_speed`, for `interruption` or longer."""
    signal = resample_even(t, angle, params.max_gap, params.lowpass)
    slow = (
        (np.abs(signal.slope()) <= share * params.still_speed)
        & signal.known
        & (signal.t >= within[0])
        & (signal.t <= within[1])
    )
    spans = [(signal.t[a], (b - a + 1) * signal.period) for a, b in stretches(slow)]
    long = np.array([s for s in spans if s[1] >= params.interruption - 1e-9]).reshape(-1, 2)
    return Stops(long[:, 0], long[:, 1])


def _closings_within(
    params: Params, signal: Even, smallest: float, within: tuple[float, float]
) -> np.ndarray:
    closed = find_closings(params, signal, smallest)
    t = signal.t[closed]
    return np.asarray(
        closed[(t >= within[0] - params.cycle_min) & (t <= within[1] + params.cycle_min)]
    )


def _move_to_first_opening(values: Array, closed: np.ndarray, small: float) -> np.ndarray:
    """Closings (indices) with the first at the end of the rest that it may lie in; left out where the signal begins with no minimum."""
    if len(closed) < 2:
        return closed
    first = int(closed[0])
    widest = first + int(np.argmax(values[first : closed[1]]))
    rest = 1 + np.flatnonzero(values[1:widest] <= values[first] + small)
    leaving = rest[(values[rest - 1] >= values[rest]) & (values[rest] < values[rest + 1])]
    return np.concatenate([leaving[-1:], closed[1:]])


def _complete_cycles(signal: Even, closed: np.ndarray) -> list[tuple[int, int]]:
    """Neighbouring closings without a hole between them."""
    return [
        (int(a), int(b)) for a, b in zip(closed[:-1], closed[1:]) if signal.known[a : b + 1].all()
    ]


def _describe_cycle(signal: Even, a: int, b: int) -> tuple[float, float, float]:
    """Amplitude, opening and closing speed of one cycle, linear drift removed."""
    opening = signal.values[a : b + 1]
    level = opening - np.linspace(opening[0], opening[-1], len(opening))
    top = int(np.argmax(level))
    speed = np.gradient(level, signal.period)
    return float(level[top]), float(speed[: top + 1].max()), float(-speed[top:].min())
