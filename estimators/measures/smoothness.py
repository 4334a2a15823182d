"""How smooth a movement is, from its speed: spectral arc length, (log) dimensionless jerk, movement units.

In      a speed profile (n,) of one discrete movement, in any unit, and its sampling rate in Hz
Out     numbers without a unit; nearer to zero is smoother, of movement units one is
Source  Balasubramanian's published code (siva82kb/SPARC, scripts/smoothness.py @3650934), whose test vectors it gives to the last digit:
        t = -1 .. 1 s in steps of 0.01 (1 left out), v = exp(-5 t^2): SPARC -1.41403, DLJ -335.74684, LDLJ -5.81636
        movement units: drinking task, Alt Murphy et al.; JNER 2021, 10.1186/s12984-021-00895-3, Table 2
Limits  SPARC is for discrete movements; its highest frequency is 10 Hz in the author's Python and 20 Hz in his Matlab: print it with the number
"""

from typing import Literal

import numpy as np
from scipy.signal import find_peaks

from handscope.estimators.errors import InputError
from handscope.estimators.numerics.typing import Array

POWERS = {"speed": 3, "acceleration": 1, "jerk": -1}


def sparc(
    speed: Array, rate: float, highest: float = 10.0, least: float = 0.05, padding: int = 4
) -> float:
    """Spectral arc length of a speed profile: `highest` frequency in Hz, `least` share of the spectrum's maximum that counts."""
    v = _check_movement(speed, rate)
    n = int(2 ** (np.ceil(np.log2(len(v))) + padding))
    f = np.arange(0, rate, rate / n)[:n]
    spectrum = np.abs(np.fft.fft(v, n))[: len(f)]
    if not spectrum.max() > 0:
        return float("nan")
    spectrum = spectrum / spectrum.max()
    low = f <= highest
    f, spectrum = f[low], spectrum[low]
    counted = np.flatnonzero(spectrum >= least)
    f, spectrum = f[counted[0] : counted[-1] + 1], spectrum[counted[0] : counted[-1] + 1]
    if len(f) < 2:
        return float("nan")
    return -float(np.sqrt((np.diff(f) / (f[-1] - f[0])) ** 2 + np.diff(spectrum) ** 2).sum())


def dimensionless_jerk(
    movement: Array, rate: float, kind: Literal["speed", "acceleration", "jerk"] = "speed"
) -> float:
    """-(T^p / peak^2) times the integral of jerk squared; p is 3 of a speed, 1 of an acceleration, -1 of a jerk."""
    if kind not in POWERS:
        raise InputError("measure.unknown_movement", kind=kind, powers=", ".join(POWERS))
    v = _check_movement(movement, rate)
    dt, peak = 1.0 / rate, float(np.abs(v).max())
    if not peak > 0:
        return float("nan")
    jerk = (
        np.diff(v, 2) / dt**2
        if kind == "speed"
        else np.diff(v) / dt
        if kind == "acceleration"
        else v
    )
    return -float((len(v) * dt) ** POWERS[kind] / peak**2 * (jerk**2).sum() * dt)


def log_dimensionless_jerk(
    movement: Array, rate: float, kind: Literal["speed", "acceleration", "jerk"] = "speed"
) -> float:
    """-ln of the size of the dimensionless jerk."""
    size = abs(dimensionless_jerk(movement, rate, kind))
    return -float(np.log(size)) if size > 0 else float("nan")


def movement_units(speed: Array, rate: float, rise: float, least_interval: float) -> int:
    """How often a speed grows by more than `rise` (its unit) to a peak that comes at least `least_interval` s after the one before."""
    v = _check_movement(speed, rate)
    counted: list[int] = []
    for peak in find_peaks(v)[0].tolist():
        since = counted[-1] if counted else 0
        if v[peak] - v[since:peak].min() > rise and (
            not counted or peak - since >= least_interval * rate
        ):
            counted.append(peak)
    return len(counted)


def _check_movement(movement: Array, rate: float) -> Array:
    v = np.asarray(movement, float)
    if v.ndim != 1 or len(v) < 3:
        raise InputError("measure.movement_too_short", shape=str(v.shape))
    if not np.isfinite(v).all():
        raise InputError("measure.movement_not_finite", value=int((~np.isfinite(v)).sum()))
    if not (np.isfinite(rate) and rate > 0):
        raise InputError("measure.sampling_rate", rate=rate)
    return v
