"""`handscope locate`: position of a magnet from a recording of any magnetometer array;
docs/magnet-array.md."""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from handscope.app.commands.locate_messages import (
    describe_calibration,
    describe_few,
    describe_gradient,
    describe_implausible,
    describe_moment,
    describe_offsets,
    describe_rate,
    describe_result,
    describe_systematic_errors,
    describe_uncalibrated,
    require_unit,
)
from handscope.app.commands.words import say
from handscope.estimators.data.samples import MAG
from handscope.estimators.errors import InputError
from handscope.estimators.magnet.array import bench_readings, field_gradient_test
from handscope.estimators.magnet.array.bench_readings import (
    AmbientReference,
    BenchReadings,
)
from handscope.estimators.magnet.array.localisation import Localisation
from handscope.estimators.magnet.array.recording_localisation import (
    locate_recording,
)
from handscope.estimators.magnet.array.search import Search
from handscope.estimators.magnet.model import setup as magnet_setup
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
MOMENT = 0.015  # of the moment: its error, with that of the dipole model, as in magnet/tracker/options.py
UNCALIBRATED = 2e-6  # T an axis, where nothing is declared of the calibration
GAIN = 0.03  # of a magnetometer's readings: data sheets say up to 5 % (AK8975, HMC5883L)


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
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
    """Run the verb; returns the exit code."""
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
    corrected = _correct_readings(arguments, array, mag)
    assumed = corrected.error if not arguments.turned and array.calibration_sd is None else 0.0
    error = max(corrected.error, 1e-8)
    size_sd = (
        MOMENT if array.earth is not None and arguments.turned else float(np.hypot(MOMENT, GAIN))
    )
    gradient_sd = field_gradient_test.gradient_sd_of(array.gradient)
    search = Search(
        readings.t,
        corrected.mag,
        magnet_setup.make_constellation(array.places, corrected.q_bl),
        float(np.hypot(np.median(statistics.noise * corrected.gains), error)),
        array.place_sd,
        gradient_sd,
    )
    result = locate_recording(search, array.moment, size_sd, error)
    localisation = _add_gain_uncertainty(result.localisation, size_sd)
    moment_doubts = describe_moment(result.search, array.moment, localisation)
    if moment_doubts:  # what agrees with a wrong moment does so by chance
        localisation = replace(localisation, is_located=np.zeros_like(localisation.is_located))
    _save_table(readings.t, localisation, arguments.out)
    for sentence in [
        *bench_readings.describe_statistics(array.names, statistics),
        *corrected.messages,
        *describe_rate(readings),
        *describe_offsets(result, array.names),
        *describe_gradient(result, gradient_sd),
        *describe_systematic_errors(result),
        *describe_implausible(array, corrected.mag, localisation),
        *moment_doubts,
    ]:
        say(f"warning: {sentence}")
    for sentence in [
        *describe_result(readings, result, localisation, assumed),
        *describe_few(result, localisation, array.moment, size_sd),
    ]:
        say(sentence)
    return 0


@dataclass(frozen=True)
class _Corrected:
    """Readings after the calibration and the subtraction of the ambient field."""

    mag: Array  # (n, magnetometers, 3) T
    q_bl: Array | None  # (magnetometers, 4) magnetometer axes to array axes
    error: float  # T an axis, of the calibration
    gains: Array  # (magnetometers,)
    messages: list[str]


def _correct_readings(
    arguments: argparse.Namespace, array: ArrayDescription, mag: Array
) -> _Corrected:
    """Calibrate readings (n, magnetometers, 3) T by the turned recording, and take off the ambient field of the empty one, where they are given."""
    q_bl, gains = array.q_bl, np.ones(len(array.names))
    if arguments.turned:
        calibration = bench_readings.calibrate_by_rotation(
            _load_readings(arguments.turned, array).mag, array.names, array.earth
        )
        require_unit(calibration.measured_strength, array.unit, arguments.turned.name)
        mag, q_bl, error, gains = (
            calibration.correct(mag),
            calibration.q_bl,
            float(np.sqrt((calibration.residual_rms**2).mean())),
            calibration.gains,
        )
        q_bl = q_bl if array.q_bl is None else quat.multiply(array.q_bl[0], q_bl)
        messages = describe_calibration(array, calibration)
    else:
        error = UNCALIBRATED if array.calibration_sd is None else array.calibration_sd
        messages = (
            []
            if array.calibration_sd is not None or arguments.without
            else [describe_uncalibrated(error)]
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
    return _Corrected(mag, q_bl, error, gains, messages)


def _save_table(t: Array, localisation: Localisation, path: Path) -> None:
    """Write the columns of COLUMNS, one row a reading."""
    table = np.column_stack(
        [
            t,
            localisation.place,
            localisation.place_sd,
            localisation.moment,
            localisation.moment_sd,
            localisation.field,
            localisation.residual_rms,
            localisation.is_located,
        ]
    )
    save_file(("\t".join(COLUMNS) + "\n").encode() + bytes(NumberTable((table,))), path)


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
            "command.unknown_magnetometer",
            name=path.name,
            missing=missing[0],
            value=", ".join(values) or "none",
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
