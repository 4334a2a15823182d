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
from handscope.estimators.numerics.typing import Array
from handscope.sessions.tables_io.array_description import ArrayDescription

UNSEEN_GRADIENT = 5e-6  # T/m, a room with steel some metres away; ours
MAX_TRIED = 200  # readings that are tried without the declared moment
RATES = (2.0, 5000.0)  # Hz: other rates were hardly stamped in seconds


def describe_uncalibrated(error: float) -> str:
    """Say how large errors of sensors without calibration may be; `error` in T."""
    return (
        f"not calibrated: iron on the board and turned chips are not seen, {1e6 * error:.2g} uT an axis are counted for them; record the array turned by hand "
        "and give --turned, or tell `calibration_sd` in the array's file if the readings are calibrated already"
    )


def describe_calibration(array: ArrayDescription, calibration: RotationCalibration) -> list[str]:
    """What the calibration found that a user must know."""
    messages = [
        f"{name}: an axis points the other way than on most; turned round"
        for name, is_mirrored in zip(array.names, calibration.is_mirrored)
        if is_mirrored
    ]
    worst = int(np.argmax(calibration.residual_rms))
    if calibration.residual_rms[worst] > 0.02 * calibration.ellipsoids[0].strength:
        messages.append(
            f"{array.names[worst]}: {1e6 * calibration.residual_rms[worst]:.2g} uT are left against the others: the field was not the same across the array, or it was not rigid; "
            "standard deviations are as much larger"
        )
    return messages


def describe_gradient(result: LocalisationResult, declared_sd: float) -> list[str]:
    """A message where the field changes across the array by more than declared."""
    if result.search.gradient_sd <= declared_sd:
        return []
    change = field_gradient_test.rms_change_of(result.search.gradient_sd)
    return [
        f"the field changes by about {1e6 * change:.2g} uT a metre across the array: iron is near; what it changes by counts as unknown, places are less sure for it"
    ]


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
        "offset": f"offsets of {1e6 * sizes['offset']:.2g} uT",
        "gain": f"gains and axes that are off by {100 * sizes['gain']:.2g} %",
        "place": f"magnetometers that sit {1e3 * sizes['place']:.2g} mm from where they are told",
        "late": f"readings that are late by {1e3 * sizes['late']:.2g} ms",
        "length": f"a magnet as long as a rod of {200 * np.sqrt(6 * sizes['length']):.2g} cm",
        "slope": f"a field that changes by {1e6 * field_gradient_test.rms_change_of(sizes['slope']):.2g} uT a metre",
        "turn": f"axes of the magnetometers that are turned by {np.degrees(np.sqrt(3) * sizes['turn']):.2g} degrees against the board",
        "moment": "a moment that is not as told",
    }
    return [
        f"what errs alike in all readings was told by all of them together and taken off the places; most of it looks like {descriptions[systematic.dominant.name]}"
    ]


def describe_offsets(result: LocalisationResult, names: Sequence[str]) -> list[str]:
    """A message where timestamps were corrected."""
    offsets = [
        f"{name} by {1e3 * offset:.0f} ms (standard deviation {1e3 * sd:.1g})"
        for name, offset, sd in zip(
            names, result.timestamp_offsets.offsets, result.timestamp_offsets.sd
        )
        if offset
    ]
    if not offsets:
        return []
    spread = result.timestamp_offsets.spread
    unsure = (
        f"; whose times are right is not told, {1e3 * spread:.0f} ms are counted for it"
        if spread > MIN_CORRECTION
        else ""
    )
    return [
        f"readings come later than the others' (earlier, where less than 0) and were moved by that: {', '.join(offsets)}{unsure}"
    ]


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
        f"{len(result.search.array)} magnetometers cannot tell a field that changes across the array: {1e6 * UNSEEN_GRADIENT:.0f} uT a metre would draw places by {shift:.2g} mm (median); "
        "tell `gradient` in the array's file if iron is near"
    ]


def describe_result(
    readings: BenchReadings, result: LocalisationResult, localisation: Localisation, assumed: float
) -> list[str]:
    """How many readings were located, and how well."""
    is_located = localisation.is_located
    messages = [
        f"{len(readings.t)} readings of {readings.mag.shape[1]} magnetometers in {readings.t[-1]:.1f} s; noise and calibration {1e6 * result.search.noise:.2g} uT an axis",
    ]
    if not is_located.any():
        return [*messages, f"no magnet is found: {_explain_failure(result, localisation, assumed)}"]
    sd, size = (
        np.linalg.norm(localisation.place_sd[is_located], axis=1),
        np.linalg.norm(localisation.moment[is_located], axis=1),
    )
    return [
        *messages,
        f"magnet found in {100 * is_located.mean():.0f} % of them, place to {1e3 * np.median(sd):.2g} mm (median), moment {np.median(size):.3g} A m^2",
        *(
            [f"not found in the others: {_explain_failure(result, localisation, assumed)}"]
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
    return (
        f"The unit is told as {declared}: is it {' or '.join(fitting)}?"
        if fitting
        else f"Is the unit told, {declared}, that of the table?"
    )


def describe_rate(readings: BenchReadings) -> list[str]:
    """A message where times are hardly seconds."""
    rate = (
        (len(readings.t) - 1) / float(readings.t[-1] - readings.t[0])
        if len(readings.t) > 1
        else RATES[0]
    )
    if RATES[0] <= rate <= RATES[1]:
        return []
    return [
        f"{rate:.3g} readings a second: are the times in s? The array's file tells another unit of them as `time`"
    ]


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
            f"without the magnet {1e6 * field:.3g} uT are left (median), the earth's field is 22 to 67 uT. {_ask_unit(field, array.unit)} "
            "Moments are as wrong as it is; or the field was taken off, or iron is on the board or near"
        )
    if localisation.is_located.any():
        size = float(
            np.median(np.linalg.norm(localisation.moment[localisation.is_located], axis=1))
        )
        if not WEAKEST <= size <= STRONGEST:
            messages.append(
                f"a moment of {size:.3g} A m^2 is no magnet for a hand ({WEAKEST:g} to {STRONGEST:g}): is the unit that of the table, and are the "
                "magnetometers' places in m? Places ten times too large make moments a thousand times too large"
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
    return [
        f"the readings contradict the moment told, {moment:g} A m^2: without it they are those of a magnet of {size:.3g} A m^2 in a field of {1e6 * field:.3g} uT. "
        "Is the moment right, is the unit that of the table, and are the magnetometers' places in m?"
    ]


def _explain_failure(result: LocalisationResult, localisation: Localisation, assumed: float) -> str:
    """The most frequent reason for missing positions; `assumed` T is counted for an undeclared
    calibration."""
    is_lost = ~localisation.is_located
    if np.isnan(localisation.residual_rms[is_lost]).mean() > 0.5:
        return "readings are missing or at their limit"
    if result.has_second_magnet[is_lost].mean() > 0.5:
        return "the readings are those of two magnets, or of one and iron near: take the other away, and what is of steel"
    if (result.is_inconsistent | result.has_second_magnet)[is_lost].mean() > 0.5:
        return "the readings are not those of one magnet in a homogeneous field: a second magnet, iron near, wrong places, or no calibration"
    if assumed:
        return (
            f"the magnet is too far away or too near for a sure place with the {1e6 * assumed:.2g} uT an axis that are counted because nobody says how the array is "
            "calibrated: give --turned, or tell `calibration_sd` in the array's file"
        )
    return "the magnet is too far away or too near for a sure place"
