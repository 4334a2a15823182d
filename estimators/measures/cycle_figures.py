"""Figures of movements there and back: rate, rhythm, size, speed, their change, and stops.

In      complete cycles (cycles.py), stretches without movement, the standard deviation of the opening's error
Out     figures, each with the standard deviation of its error
Source  named with each figure. Standard deviations are ours: a closing is known to a sample; the openings' errors at both ends of an amplitude count as
        independent, but are the same in every cycle; slopes, ratios and variations add the scatter of the cycles; counts change as their threshold is moved by a fifth
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.measures.cycles import ISLAM, RETAP, Cycles, Params, Stops
from handscope.estimators.measures.figure import Figure, Grade, Kind, kinds
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array

SLOPE = "Ling 2012 (Brain 135:1141), Djuric-Jovicic 2016 (J Clin Neurosci 30:49)"
FATIGUE = "mhealthtools (Sage Bionetworks), fatigue10, 25, 50"
HALVES = "Islam 2023 (npj Digit Med 6:156)"
FIRST = phrase("figure_source.first_ten")
SPEED = phrase("figure_source.largest_slope")
FEW = phrase("measure.too_few_taps")
FATIGUE_SHARES = (10, 25, 50)  # per cent at either end
Graded = tuple[Grade, str]


@dataclass(frozen=True)
class CycleWords:
    """What a cycle is called in the figures' definitions."""

    one: str
    several: str


def time_kinds(prefix: str, words: CycleWords) -> Mapping[str, Kind]:
    """Kinds of figures of time: rate and rhythm."""
    one, several = words.one, words.several
    return kinds(
        Kind(f"{prefix}_count", "1", phrase("figure_meaning.cycle_count", cycles=several), RETAP),
        Kind(f"{prefix}_rate", "Hz", phrase("figure_meaning.cycle_rate", cycles=several), RETAP),
        Kind(f"{prefix}_interval_mean", "s", phrase("figure_meaning.cycle_interval_mean"), RETAP),
        Kind(f"{prefix}_interval_cv", "1", phrase("figure_meaning.cycle_interval_cv"), RETAP),
        Kind(
            f"{prefix}_interval_slope",
            "s",
            phrase("figure_meaning.cycle_interval_slope", cycle=one),
            RETAP,
            detail=True,
        ),
        Kind(
            f"{prefix}_first_rate",
            "Hz",
            phrase("figure_meaning.cycle_first_rate", cycles=several),
            FIRST,
        ),
        *(
            Kind(
                f"{prefix}_fatigue{p}",
                "s",
                phrase("figure_meaning.cycle_fatigue", share=p, cycles=several),
                FATIGUE,
                detail=p != 25,
            )
            for p in FATIGUE_SHARES
        ),
    )


def size_kinds(prefix: str, words: CycleWords, unit: str, opening: str) -> Mapping[str, Kind]:
    """Kinds of figures of amplitude and speed; `opening` names what opens."""
    one, several = words.one, words.several
    return kinds(
        Kind(
            f"{prefix}_amplitude_mean",
            unit,
            phrase("figure_meaning.cycle_amplitude_mean", cycles=several, opening=opening),
            SLOPE,
        ),
        Kind(f"{prefix}_amplitude_cv", "1", phrase("figure_meaning.cycle_amplitude_cv"), SLOPE),
        Kind(
            f"{prefix}_opening_speed_mean",
            f"{unit}/s",
            phrase("figure_meaning.cycle_opening_speed_mean", cycles=several),
            SPEED,
        ),
        Kind(
            f"{prefix}_closing_speed_mean",
            f"{unit}/s",
            phrase("figure_meaning.cycle_closing_speed_mean", cycles=several),
            SPEED,
        ),
        Kind(
            f"{prefix}_decrement_slope",
            unit,
            phrase("figure_meaning.cycle_decrement_slope", cycle=one),
            SLOPE,
        ),
        Kind(
            f"{prefix}_decrement_ratio",
            "1",
            phrase("figure_meaning.cycle_decrement_ratio", cycles=several),
            RETAP,
        ),
        Kind(
            f"{prefix}_half_decrement",
            unit,
            phrase("figure_meaning.cycle_half_decrement", cycles=several),
            HALVES,
            detail=True,
        ),
        Kind(
            f"{prefix}_first_amplitude_mean",
            unit,
            phrase("figure_meaning.cycle_first_amplitude_mean", cycles=several),
            FIRST,
        ),
        Kind(
            f"{prefix}_first_decrement_slope",
            unit,
            phrase("figure_meaning.cycle_first_decrement_slope", cycle=one, cycles=several),
            FIRST,
            detail=True,
        ),
    )


def stop_kinds(prefix: str, angle: str) -> Mapping[str, Kind]:
    """Kinds of figures of interruptions and freezes of an angle."""
    return kinds(
        Kind(
            f"{prefix}_interruptions",
            "1",
            phrase("figure_meaning.cycle_interruptions", angle=angle),
            ISLAM,
        ),
        Kind(f"{prefix}_freezes", "1", phrase("figure_meaning.cycle_freezes", angle=angle), ISLAM),
        Kind(
            f"{prefix}_longest_stop",
            "s",
            phrase("figure_meaning.cycle_longest_stop", angle=angle),
            ISLAM,
        ),
    )


def time_figures(
    params: Params, kinds: Mapping[str, Kind], prefix: str, c: Cycles, graded: Graded
) -> list[Figure]:
    """Figures of rate and rhythm."""
    intervals, instant = c.intervals, np.sqrt(2.0) * c.period / np.sqrt(12.0)
    first = c.first(params.first)
    rows: dict[str, tuple[float, float | None, str]] = {
        "count": (float(c.count), c.count_sd, ""),
        "rate": (c.rate, _over(c.rate * instant, intervals.sum()), ""),
        "interval_mean": (_mean(intervals), _over(instant, len(intervals)), ""),
        "interval_cv": (_cv(intervals), _cv_sd(intervals), ""),
        "interval_slope": (*_slope(params, intervals), _few(params, c)),
        "first_rate": (
            *_first(params, c, (first.rate, _over(first.rate * instant, first.intervals.sum()))),
            _few_first(params, c),
        ),
    }
    for p in FATIGUE_SHARES:
        rows[f"fatigue{p}"] = _fatigue(params, intervals, p)
    return _figures(kinds, prefix, rows, graded)


def size_figures(
    params: Params,
    kinds: Mapping[str, Kind],
    prefix: str,
    c: Cycles,
    sd: float | None,
    graded: Graded,
) -> list[Figure]:
    """`sd` is that of the opening's error at one instant."""
    amplitudes, first = c.amplitudes, c.first(params.first).amplitudes
    mean = _mean(amplitudes)
    off = None if sd is None else float(np.sqrt(2.0) * sd)
    scale = None if off is None or not mean > 0 else off / mean  # the same for all cycles
    half = (len(amplitudes) + 1) // 2
    rows: dict[str, tuple[float, float | None, str]] = {
        "amplitude_mean": (mean, off, ""),
        "amplitude_cv": (_cv(amplitudes), _cv_sd(amplitudes), ""),
        "opening_speed_mean": (_mean(c.opening_speeds), _times(scale, _mean(c.opening_speeds)), ""),
        "closing_speed_mean": (_mean(c.closing_speeds), _times(scale, _mean(c.closing_speeds)), ""),
        "decrement_slope": (*_add_scale_error(_slope(params, amplitudes), scale), _few(params, c)),
        "decrement_ratio": (*_ratio(params, amplitudes), _few(params, c)),
        "half_decrement": (
            *_add_scale_error(_fall(params, amplitudes[:half], amplitudes[half:]), scale),
            _few(params, c),
        ),
        "first_amplitude_mean": (*_first(params, c, (_mean(first), off)), _few_first(params, c)),
        "first_decrement_slope": (
            *_first(params, c, _add_scale_error(_slope(params, first), scale)),
            _few_first(params, c),
        ),
    }
    return _figures(kinds, prefix, rows, graded)


def stop_figures(
    params: Params,
    kinds: Mapping[str, Kind],
    prefix: str,
    c: Cycles,
    each: Sequence[Stops],
    graded: Graded,
) -> list[Figure]:
    """From the stops at the threshold speed, at four and at six fifths of it; not measured where they hold whole cycles."""
    if each[0].hide(c):
        slow = phrase("measure.movement_below_stop_speed", speed=np.degrees(params.still_speed))
        return [k.of(np.nan, None, "poor", slow) for k in kinds.values()]
    longest = [float(s.durations.max(initial=0.0)) for s in each]
    rows: dict[str, tuple[float, float | None, str]] = {}
    for name, least in (("interruptions", params.interruption), ("freezes", params.freeze)):
        counts = [float(len(s.lasting(least))) for s in each]
        rows[name] = (counts[0], 0.5 * abs(counts[2] - counts[1]), "")
    rows["longest_stop"] = (longest[0], 0.5 * abs(longest[2] - longest[1]), "")
    return _figures(kinds, prefix, rows, graded)


def decrement(params: Params, amplitudes: Array) -> tuple[float, float]:
    """Slope by least squares, and ratio of the ends; NaN with too few cycles."""
    return _slope(params, amplitudes)[0], _ratio(params, amplitudes)[0]


def _figures(
    kinds: Mapping[str, Kind],
    prefix: str,
    rows: Mapping[str, tuple[float, float | None, str]],
    graded: Graded,
) -> list[Figure]:
    grade, reason = graded
    return [
        kinds[f"{prefix}_{name}"].of(
            value, sd, grade, (why if not np.isfinite(value) else "") or reason
        )
        for name, (value, sd, why) in rows.items()
    ]


def _mean(values: Array) -> float:
    return float(values.mean()) if len(values) else float("nan")


def _cv(values: Array) -> float:
    """Coefficient of variation: sample SD over mean; NaN with fewer than two."""
    return float(values.std(ddof=1) / values.mean()) if len(values) >= 2 else float("nan")


def _cv_sd(values: Array) -> float | None:
    """Standard error of a coefficient of variation of normal values."""
    cv = _cv(values)
    return float(cv * np.sqrt((0.5 + cv**2) / (len(values) - 1))) if np.isfinite(cv) else None


def _slope(params: Params, values: Array) -> tuple[float, float | None]:
    """Least squares on the number of the cycle, and its standard error."""
    n = len(values)
    if n < params.min_taps_for_decrement:
        return float("nan"), None
    number = np.arange(n) - (n - 1) / 2
    square = float(number @ number)
    slope = float(number @ values / square)
    left = values - values.mean() - slope * number
    return slope, float(np.sqrt(left @ left / (n - 2) / square)) if n > 2 else None


def _ratio(params: Params, values: Array) -> tuple[float, float | None]:
    if len(values) < params.min_taps_for_decrement:
        return float("nan"), None
    first, last = values[: params.ends], values[-params.ends :]
    a, b = first.mean(), last.mean()
    if not a > 0 or params.ends < 2:
        return (float((b - a) / a) if a > 0 else float("nan")), None
    return float((b - a) / a), float(np.hypot(_error(last) / a, b * _error(first) / a**2))


def _fall(params: Params, first: Array, last: Array) -> tuple[float, float | None]:
    """How much smaller the mean of the last is."""
    if len(first) + len(last) < params.min_taps_for_decrement:
        return float("nan"), None
    return float(first.mean() - last.mean()), float(np.hypot(_error(first), _error(last)))


def _fatigue(params: Params, intervals: Array, percent: int) -> tuple[float, float | None, str]:
    n = max(1, round(percent / 100 * len(intervals)))
    if len(intervals) < params.min_taps_for_decrement:
        return float("nan"), None, FEW
    first, last = intervals[:n], intervals[-n:]
    spread = intervals.std(ddof=1)  # of all: one or two at an end have no spread of their own
    return float(first.mean() - last.mean()), float(spread * np.sqrt(2.0 / n)), ""


def _error(values: Array) -> float:
    """Standard error of a mean."""
    return float(values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else 0.0


def _first(
    params: Params, c: Cycles, known: tuple[float, float | None]
) -> tuple[float, float | None]:
    return known if c.count >= params.first else (float("nan"), None)


def _few(params: Params, c: Cycles) -> str:
    return FEW if c.count < params.min_taps_for_decrement else ""


def _few_first(params: Params, c: Cycles) -> str:
    return phrase("measure.fewer_than", count=params.first) if c.count < params.first else ""


def _add_scale_error(
    known: tuple[float, float | None], scale: float | None
) -> tuple[float, float | None]:
    """With the error of the amplitudes' scale added to the standard error."""
    value, error = known
    return value, error if scale is None or error is None else float(np.hypot(error, scale * value))


def _times(scale: float | None, value: float) -> float | None:
    return None if scale is None else abs(scale * value)


def _over(value: float, by: float) -> float | None:
    return float(value / by) if by > 0 and np.isfinite(value) else None
