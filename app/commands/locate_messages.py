"""Messages of `handscope locate` about a recording, its calibration and its result."""

from collections.abc import Sequence

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.magnet.array import bench_readings, field_gradient_test, systematic_errors
from handscope.estimators.magnet.array import search as magnet_search
from handscope.estimators.magnet.array.bench_readings import BenchReadings, RotationCalibration
from handscope.estimators.magnet.array.localisation import Localisation
from handscope.estimators.magnet.array.recording_localisation import LocalisationResult
from handscope.estimators.magnet.array.search import Search
from handscope.estimators.magnet.array.timestamp_offsets import MIN_CORRECTION
from handscope.estimators.magnet.model.setup import (
    EARTH_STRONGEST,
    EARTH_WEAKEST,
    STRONGEST,
    WEAKEST,
)
from handscope.estimators.messages.sentence import join, phrase
from handscope.estimators.numerics.typing import Array
from handscope.sessions.tables_io.array_description import ArrayDescription

UNSEEN_GRADIENT = 5e-6  # T/m, a room with steel some metres away; ours
MAX_TRIED = 200  # readings that are tried without the declared moment
RATES = (2.0, 5000.0)  # Hz: at other rates the time stamps are probably not seconds


def describe_uncalibrated(error: float) -> str:
    """Say how large errors of sensors without calibration may be; `error` in T."""
    return phrase("locate.uncalibrated", sd=1e6 * error)


def describe_calibration(array: ArrayDescription, calibration: RotationCalibration) -> list[str]:
    """What the calibration found that a user must know."""
    messages = [
        phrase("locate.axis_mirrored", name=name)
        for name, is_mirrored in zip(array.names, calibration.is_mirrored)
        if is_mirrored
    ]
    worst = int(np.argmax(calibration.residual_rms))
    if calibration.residual_rms[worst] > 0.02 * calibration.ellipsoids[0].strength:
        messages.append(
            phrase(
                "locate.residual",
                name=array.names[worst],
                residual=1e6 * calibration.residual_rms[worst],
            )
        )
    return messages


def describe_gradient(result: LocalisationResult, declared_sd: float) -> list[str]:
    """A message where the field changes across the array by more than declared."""
    if result.search.gradient_sd <= declared_sd:
        return []
    change = field_gradient_test.rms_change_of(result.search.gradient_sd)
    return [phrase("locate.gradient", change=1e6 * change)]


def describe_systematic_errors(result: LocalisationResult) -> list[str]:
    """A message where systematic errors were corrected."""
    if (systematic := result.systematic) is None:
        return []
    sizes = dict(
        zip(
            (kind.name for kind in systematic_errors.KINDS),
            (float(size) for size in systematic.sizes),
        )
    )
    descriptions = {
        "offset": phrase("locate.error_offset", size=1e6 * sizes["offset"]),
        "gain": phrase("locate.error_gain", size=100 * sizes["gain"]),
        "place": phrase("locate.error_place", size=1e3 * sizes["place"]),
        "late": phrase("locate.error_late", size=1e3 * sizes["late"]),
        "length": phrase("locate.error_length", size=200 * np.sqrt(6 * sizes["length"])),
        "slope": phrase(
            "locate.error_slope", size=1e6 * field_gradient_test.rms_change_of(sizes["slope"])
        ),
        "turn": phrase("locate.error_turn", size=np.degrees(np.sqrt(3) * sizes["turn"])),
        "moment": phrase("locate.error_moment"),
    }
    return [phrase("locate.systematic", what=descriptions[systematic.dominant.name])]


def describe_offsets(result: LocalisationResult, names: Sequence[str]) -> list[str]:
    """A message where timestamps were corrected."""
    offsets = [
        phrase("locate.offset_of", name=name, offset=1e3 * offset, sd=1e3 * sd)
        for name, offset, sd in zip(
            names, result.timestamp_offsets.offsets, result.timestamp_offsets.sd
        )
        if offset
    ]
    if not offsets:
        return []
    spread = result.timestamp_offsets.spread
    moved = join(offsets)
    if spread > MIN_CORRECTION:
        return [phrase("locate.offsets_unsure", offsets=moved, spread=1e3 * spread)]
    return [phrase("locate.offsets", offsets=moved)]


def describe_few(
    result: LocalisationResult, localisation: Localisation, moment: float | None, size_sd: float
) -> list[str]:
    """A message about what too few magnetometers cannot detect."""
    rows = np.flatnonzero(localisation.is_located & np.isfinite(result.search.mag).all(axis=(1, 2)))
    if (
        len(result.search.array) >= field_gradient_test.MIN_MAGNETOMETERS
        or result.search.gradient_sd
        or result.systematic
        or not len(rows)
    ):
        return []
    problem, x = magnet_search.build_problem(
        result.search, localisation, moment, size_sd, rows[:: -(-len(rows) // MAX_TRIED)]
    )
    shift = 1e3 * float(np.median(field_gradient_test.position_shift(problem, x, UNSEEN_GRADIENT)))
    return [
        phrase(
            "locate.too_few",
            number=len(result.search.array),
            gradient=1e6 * UNSEEN_GRADIENT,
            shift=shift,
        )
    ]


def describe_result(
    readings: BenchReadings, result: LocalisationResult, localisation: Localisation, assumed: float
) -> list[str]:
    """How many readings were located, and how well."""
    is_located = localisation.is_located
    messages = [
        phrase(
            "locate.readings",
            number=len(readings.t),
            chips=readings.mag.shape[1],
            seconds=readings.t[-1],
            noise=1e6 * result.search.noise,
        ),
    ]
    if not is_located.any():
        why = _explain_failure(result, localisation, assumed)
        return [*messages, phrase("locate.no_magnet", why=why)]
    sd, size = (
        np.linalg.norm(localisation.place_sd[is_located], axis=1),
        np.linalg.norm(localisation.moment[is_located], axis=1),
    )
    return [
        *messages,
        phrase(
            "locate.found",
            share=100 * is_located.mean(),
            sd=1e3 * float(np.median(sd)),
            moment=float(np.median(size)),
        ),
        *(
            [phrase("locate.not_in_others", why=_explain_failure(result, localisation, assumed))]
            if not is_located.all()
            else []
        ),
    ]


def require_unit(strength: float, unit: str | float, name: str) -> None:
    """InputError where the field of the rotated array is not the earth's."""
    if not EARTH_WEAKEST <= strength <= EARTH_STRONGEST:
        raise InputError(
            "command.field_implausible",
            name=name,
            strength=1000000.0 * strength,
            strength2=_ask_unit(strength, unit),
        )


def _ask_unit(strength: float, unit: str | float) -> str:
    fitting = bench_readings.find_fitting_units(strength, unit)
    declared = f"{unit:g} T a count" if isinstance(unit, (int, float)) else unit
    if fitting:
        return phrase("locate.unit_is_it", unit=declared, fitting=" / ".join(fitting))
    return phrase("locate.unit_of_table", unit=declared)


def describe_rate(readings: BenchReadings) -> list[str]:
    """A message where the time stamps are probably not seconds."""
    rate = (
        (len(readings.t) - 1) / float(readings.t[-1] - readings.t[0])
        if len(readings.t) > 1
        else RATES[0]
    )
    if RATES[0] <= rate <= RATES[1]:
        return []
    return [phrase("locate.rate", rate=rate)]


def describe_implausible(
    array: ArrayDescription, mag: Array, localisation: Localisation
) -> list[str]:
    """Messages where the field without the magnet is not the earth's, or the moment that of no hand
    magnet: positions do not show a wrong unit."""
    messages = []
    is_explained = localisation.misfit < magnet_search.misfit_limit(mag.shape[1])
    strength = np.linalg.norm(
        localisation.field[is_explained] if is_explained.any() else mag, axis=-1
    )  # without any fit: that of the quieter magnetometers
    field = float(np.nanquantile(strength, 0.5 if is_explained.any() else 0.25))
    if not EARTH_WEAKEST <= field <= EARTH_STRONGEST:
        messages.append(
            phrase("locate.field_implausible", field=1e6 * field, unit=_ask_unit(field, array.unit))
        )
    if localisation.is_located.any():
        size = float(
            np.median(np.linalg.norm(localisation.moment[localisation.is_located], axis=1))
        )
        if not WEAKEST <= size <= STRONGEST:
            messages.append(
                phrase("locate.moment_implausible", size=size, least=WEAKEST, most=STRONGEST)
            )
    return messages


def describe_moment(search: Search, moment: float | None, localisation: Localisation) -> list[str]:
    """A message where readings contradict the declared moment."""
    if moment is None or len(search.array) < 4 or localisation.is_located.mean() > 0.5:
        return []
    some = np.flatnonzero(np.isfinite(search.mag).all(axis=(1, 2)))
    free = (
        search.select(some[:: max(1, len(some) // MAX_TRIED)]).locate(None, 1.0)
        if len(some)
        else None
    )
    if free is None or free.is_located.mean() < 0.1:
        return []
    size = float(np.median(np.linalg.norm(free.moment[free.is_located], axis=1)))
    if abs(size / moment - 1) < 0.2:
        return []
    field = float(np.median(np.linalg.norm(free.field[free.is_located], axis=1)))
    return [phrase("locate.moment_contradicted", moment=moment, size=size, field=1e6 * field)]


def _explain_failure(result: LocalisationResult, localisation: Localisation, assumed: float) -> str:
    """The most frequent reason for missing positions; `assumed` T is counted for an undeclared
    calibration."""
    is_lost = ~localisation.is_located
    if np.isnan(localisation.residual_rms[is_lost]).mean() > 0.5:
        return phrase("locate.why_missing")
    if result.has_second_magnet[is_lost].mean() > 0.5:
        return phrase("locate.why_two")
    if (result.is_inconsistent | result.has_second_magnet)[is_lost].mean() > 0.5:
        return phrase("locate.why_inconsistent")
    if assumed:
        return phrase("locate.why_assumed", sd=1e6 * assumed)
    return phrase("locate.why_distance")
