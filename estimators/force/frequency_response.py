"""Frequency response of the held object to the grip force, and whether it can be identified from data without an external perturbation.

In      force u (n,) N and movement y (n,) m on an even time base t (n,)
Out     Response: S_uy / S_uu with coherence and standard deviation; Conditions: which of 6.5.1 hold on the data
Source  Kortier, thesis (6.16) to (6.23): the estimate approaches the load where the hand's own force dominates, and -1/H where other sources do;
        standard deviation: Bendat & Piersol, Random Data, 9.2; thresholds ours
Limits  that the force is not a reaction to movements cannot be proved from the two signals: a coherence below one shows that something else moves or pushes
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import csd

from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array, Bools

EXCITED = 0.02  # of the largest power of the force: frequencies with more are excited
BANDWIDTH = 0.95  # share of the force's power below its bandwidth
LEAST = 4  # segments, fewest for an estimate
COHERENT = 0.8
TIMING = 0.01  # s by which force and movement may be shifted against each other: a sample at 100 Hz


@dataclass(frozen=True)
class Response:
    """Frequency response (6.16) with its coherence; frequencies in Hz."""

    frequency: Array  # (f,) Hz
    P: NDArray[np.complex128]  # (f,) m/N
    sd: Array  # (f,) m/N of its size, the random part alone: what errs the same at all frequencies (scales) is not in it
    coherence: Array  # (f,)
    power: Array  # (f,) N^2/Hz of the force
    segments: float  # that count as independent

    @property
    def phase(self) -> Array:
        """(f,) rad by which the movement leads the force: below 0 it lags, and energy flows into the load."""
        return np.angle(self.P)

    @property
    def phase_sd(self) -> Array:
        """(f,) rad, random part and timing together."""
        return np.hypot(
            self.sd / np.maximum(np.abs(self.P), 1e-300), TIMING * 2 * np.pi * self.frequency
        )

    @property
    def excited(self) -> Bools:
        """Frequencies (f,) at which the force has power."""
        return np.asarray((self.power > EXCITED * self.power.max()) & (self.frequency > 0))


@dataclass(frozen=True)
class Conditions:
    """The conditions of 6.5.1; None: undecided by the data."""

    independent: bool | None  # 1a: the force explains the movement
    wide: bool | None  # 1b: the force reaches as far up as the load answers
    passive: bool | None  # 2: energy flows into the load
    coherence: float  # mean over what is excited
    force_bandwidth: float  # Hz
    load_bandwidth: float  # Hz; infinite where the answer does not fall within what is excited
    lag: float  # s by which the movement comes behind the force, mean over what is seen: from 0 on energy flows into the load
    lag_sd: float  # s, random part and timing together

    @property
    def reasons(self) -> tuple[str, ...]:
        """The conditions that do not hold, as sentences."""
        reasons_by_condition = (
            (self.independent, phrase("squeeze.other_force")),
            (self.wide, phrase("squeeze.force_too_slow")),
            (
                self.passive,
                phrase("squeeze.not_passive"),
            ),
        )
        return tuple(words for held, words in reasons_by_condition if held is False)


def estimate_response(t: Array, u: Array, y: Array, length: float = 3.0) -> Response:
    """By Welch's method with segments of `length` s that overlap by half; (6.16)."""
    rate = (len(t) - 1) / float(t[-1] - t[0])
    n = min(len(t), round(length * rate))
    (frequency, S_uu), (_, S_yy), (_, S_uy) = (
        csd(a, b, fs=rate, nperseg=n) for a, b in ((u, u), (y, y), (u, y))
    )
    # half overlap of Hann windows: 9/11 as many count (Welch 1967)
    segments = max(1.0, (2 * len(t) / n - 1) * 9 / 11)
    power = np.abs(S_uu)
    coherence = np.abs(S_uy) ** 2 / np.maximum(power * np.abs(S_yy), 1e-300)
    P = np.asarray(S_uy / np.maximum(power, 1e-300), complex)
    sd = np.abs(P) * np.sqrt((1 - coherence).clip(0) / np.maximum(2 * segments * coherence, 1e-12))
    return Response(frequency, P, sd, coherence, power, segments)


def check_conditions(r: Response) -> Conditions:
    """The two conditions of 6.5.1 on the data."""
    excited = r.excited
    total = np.cumsum(r.power[1:])
    force_bandwidth = float(r.frequency[1:][np.searchsorted(total, BANDWIDTH * total[-1])])
    if r.segments < LEAST or not excited.any():
        return Conditions(
            None,
            None,
            None,
            float("nan"),
            force_bandwidth,
            float("nan"),
            float("nan"),
            float("nan"),
        )
    coherence = float(np.average(r.coherence[excited], weights=r.power[excited]))
    seen = excited & (r.coherence > COHERENT)
    size, f = np.abs(r.P[seen]), r.frequency[seen]
    fallen = np.flatnonzero(size < size[:1] / np.sqrt(2))
    load_bandwidth = float(f[fallen[0]]) if len(fallen) else float("inf")
    wide = None if not np.isfinite(load_bandwidth) else force_bandwidth >= load_bandwidth
    lag, random = _estimate_lag(r, seen)
    back = bool(lag + 2 * random + TIMING < 0)
    passive = not back if seen.any() else None
    return Conditions(
        coherence > COHERENT,
        wide,
        passive,
        coherence,
        force_bandwidth,
        load_bandwidth,
        lag,
        float(np.hypot(random, TIMING)),
    )


def _estimate_lag(r: Response, seen: Bools) -> tuple[float, float]:
    """Lag of the movement, s, and the random part of its standard deviation; the energy that enters the load in a cycle is -Im P times the force's power."""
    if not seen.any():
        return float("nan"), float("nan")
    weights = r.power[seen]
    turned = float(weights @ (2 * np.pi * r.frequency[seen] * np.abs(r.P[seen])))
    return float(weights @ -np.imag(r.P[seen])) / turned, float(weights @ r.sd[seen]) / turned
