"""Readings of a magnetometer array on a bench: units, calibration by rotation, noise, mains hum,
saturation, clocks, ambient field.

In      readings (n, magnetometers, 3) in the array's own unit, one time base; readings of the same
        array rotated by hand far from magnets
Out     readings in T; RotationCalibration: all magnetometers in the first one's axes, with
        residuals; ReadingStatistics
Source  calibration: magnetometer_ellipsoid.py; units: SI (1 G = 1e-4 T); alias of a line f at rate
        r: |f - r round(f / r)|
Limits  differences of the room's field across the array are part of the residuals; a rotated or
        mirrored chip shows only when the array is rotated; a line is reported from five times the
        spectrum beside it
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.force.interpolation import reading_noise
from handscope.estimators.magnet.model.setup import (
    EARTH_STRONGEST,
    EARTH_WEAKEST,
    STRONGEST,
    WEAKEST,
)
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.intervals import find_runs
from handscope.estimators.numerics.typing import Array, Bools
from handscope.estimators.sensors.magnetometer_ellipsoid import (
    EllipsoidCalibration,
    find_common_axes,
    find_outsiders,
    fit_ellipsoid,
)

UNITS = {"T": 1.0, "mT": 1e-3, "uT": 1e-6, "nT": 1e-9, "G": 1e-4, "mG": 1e-7}
UNIT_ALIASES = {"µT": "uT", "μT": "uT", "Gauss": "G", "gauss": "G", "Gs": "G", "mGauss": "mG"}
NORMALISED = "normalised"  # to the field's strength where the array was calibrated
MAINS = (50.0, 60.0)  # Hz
MIN_HUM_RATIO = 5.0  # times the spectrum beside it
MIN_READINGS = 20  # equal readings of an axis that does not answer while others change
MIN_DRIFT = 3e-6  # T: largest change of magnetometers against each other without a magnet
MIN_REPEATS = 3  # equal extreme readings in a row are a limit


@dataclass(frozen=True)
class BenchReadings:
    """Readings of an array on one time base."""

    t: Array  # (n,) s
    mag: Array  # (n, magnetometers, 3) T


@dataclass(frozen=True)
class RotationCalibration:
    """Calibrations of all magnetometers of one board."""

    ellipsoids: tuple[EllipsoidCalibration, ...]
    is_mirrored: Bools  # (magnetometers,) axes are left-handed against the first one's
    q_bl: Array  # (magnetometers, 4) to the first one's axes
    # (magnetometers,) T, against the mean of all: calibration and room together
    residual_rms: Array

    @property
    def gains(self) -> Array:
        """Sizes of corrected readings over raw ones (magnetometers,)."""
        return np.array([float(np.cbrt(np.linalg.det(s.matrix))) for s in self.ellipsoids])

    @property
    def measured_strength(self) -> float:
        """Strength of the field as read, T, median of the magnetometers."""
        return float(np.median([s.strength for s in self.ellipsoids] / self.gains))

    def correct(self, mag: Array) -> Array:
        """Readings (n, magnetometers, 3) in T, each in its own right-handed axes."""
        return np.stack(
            [
                (-1.0 if flip else 1.0) * s.corrected(mag[:, k])
                for k, (s, flip) in enumerate(zip(self.ellipsoids, self.is_mirrored))
            ],
            axis=1,
        )


@dataclass(frozen=True)
class AmbientReference:
    """Readings of an array at rest without the magnet."""

    mean_reading: Array  # (magnetometers, 3) T, in each one's axes
    ambient_deviation: Array  # (magnetometers, 3) T, from the mean of all: iron, offsets
    drift: float  # T by which that changed


@dataclass(frozen=True)
class ReadingStatistics:
    """Noise and faults of readings."""

    noise: Array  # (magnetometers,) T, of an axis, hum included
    hum: Array  # (magnetometers,) T, amplitude of the line; 0 where there is none
    hum_frequency: float  # Hz, where it shows
    is_saturated: Bools  # (n, magnetometers)
    missing_share: float  # share of readings
    is_stuck: Bools  # (magnetometers,) an axis always reads the same


def convert_to_tesla(mag: Array, unit: str | float, earth: float | None) -> Array:
    """Readings in T from a unit, or from counts of so many T; normalised ones need `earth` T."""
    if not isinstance(unit, str):
        if not unit > 0:
            raise InputError("magnet.declared_unit", unit=unit)
        return np.asarray(mag * unit)
    unit = UNIT_ALIASES.get(unit, unit)
    if unit == NORMALISED:
        if earth is None:
            raise InputError("magnet.normalised_without_field")
        return np.asarray(mag * earth)
    if unit not in UNITS:
        raise InputError("magnet.unknown_unit", unit=unit, names=", ".join((*UNITS, NORMALISED)))
    return np.asarray(mag * UNITS[unit])


def require_plausible(
    earth: float | None,
    moment: float | None,
    limit: float | None,
    place_sd: float,
    calibration_sd: float | None,
    gradient: float,
) -> None:
    """InputError where declared values of an array cannot be T, A m^2 and m."""
    if earth is not None and not EARTH_WEAKEST <= earth <= EARTH_STRONGEST:
        raise InputError("magnet.declared_earth_field", earth=earth)
    if moment is not None and not WEAKEST <= moment <= STRONGEST:
        raise InputError("magnet.moment_outside", size=moment, least=WEAKEST, most=STRONGEST)
    if limit is not None and not limit > 0:
        raise InputError("magnet.declared_limit", limit=limit)
    if not 0 <= place_sd <= 0.02:
        raise InputError("magnet.declared_position_sd", place_sd=place_sd)
    if calibration_sd is not None and not 0 <= calibration_sd <= EARTH_WEAKEST:
        raise InputError("magnet.declared_calibration_sd", calibration_sd=calibration_sd)
    if not 0 <= gradient <= 1e-3:
        raise InputError("magnet.declared_gradient", gradient=gradient)


def find_fitting_units(strength: float, unit: str | float) -> list[str]:
    """Units in which a field read as `strength` T would be the earth's."""
    read = strength / (
        unit if isinstance(unit, (int, float)) else UNITS.get(UNIT_ALIASES.get(unit, unit), 1.0)
    )
    return [u for u, size in UNITS.items() if 22e-6 <= read * size <= 67e-6]


def calibrate_by_rotation(
    mag: Array, names: Sequence[str], earth: float | None
) -> RotationCalibration:
    """Calibrate all magnetometers from readings in T while the whole board was turned by hand; InputError names the one that cannot be."""
    ellipsoids = tuple(fit_ellipsoid(mag[:, k], name, earth) for k, name in enumerate(names))
    own = np.stack([s.corrected(mag[:, k]) for k, s in enumerate(ellipsoids)], axis=1)
    if earth is None:  # all saw the same field: the first one's strength holds
        ellipsoids = tuple(
            fit_ellipsoid(mag[:, k], name, ellipsoids[0].strength) for k, name in enumerate(names)
        )
        own = np.stack([s.corrected(mag[:, k]) for k, s in enumerate(ellipsoids)], axis=1)
    is_complete = np.isfinite(own).all(axis=(1, 2))
    if is_complete.sum() < 50:
        raise InputError("magnet.too_few_common_readings")
    common = find_common_axes(own)
    for message in find_outsiders(names, common).values():
        raise InputError(message)
    common_readings = quat.rotate(common.q_1l, common.signs[:, None] * own)[is_complete]
    deviation = common_readings - common_readings.mean(axis=1, keepdims=True)
    return RotationCalibration(
        ellipsoids,
        common.mirrored,
        common.q_1l,
        np.sqrt((deviation**2).mean(axis=(0, 2)) * len(names) / max(len(names) - 1, 1)),
    )


def measure_ambient_field(mag: Array, q_bl: Array | None) -> AmbientReference:
    """What magnetometers (n, magnetometers, 3) T of an array at rest read without the magnet;
    InputError where that changes."""
    y = mag if q_bl is None else quat.rotate(q_bl, mag)
    first, last = (_deviation_from_mean(part) for part in (y[: len(y) // 2], y[len(y) // 2 :]))
    change = (last - first)[np.isfinite(last - first)]
    if not len(change):
        raise InputError("magnet.ambient_recording_too_short")
    drift, steps = (
        float(np.sqrt((change**2).mean())),
        np.diff(y - _mean_of_known(y, 1)[:, None], axis=0),
    )
    noise = (
        float(np.sqrt((steps[np.isfinite(steps)] ** 2).mean() / 2))
        if np.isfinite(steps).any()
        else 0.0
    )
    if drift > max(MIN_DRIFT, 6 * noise * float(np.sqrt(4 / len(y)))):
        raise InputError("magnet.ambient_field_changed", drift=1000000.0 * drift)
    deviation = _deviation_from_mean(y)
    deviation = deviation if q_bl is None else quat.rotate(quat.conjugate(q_bl), deviation)
    return AmbientReference(
        _mean_of_known(mag, 0), deviation, float(np.hypot(drift / 2, noise / np.sqrt(len(y))))
    )


def _deviation_from_mean(y: Array) -> Array:
    """Means (magnetometers, 3) less the mean of all; NaN where none answered."""
    each = _mean_of_known(y, 0)
    return np.asarray(each - _mean_of_known(each, 0))


def _mean_of_known(y: Array, axis: int) -> Array:
    """Mean of what is known, NaN where nothing is."""
    known = np.isfinite(y)
    many = known.sum(axis=axis)
    return np.where(many > 0, np.where(known, y, 0.0).sum(axis=axis) / np.maximum(many, 1), np.nan)


def compute_statistics(t: Array, mag: Array, limit: float | None) -> ReadingStatistics:
    """Statistics of readings (n, magnetometers, 3) in T; `limit` T is the full scale, if it is
    known."""
    is_saturated = _find_saturated(mag, limit)
    unsaturated = np.where(is_saturated[..., None], np.nan, mag)
    hum, hum_frequency = _measure_hum(t, unsaturated)
    noise = np.maximum(reading_noise(t, unsaturated), hum / np.sqrt(2.0))
    known = np.isfinite(mag)
    spread = np.where(known, mag, -np.inf).max(axis=0) - np.where(known, mag, np.inf).min(axis=0)
    is_stuck = (spread == 0).any(axis=1) & (len(t) >= MIN_READINGS) & (np.median(spread) > 0)
    return ReadingStatistics(
        noise,
        hum,
        hum_frequency,
        is_saturated,
        float(np.isnan(mag).any(axis=-1).mean()),
        np.asarray(is_stuck),
    )


def resample_readings(t: Array, own: Array, mag: Array) -> Array:
    """Readings (m, 3) at own times (m,) linearly interpolated to t (n,); NaN across gaps of more
    than two samples."""
    there = np.isfinite(mag).all(axis=1) & np.isfinite(own)
    if there.sum() < 2:
        return np.full((len(t), 3), np.nan)
    own, mag = own[there], mag[there]
    out = np.stack([np.interp(t, own, axis, left=np.nan, right=np.nan) for axis in mag.T], axis=1)
    behind = np.clip(np.searchsorted(own, t), 1, len(own) - 1)
    out[own[behind] - own[behind - 1] > 2.5 * np.median(np.diff(own))] = np.nan
    return out


def describe_statistics(names: Sequence[str], statistics: ReadingStatistics) -> list[str]:
    """What a user must know before reading the result."""
    messages = []
    if statistics.missing_share > 0.01:
        messages.append(phrase("locate.missing", share=100 * statistics.missing_share))
    messages += [
        phrase("locate.stuck", name=name)
        for name, is_stuck in zip(names, statistics.is_stuck)
        if is_stuck
    ]
    for k, name in enumerate(names):
        share = float(statistics.is_saturated[:, k].mean())
        if share > 0:
            messages.append(phrase("locate.saturated", name=name, share=100 * share))
        if statistics.hum[k] > 0:
            messages.append(
                phrase(
                    "locate.hum",
                    name=name,
                    size=1e6 * statistics.hum[k],
                    frequency=statistics.hum_frequency,
                )
            )
    return messages


def _find_saturated(mag: Array, limit: float | None) -> Bools:
    """At the declared limit, or several times in a row at the largest size that an axis ever has."""
    with np.errstate(invalid="ignore"):
        if limit is not None:
            return np.asarray((np.abs(mag) >= 0.98 * limit).any(axis=-1))
    is_saturated = np.zeros(mag.shape[:2], bool)
    for k in range(mag.shape[1]):
        for axis in mag[:, k].T:
            known = axis[np.isfinite(axis)]
            if len(known) < 8 or (np.diff(known) == 0).mean() > 0.5:  # coarse counts repeat anyway
                continue
            for end in (known.min(), known.max()):
                if abs(end - np.median(known)) > 0.25 * np.ptp(known):
                    for first, stop in find_runs(axis == end):
                        is_saturated[first:stop, k] |= stop - first >= MIN_REPEATS
    return is_saturated


def _measure_hum(t: Array, mag: Array) -> tuple[Array, float]:
    """Amplitude (magnetometers,) of the stronger mains line and its frequency, Hz; zeros where none
    stands out."""
    n, nothing = len(t), np.zeros(mag.shape[1])
    if n < 256 or not np.isfinite(mag).any():
        return nothing, float("nan")
    rate = (n - 1) / float(t[-1] - t[0])
    filled = np.where(np.isfinite(mag), mag, np.nanmedian(mag, axis=0))
    window = np.hanning(n)[:, None, None]
    size = np.sqrt(
        (
            np.abs(np.fft.rfft(np.diff(filled, axis=0, prepend=filled[:1]) * window, axis=0)) ** 2
        ).sum(axis=2)
    )
    frequency = np.fft.rfftfreq(n, 1.0 / rate)
    strongest, frequency_shown = nothing, float("nan")
    for line in MAINS:
        at = abs(line - rate * round(line / rate))
        if at < 2.0 or at > 0.5 * rate - 1.0:
            continue
        near, beside = (
            np.abs(frequency - at) < 0.3,
            (np.abs(frequency - at) > 0.6) & (np.abs(frequency - at) < 2.0),
        )
        if not near.any() or not beside.any():
            continue
        top, floor = size[near].max(axis=0), np.median(size[beside], axis=0)
        steep = 2.0 * np.sin(np.pi * at / rate)  # gain of differences
        amplitude = np.where(top > MIN_HUM_RATIO * floor, top / (0.25 * n * 2.0 * steep) * 2.0, 0.0)
        if amplitude.max() > strongest.max():
            strongest, frequency_shown = amplitude, at
    return strongest, frequency_shown
