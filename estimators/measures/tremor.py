"""Tremor of the resting or the outstretched hand: at what frequency it turns to and fro, and how far.

In      a trajectory and the stretch of time of the task; or angular rates (n, 3) of one sensor: `of_rates`
Out     of the hand and of each last phalanx: peak frequency, amplitude, power about the peak, share of the time with tremor, spectrum
Source  Welch's periodogram with windows of 3 s (PMC6806079), summed over the three axes, of angular rates, which know no gravity (Elble 2016, PMC6174406);
        ratio of 4-12 to 0.5-4 Hz: PMC8960784; logarithm of the amplitude: Elble 2016. The band of 3 to 15 Hz, and that a peak stands out when the density there is
        five times what lies beside it (1 to 3 Hz away; geometric mean of both sides' medians, so that a slope is no peak), are ours
Limits  rotation only: a tremor that shifts the hand without turning it is not seen; one run says little, the amplitude varies from run to run by itself (PMC4872171)
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import welch

from handscope.estimators.data.options import option
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures.figure import Figure, Grade, Kind, grade_of, kinds
from handscope.estimators.measures.plot_data import Curve, PlotData
from handscope.estimators.measures.signals import angular_rates, resample_even
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest, words_of
from handscope.estimators.measures.time_window import task_samples
from handscope.estimators.messages.sentence import join, phrase
from handscope.estimators.numerics.typing import Array

TITLE = phrase("measure_title.tremor")
DEG = np.pi / 180
WELCH = phrase("figure_source.welch")
# and the segment whose turning is meant
PARTS = {"hand": "hand"} | {f: CHAINS[f][-1] for f in FINGERS}
NO_PEAK = phrase("measure.no_peak")
KINDS = kinds(
    Kind(
        "tremor_frequency",
        "Hz",
        phrase("figure_meaning.tremor_frequency"),
        WELCH,
    ),
    Kind(
        "tremor_amplitude",
        "rad",
        phrase("figure_meaning.tremor_amplitude"),
        WELCH,
    ),
    Kind("tremor_rate_rms", "rad/s", phrase("figure_meaning.tremor_rate_rms"), WELCH),
    Kind(
        "tremor_log_amplitude",
        "1",
        phrase("figure_meaning.tremor_log_amplitude"),
        "Elble 2016 (PMC6174406)",
        detail=True,
    ),
    Kind(
        "tremor_power_share",
        "1",
        phrase("figure_meaning.tremor_power_share"),
        "PMC6806079",
        detail=True,
    ),
    Kind(
        "tremor_time_share",
        "1",
        phrase("figure_meaning.tremor_time_share"),
        join(("PMC6806079", phrase("figure_source.peak_rule"))),
    ),
    Kind(
        "tremor_band_quotient",
        "1",
        phrase("figure_meaning.tremor_band_quotient"),
        "PMC8960784",
        detail=True,
    ),
)


@dataclass(frozen=True, kw_only=True)
class Params:
    """Options of the measure; frequencies in Hz."""

    window: float = option(3.0, "s", "length of a window", "PMC6806079", least=0.5)
    lowest: float = option(
        3.0,
        "Hz",
        "lower end of the band in which a peak is looked for",
        "ours: parkinsonian tremor begins at 3 Hz (PMC6806079)",
    )
    highest: float = option(
        15.0, "Hz", "upper end", "ours: above physiological tremor (8-12 Hz, PMC6806079)"
    )
    about: float = option(
        1.0, "Hz", "what lies this near the peak belongs to it", "ours", least=0.3
    )
    beside: float = option(
        3.0, "Hz", "and up to here lies what it is compared with", "ours", least=1.0
    )
    stands_out: float = option(
        5.0, "", "least density at the peak over that beside it", "ours", least=1.0
    )


@dataclass(frozen=True)
class Tremor:
    """Of one segment."""

    part: str
    f: Array  # (n,) Hz
    density: Array  # (n,) (rad/s)^2/Hz, all axes together
    frequency: float  # Hz; NaN where no peak stands out
    frequency_sd: float
    rate_rms: float  # rad/s
    amplitude: float  # rad
    relative_sd: float  # of rate and amplitude
    power_share: float
    time_share: float
    band_ratio: float
    windows: int
    grade: Grade
    reason: str


def applies(task_name: str) -> bool:
    """Whether a task's name asks for this measure."""
    return "tremor" in words_of(task_name)


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> list[Tremor]:
    """Of the hand and of every last phalanx that was measured."""
    part, found = task_samples(trajectory, onset, end), []
    for name, segment in PARTS.items():
        q = part.q_GS[:, SEGMENT[segment]]
        if len(part) >= 3 and np.isfinite(q).all(axis=1).sum() >= 3:
            graded = grade_of(part.flags[:, [SEGMENT[segment]]])
            found.append(_measure_segment(params, name, part.t, angular_rates(part.t, q), graded))
    return found


def of_rates(t: Array, rates: Array, params: Params | None = None, part: str = "") -> Tremor:
    """Tremor in angular rates (n, 3) or (n,) in rad/s at times t (n,) s; of accelerations the frequencies hold, the amplitude does not."""
    w = np.asarray(rates, float)
    w = w[:, None] if w.ndim == 1 else w
    if w.ndim != 2 or len(w) != len(np.atleast_1d(t)):
        raise InputError("measure.rates_shape", rates=str(np.shape(rates)), t=np.size(t))
    return _measure_segment(params or Params(), part, np.asarray(t, float), w, ("good", ""))


def figures(found: list[Tremor]) -> list[Figure]:
    """The flat list of figures, by part of the hand."""
    made = []
    for r in found:
        seen = np.isfinite(r.frequency)
        graded = (r.grade, r.reason)
        log = np.log10(r.amplitude / DEG) if seen and r.amplitude > 0 else np.nan
        share_sd = (
            float(np.sqrt(max(r.time_share * (1 - r.time_share), 0.25 / r.windows) / r.windows))
            if r.windows
            else None
        )
        rows: dict[str, tuple[float, float | None]] = {
            "tremor_frequency": (r.frequency, r.frequency_sd),
            "tremor_amplitude": (r.amplitude, r.relative_sd * r.amplitude),
            "tremor_rate_rms": (r.rate_rms, r.relative_sd * r.rate_rms),
            "tremor_log_amplitude": (float(log), r.relative_sd / np.log(10)),
            "tremor_power_share": (
                r.power_share,
                2 * r.relative_sd * r.power_share * (1 - r.power_share),
            ),
            "tremor_time_share": (r.time_share, share_sd),
            "tremor_band_quotient": (r.band_ratio, 2 * np.sqrt(2.0) * r.relative_sd * r.band_ratio),
        }
        made += [KINDS[what].of(value, sd, *graded, r.part) for what, (value, sd) in rows.items()]
    return made


def shown(found: list[Tremor]) -> PlotData:
    """The spectra up to 20 Hz."""
    return PlotData(
        tuple(
            Curve(f"{r.part}_spectrum", "(rad/s)^2/Hz", r.f[r.f <= 20], r.density[r.f <= 20], "Hz")
            for r in found
            if len(r.f)
        )
    )


def _measure_segment(
    params: Params, part: str, t: Array, rates: Array, graded: tuple[Grade, str]
) -> Tremor:
    axes = [resample_even(t, w, max_gap=0.05) for w in rates.T]
    period, n = axes[0].period, len(axes[0].t)
    size = round(params.window / period)
    if 0.5 / period < params.highest:
        slow = phrase("measure.too_slow_for_tremor", rate=1 / period, highest=params.highest)
        return _nothing(part, slow)
    if n < size:
        return _nothing(part, phrase("measure.shorter_than_window", length=params.window))
    lost = 1.0 - float(np.mean([a.known.mean() for a in axes]))
    if lost > 0.2:
        return _nothing(part, phrase("measure.time_without_samples", share=100 * lost))
    values = np.array([a.values for a in axes])
    f, each = _window_spectra(values, period, size)
    density = each.mean(axis=0)
    count = len(each)
    peak, out = _peak(params, f, density)
    step = float(f[1])
    band = (f >= params.lowest) & (f <= params.highest)
    near = band & (np.abs(f - peak) <= params.about)
    rate_power, angle_power = (
        float(density[near].sum() * step),
        float((density[near] / (2 * np.pi * f[near]) ** 2).sum() * step),
    )
    wide = density[(f >= 4) & (f <= 12)].sum() / max(density[(f >= 0.5) & (f < 4)].sum(), 1e-300)
    share = rate_power / max(float(density[band].sum() * step), 1e-300)
    times = float(np.mean([_peak(params, f, d)[1] for d in each]))
    relative = 0.5 / np.sqrt(max(count * 0.6, 1.0))  # half that of a power; windows overlap by half
    grade, reason = graded
    if not out:
        reason, unseen = join([reason, NO_PEAK]), np.nan
        return Tremor(
            part,
            f,
            density,
            unseen,
            unseen,
            unseen,
            unseen,
            relative,
            unseen,
            times,
            float(wide),
            count,
            grade,
            reason,
        )
    rms, amplitude = float(np.sqrt(rate_power)), float(np.sqrt(2 * angle_power))
    return Tremor(
        part,
        f,
        density,
        peak,
        step / np.sqrt(12.0),
        rms,
        amplitude,
        relative,
        share,
        times,
        float(wide),
        count,
        grade,
        reason,
    )


def _window_spectra(values: Array, period: float, size: int) -> tuple[Array, Array]:
    """Frequencies (m,) and the density (windows, m) of every window, half overlapping, all axes together."""
    starts = range(0, values.shape[1] - size + 1, max(1, size // 2))
    each = [
        welch(  # type: ignore[call-overload]
            values[:, s : s + size], 1 / period, nperseg=size, detrend="linear"
        )[1].sum(axis=0)
        for s in starts
    ]
    return np.asarray(np.fft.rfftfreq(size, period), float), np.array(each)


def _peak(params: Params, f: Array, density: Array) -> tuple[float, bool]:
    """Where the density is largest within the band, between the lines of the spectrum, and whether it stands out and is a peak."""
    band = np.flatnonzero((f >= params.lowest) & (f <= params.highest))
    k = int(band[np.argmax(density[band])])
    if not 0 < k < len(f) - 1 or density[k] <= 0:
        return float(f[k]), False
    a, b, c = np.log(np.maximum(density[k - 1 : k + 2], 1e-300))
    inside = b >= a and b >= c and a + c < 2 * b
    shift = 0.5 * (a - c) / (a - 2 * b + c) if inside else 0.0
    return float(f[k] + shift * f[1]), bool(
        inside and density[k] >= params.stands_out * _beside(params, f, density, k)
    )


def _beside(params: Params, f: Array, density: Array, k: int) -> float:
    """Density on both sides of a peak."""
    sides = [
        (offset > params.about) & (offset <= params.beside) & (f > 0)
        for offset in (f - f[k], f[k] - f)
    ]
    return float(
        np.exp(
            np.mean([np.log(max(float(np.median(density[s])), 1e-300)) for s in sides if s.any()])
        )
    )


def _nothing(part: str, reason: str) -> Tremor:
    none = np.empty(0)
    return Tremor(
        part,
        none,
        none,
        np.nan,
        np.nan,
        np.nan,
        np.nan,
        np.nan,
        np.nan,
        np.nan,
        np.nan,
        0,
        "poor",
        reason,
    )
