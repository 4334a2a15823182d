"""`handscope locate`: position of a magnet from a recording of any magnetometer array;
docs/magnet-array.md."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from handscope.app.commands.words import say
from handscope.estimators.data.samples import MAG
from handscope.estimators.errors import InputError
from handscope.estimators.magnet.array import bench_readings, field_gradient_test, systematic_errors
from handscope.estimators.magnet.array import search as magnet_search
from handscope.estimators.magnet.array.bench_readings import AmbientReference, RotationCalibration
from handscope.estimators.magnet.array.localisation import Localisation
from handscope.estimators.magnet.array.search import LocalisationResult, Search
from handscope.estimators.magnet.array.timestamp_offsets import MIN_CORRECTION
from handscope.estimators.magnet.model import setup as magnet_setup
from handscope.estimators.magnet.model.setup import (
    EARTH_STRONGEST,
    EARTH_WEAKEST,
    STRONGEST,
    WEAKEST,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.tables_io import array_table
from handscope.sessions.tables_io.array_description import ArrayDescription, read_description
from handscope.sessions.tables_io.number_table import NumberTable
from handscope.sessions.tables_io.writing import save_file

COLUMNS = (
    *(
        "t",
        "x",
        "y",
        "z",
        "x_sd",
        "y_sd",
        "z_sd",
        "moment_x",
        "moment_y",
        "moment_z",
        "moment_x_sd",
        "moment_y_sd",
        "moment_z_sd",
    ),
    *("field_x", "field_y", "field_z", "left", "found"),
)
MOMENT = 0.015  # of the moment: its error, with that of the dipole model, as tracker/options.py
UNCALIBRATED = 2e-6  # T an axis, where nothing is declared of the calibration
GAIN = 0.03  # of a magnetometer's readings: data sheets say up to 5 % (AK8975, HMC5883L)
UNSEEN_GRADIENT = 5e-6  # T/m, a room with steel some metres away; ours
MAX_TRIED = 200  # readings that are tried without the declared moment
RATES = (2.0, 5000.0)  # Hz: other rates were hardly stamped in seconds


@dataclass(frozen=True)
class BenchReadings:
    t: Array  # (n,) s
    mag: Array  # (n, magnetometers, 3) T


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "recording",
        type=Path,
        help="a table (.csv, .tsv), or a recording whose magnetometers are named as in the array's file",
    )
    parser.add_argument(
        "--array",
        type=Path,
        required=True,
        metavar="ARRAY.json",
        help="unit of the table, places of the magnetometers in m, what is known of field and magnet",
    )
    parser.add_argument(
        "--turned",
        type=Path,
        metavar="RECORDING",
        help="the same array turned by hand in all directions far from magnets: calibrates it",
    )
    parser.add_argument(
        "--without",
        type=Path,
        metavar="RECORDING",
        help="the same array where it stands, without the magnet: what differs between magnetometers there is taken off",
    )
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="FILE.tsv",
        help="write place, moment and field with standard deviations there",
    )
    parser.epilog = "docs/magnet-array.md has the formats"


def run(arguments: argparse.Namespace) -> int:
    array = read_description(arguments.array)
    bench_readings.require_plausible(
        array.earth, array.moment, array.limit, array.place_sd, array.calibration_sd, array.gradient
    )
    readings = _load_readings(arguments.recording, array)
    limit = (
        None
        if array.limit is None
        else float(bench_readings.convert_to_tesla(np.array(array.limit), array.unit, array.earth))
    )
    statistics = bench_readings.compute_statistics(readings.t, readings.mag, limit)
    mag = np.where((statistics.is_saturated | statistics.is_stuck)[..., None], np.nan, readings.mag)
    q_bl, error, gains, messages = (
        array.q_bl,
        0.0,
        np.ones(len(array.names)),
        bench_readings.describe_statistics(array.names, statistics),
    )
    if arguments.turned:
        calibration = bench_readings.calibrate_by_rotation(
            _load_readings(arguments.turned, array).mag, array.names, array.earth
        )
        _require_unit(calibration.measured_strength, array.unit, arguments.turned.name)
        mag, q_bl, error, gains = (
            calibration.correct(mag),
            calibration.q_bl,
            float(np.sqrt((calibration.residual_rms**2).mean())),
            calibration.gains,
        )
        q_bl = q_bl if array.q_bl is None else quat.multiply(array.q_bl[0], q_bl)
        messages += _describe_calibration(array, calibration)
    else:
        error = UNCALIBRATED if array.calibration_sd is None else array.calibration_sd
        messages += (
            []
            if array.calibration_sd is not None or arguments.without
            else [_describe_uncalibrated(error)]
        )
    if arguments.without:
        empty = _load_readings(arguments.without, array).mag
        ambient = bench_readings.measure_ambient_field(
            calibration.correct(empty) if arguments.turned else empty, q_bl
        )
        error = (
            _ambient_error(ambient, mag, bool(arguments.turned))
            if array.calibration_sd is None
            else array.calibration_sd
        )
        mag = mag - ambient.ambient_deviation
    assumed = error if not arguments.turned and array.calibration_sd is None else 0.0
    error = max(error, 1e-8)
    messages += _describe_rate(readings)
    size_sd = (
        MOMENT if array.earth is not None and arguments.turned else float(np.hypot(MOMENT, GAIN))
    )
    noise = float(np.hypot(np.median(statistics.noise * gains), error))
    gradient_sd = field_gradient_test.gradient_sd_of(array.gradient)
    search = Search(
        readings.t,
        mag,
        magnet_setup.make_constellation(array.places, q_bl),
        noise,
        array.place_sd,
        gradient_sd,
    )
    result = magnet_search.locate_recording(search, array.moment, size_sd, error)
    localisation = _add_gain_uncertainty(result.localisation, size_sd)
    moment_doubts = _describe_moment(result.search, array.moment, localisation)
    if moment_doubts:  # what agrees with a wrong moment does so by chance
        localisation = replace(localisation, is_located=np.zeros_like(localisation.is_located))
    table = np.column_stack(
        [
            readings.t,
            localisation.place,
            localisation.place_sd,
            localisation.moment,
            localisation.moment_sd,
            localisation.field,
            localisation.residual_rms,
            localisation.is_located,
        ]
    )
    save_file(("\t".join(COLUMNS) + "\n").encode() + bytes(NumberTable((table,))), arguments.out)
    for sentence in [
        *messages,
        *_describe_offsets(result, array.names),
        *_describe_gradient(result, gradient_sd),
        *_describe_systematic_errors(result),
        *_describe_implausible(array, mag, localisation),
        *moment_doubts,
    ]:
        say(f"warning: {sentence}")
    for sentence in [
        *_describe_result(readings, result, localisation, assumed),
        *_describe_few(result, localisation, array.moment, size_sd),
    ]:
        say(sentence)
    return 0


def _load_readings(path: Path, array: ArrayDescription) -> BenchReadings:
    """Readings of the array's magnetometers on one time base, T."""
    if path.suffix.lower() in array_table.SUFFIXES and not path.name.endswith("_motion.tsv"):
        table = array_table.read_table(path, array)
        known, t, times = table.readings, table.t, table.times
        values = {
            name: bench_readings.convert_to_tesla(v, array.unit, array.earth)
            for name, v in known.items()
        }
    else:
        blocks = [
            b
            for b in formats_recordings.load(path, inertial=False).samples.values()
            if MAG in b.stream.quantities
        ]
        values = {s: b.of(MAG)[:, k] for b in blocks for k, s in enumerate(b.stream.sensors)}
        times = {s: b.t for b in blocks for s in b.stream.sensors}
        t = times[array.names[0]] if array.names[0] in times else np.empty(0)
    missing = [name for name in array.names if name not in values]
    if missing:
        raise InputError(
            f"{path.name} has no magnetometer {missing[0]!r}; it has {', '.join(values) or 'none'}"
        )
    each = [
        bench_readings.resample_readings(t, times[name], values[name])
        if name in times
        else values[name]
        for name in array.names
    ]
    return BenchReadings(t, np.stack(each, axis=1))


def _ambient_error(ambient: AmbientReference, mag: Array, is_calibrated: bool) -> float:
    """Error of readings (n, magnetometers, 3), T, after the ambient correction; without calibration
    the gains' share of the magnet's field adds to it."""
    added = mag - ambient.mean_reading
    added = added[np.isfinite(added).all(axis=2)]
    gains = (
        0.0
        if is_calibrated or not len(added)
        else GAIN * float(np.median(np.linalg.norm(added, axis=1))) / np.sqrt(3.0)
    )
    return float(np.hypot(ambient.drift, gains))


def _add_gain_uncertainty(localisation: Localisation, size_sd: float) -> Localisation:
    """Moments are known no better than the chips' gain."""
    return replace(
        localisation, moment_sd=np.hypot(localisation.moment_sd, size_sd * localisation.moment)
    )


def _describe_uncalibrated(error: float) -> str:
    return (
        f"not calibrated: iron on the board and turned chips are not seen, {1e6 * error:.2g} uT an axis are counted for them; record the array turned by hand "
        "and give --turned, or tell `calibration_sd` in the array's file if the readings are calibrated already"
    )


def _describe_calibration(array: ArrayDescription, calibration: RotationCalibration) -> list[str]:
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


def _describe_gradient(result: LocalisationResult, declared_sd: float) -> list[str]:
    """A message where the field changes across the array by more than declared."""
    if result.search.gradient_sd <= declared_sd:
        return []
    change = field_gradient_test.rms_change_of(result.search.gradient_sd)
    return [
        f"the field changes by about {1e6 * change:.2g} uT a metre across the array: iron is near; what it changes by counts as unknown, places are less sure for it"
    ]


def _describe_systematic_errors(result: LocalisationResult) -> list[str]:
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


def _describe_offsets(result: LocalisationResult, names: Sequence[str]) -> list[str]:
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


def _describe_few(
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


def _describe_result(
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


def _require_unit(strength: float, unit: str | float, name: str) -> None:
    """InputError where the field of the rotated array is not the earth's."""
    if not EARTH_WEAKEST <= strength <= EARTH_STRONGEST:
        raise InputError(
            f"{name}: the array read {1e6 * strength:.3g} uT while it was turned; the earth's field is 22 to 67 uT. {_ask_unit(strength, unit)}"
        )


def _ask_unit(strength: float, unit: str | float) -> str:
    fitting = bench_readings.find_fitting_units(strength, unit)
    declared = f"{unit:g} T a count" if isinstance(unit, (int, float)) else unit
    return (
        f"The unit is told as {declared}: is it {' or '.join(fitting)}?"
        if fitting
        else f"Is the unit told, {declared}, that of the table?"
    )


def _describe_rate(readings: BenchReadings) -> list[str]:
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


def _describe_implausible(
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


def _describe_moment(search: Search, moment: float | None, localisation: Localisation) -> list[str]:
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
