"""`handscope locate`: where a magnet is, reading by reading, from the recording of any magnetometer array; docs/magnet-array.md."""

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
from handscope.estimators.magnet.array.bench_readings import Still, Turned
from handscope.estimators.magnet.array.localisation import Located
from handscope.estimators.magnet.array.search import Search, Searched
from handscope.estimators.magnet.array.timestamp_offsets import TOLD
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
from handscope.sessions.tables_io.array_description import Described, described
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
MOMENT = 0.015  # of the moment: how well it is known, and the dipole as a model; as magnet_options.py has it
UNCALIBRATED = (
    2e-6  # T an axis that is counted for magnetometers of which nobody says how they are calibrated
)
GAIN = 0.03  # of a magnetometer's readings: data sheets say up to 5 % either way (AK8975, HMC5883L)
UNSEEN = 5e-6  # T/m: of such a field few magnetometers say what it would do; ours, a room with steel some metres away
TRIED = 200  # readings that are looked at once more without the moment told
RATES = (2.0, 5000.0)  # Hz: readings that come slower or faster were hardly stamped in seconds


@dataclass(frozen=True)
class Read:
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
    array = described(arguments.array)
    bench_readings.require_sense(
        array.earth, array.moment, array.limit, array.place_sd, array.calibration_sd, array.gradient
    )
    read = _read(arguments.recording, array)
    limit = (
        None
        if array.limit is None
        else float(bench_readings.in_tesla(np.array(array.limit), array.unit, array.earth))
    )
    looked = bench_readings.looked(read.t, read.mag, limit)
    mag = np.where((looked.limited | looked.frozen)[..., None], np.nan, read.mag)
    q_bl, left, gains, told = (
        array.q_bl,
        0.0,
        np.ones(len(array.names)),
        bench_readings.sentences(array.names, looked),
    )
    if arguments.turned:
        found = bench_readings.turned(_read(arguments.turned, array).mag, array.names, array.earth)
        _require_unit(found.read, array.unit, arguments.turned.name)
        mag, q_bl, left, gains = (
            found.corrected(mag),
            found.q_bl,
            float(np.sqrt((found.left**2).mean())),
            found.gains,
        )
        q_bl = q_bl if array.q_bl is None else quat.multiply(array.q_bl[0], q_bl)
        told += _calibrated(array, found)
    else:
        left = UNCALIBRATED if array.calibration_sd is None else array.calibration_sd
        told += (
            [] if array.calibration_sd is not None or arguments.without else [_not_calibrated(left)]
        )
    if arguments.without:
        empty = _read(arguments.without, array).mag
        alone = bench_readings.still(found.corrected(empty) if arguments.turned else empty, q_bl)
        left = (
            _left_without(alone, mag, bool(arguments.turned))
            if array.calibration_sd is None
            else array.calibration_sd
        )
        mag = mag - alone.apart
    guessed = left if not arguments.turned and array.calibration_sd is None else 0.0
    left = max(left, 1e-8)
    told += _slow(read)
    size_sd = (
        MOMENT if array.earth is not None and arguments.turned else float(np.hypot(MOMENT, GAIN))
    )
    noise = float(np.hypot(np.median(looked.noise * gains), left))
    slopes = field_gradient_test.slope_of(array.gradient)
    search = Search(
        read.t, mag, magnet_setup.constellation(array.places, q_bl), noise, array.place_sd, slopes
    )
    answer = magnet_search.searched(search, array.moment, size_sd, left)
    located = _gain_counted(answer.located, size_sd)
    doubted = _moment_doubted(answer.search, array.moment, located)
    if doubted:  # what agrees with what is told by chance is no place
        located = replace(located, found=np.zeros_like(located.found))
    table = np.column_stack(
        [
            read.t,
            located.place,
            located.place_sd,
            located.moment,
            located.moment_sd,
            located.field,
            located.left,
            located.found,
        ]
    )
    save_file(("\t".join(COLUMNS) + "\n").encode() + bytes(NumberTable((table,))), arguments.out)
    for sentence in [
        *told,
        *_late(answer, array.names),
        *_uneven(answer, slopes),
        *_alike(answer),
        *_strange(array, mag, located),
        *doubted,
    ]:
        say(f"warning: {sentence}")
    for sentence in [
        *_answer(read, answer, located, guessed),
        *_few(answer, located, array.moment, size_sd),
    ]:
        say(sentence)
    return 0


def _read(path: Path, array: Described) -> Read:
    """The readings of the array's magnetometers on one time base, T."""
    if path.suffix.lower() in array_table.SUFFIXES and not path.name.endswith("_motion.tsv"):
        table = array_table.table(path, array)
        known, t, times = table.readings, table.t, table.times
        values = {
            name: bench_readings.in_tesla(v, array.unit, array.earth) for name, v in known.items()
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
        bench_readings.together(t, times[name], values[name]) if name in times else values[name]
        for name in array.names
    ]
    return Read(t, np.stack(each, axis=1))


def _left_without(alone: Still, mag: Array, turned: bool) -> float:
    """What readings (n, magnetometers, 3) are off by, T, where offsets were taken off; of an array that nobody turned gains err by their share of what the magnet adds."""
    added = mag - alone.read
    added = added[np.isfinite(added).all(axis=2)]
    gains = (
        0.0
        if turned or not len(added)
        else GAIN * float(np.median(np.linalg.norm(added, axis=1))) / np.sqrt(3.0)
    )
    return float(np.hypot(alone.left, gains))


def _gain_counted(located: Located, size_sd: float) -> Located:
    """Moments are no better known than the chips' gain."""
    return replace(located, moment_sd=np.hypot(located.moment_sd, size_sd * located.moment))


def _not_calibrated(left: float) -> str:
    return (
        f"not calibrated: iron on the board and turned chips are not seen, {1e6 * left:.2g} uT an axis are counted for them; record the array turned by hand "
        "and give --turned, or tell `calibration_sd` in the array's file if the readings are calibrated already"
    )


def _calibrated(array: Described, found: Turned) -> list[str]:
    """What the calibration found that somebody has to know."""
    said = [
        f"{name}: an axis points the other way than on most; turned round"
        for name, flip in zip(array.names, found.mirrored)
        if flip
    ]
    worst = int(np.argmax(found.left))
    if found.left[worst] > 0.02 * found.spheres[0].strength:
        said.append(
            f"{array.names[worst]}: {1e6 * found.left[worst]:.2g} uT are left against the others: the field was not the same across the array, or it was not rigid; "
            "standard deviations are as much larger"
        )
    return said


def _uneven(searched: Searched, told: float) -> list[str]:
    """A sentence where readings show that the field changes across the array more than was told."""
    if searched.search.uneven <= told:
        return []
    change = field_gradient_test.change_of(searched.search.uneven)
    return [
        f"the field changes by about {1e6 * change:.2g} uT a metre across the array: iron is near; what it changes by counts as unknown, places are less sure for it"
    ]


def _alike(searched: Searched) -> list[str]:
    """A sentence where all readings together told what errs in each of them, and that was taken off."""
    if (alike := searched.alike) is None:
        return []
    sizes = dict(
        zip((kind.name for kind in systematic_errors.KINDS), (float(size) for size in alike.sizes))
    )
    looks = {
        "offset": f"offsets of {1e6 * sizes['offset']:.2g} uT",
        "gain": f"gains and axes that are off by {100 * sizes['gain']:.2g} %",
        "place": f"magnetometers that sit {1e3 * sizes['place']:.2g} mm from where they are told",
        "late": f"readings that are late by {1e3 * sizes['late']:.2g} ms",
        "length": f"a magnet as long as a rod of {200 * np.sqrt(6 * sizes['length']):.2g} cm",
        "slope": f"a field that changes by {1e6 * field_gradient_test.change_of(sizes['slope']):.2g} uT a metre",
        "turn": f"axes of the magnetometers that are turned by {np.degrees(np.sqrt(3) * sizes['turn']):.2g} degrees against the board",
        "moment": "a moment that is not as told",
    }
    return [
        f"what errs alike in all readings was told by all of them together and taken off the places; most of it looks like {looks[alike.most.name]}"
    ]


def _late(searched: Searched, names: Sequence[str]) -> list[str]:
    """Sentences of magnetometers whose readings were moved to when they were taken."""
    late = [
        f"{name} by {1e3 * late:.0f} ms (standard deviation {1e3 * sd:.1g})"
        for name, late, sd in zip(names, searched.late.late, searched.late.sd)
        if late
    ]
    if not late:
        return []
    spread = searched.late.spread
    unsure = (
        f"; whose times are right is not told, {1e3 * spread:.0f} ms are counted for it"
        if spread > TOLD
        else ""
    )
    return [
        f"readings come later than the others' (earlier, where less than 0) and were moved by that: {', '.join(late)}{unsure}"
    ]


def _few(searched: Searched, located: Located, moment: float | None, size_sd: float) -> list[str]:
    """What magnetometers that are too few to see it do not tell."""
    rows = np.flatnonzero(located.found & np.isfinite(searched.search.mag).all(axis=(1, 2)))
    if (
        len(searched.search.array) >= field_gradient_test.FEWEST
        or searched.search.uneven
        or searched.alike
        or not len(rows)
    ):
        return []
    told, x = magnet_search.explained(
        searched.search, located, moment, size_sd, rows[:: -(-len(rows) // TRIED)]
    )
    off = 1e3 * float(np.median(field_gradient_test.misplaced(told, x, UNSEEN)))
    return [
        f"{len(searched.search.array)} magnetometers cannot tell a field that changes across the array: {1e6 * UNSEEN:.0f} uT a metre would draw places by {off:.2g} mm (median); "
        "tell `gradient` in the array's file if iron is near"
    ]


def _answer(read: Read, searched: Searched, located: Located, guessed: float) -> list[str]:
    """In words: how often a place was found and how well."""
    found = located.found
    said = [
        f"{len(read.t)} readings of {read.mag.shape[1]} magnetometers in {read.t[-1]:.1f} s; noise and calibration {1e6 * searched.search.noise:.2g} uT an axis",
    ]
    if not found.any():
        return [*said, f"no magnet is found: {_why(searched, located, guessed)}"]
    sd, size = (
        np.linalg.norm(located.place_sd[found], axis=1),
        np.linalg.norm(located.moment[found], axis=1),
    )
    return [
        *said,
        f"magnet found in {100 * found.mean():.0f} % of them, place to {1e3 * np.median(sd):.2g} mm (median), moment {np.median(size):.3g} A m^2",
        *(
            [f"not found in the others: {_why(searched, located, guessed)}"]
            if not found.all()
            else []
        ),
    ]


def _require_unit(read: float, unit: str | float, name: str) -> None:
    """InputError where the field read while the array was turned is no earth's."""
    if not EARTH_WEAKEST <= read <= EARTH_STRONGEST:
        raise InputError(
            f"{name}: the array read {1e6 * read:.3g} uT while it was turned; the earth's field is 22 to 67 uT. {_unit_asked(read, unit)}"
        )


def _unit_asked(read: float, unit: str | float) -> str:
    fitting = bench_readings.units_that_fit(read, unit)
    told = f"{unit:g} T a count" if isinstance(unit, (int, float)) else unit
    return (
        f"The unit is told as {told}: is it {' or '.join(fitting)}?"
        if fitting
        else f"Is the unit told, {told}, that of the table?"
    )


def _slow(read: Read) -> list[str]:
    """A sentence where the times can hardly be seconds."""
    rate = (len(read.t) - 1) / float(read.t[-1] - read.t[0]) if len(read.t) > 1 else RATES[0]
    if RATES[0] <= rate <= RATES[1]:
        return []
    return [
        f"{rate:.3g} readings a second: are the times in s? The array's file tells another unit of them as `time`"
    ]


def _strange(array: Described, mag: Array, located: Located) -> list[str]:
    """Sentences where what is left without the magnet is no earth's field, or the magnet none for a hand: places do not tell a wrong unit."""
    said = []
    explained = located.misfit < magnet_search.worst_misfit(mag.shape[1])
    read = np.linalg.norm(
        located.field[explained] if explained.any() else mag, axis=-1
    )  # nothing explained: that of the quieter magnetometers
    field = float(np.nanquantile(read, 0.5 if explained.any() else 0.25))
    if not EARTH_WEAKEST <= field <= EARTH_STRONGEST:
        said.append(
            f"without the magnet {1e6 * field:.3g} uT are left (median), the earth's field is 22 to 67 uT. {_unit_asked(field, array.unit)} "
            "Moments are as wrong as it is; or the field was taken off, or iron is on the board or near"
        )
    if located.found.any():
        size = float(np.median(np.linalg.norm(located.moment[located.found], axis=1)))
        if not WEAKEST <= size <= STRONGEST:
            said.append(
                f"a moment of {size:.3g} A m^2 is no magnet for a hand ({WEAKEST:g} to {STRONGEST:g}): is the unit that of the table, and are the "
                "magnetometers' places in m? Places ten times too large make moments a thousand times too large"
            )
    return said


def _moment_doubted(search: Search, moment: float | None, located: Located) -> list[str]:
    """A sentence where readings contradict the moment told: they are looked at without it."""
    if moment is None or len(search.array) < 4 or located.found.mean() > 0.5:
        return []
    some = np.flatnonzero(np.isfinite(search.mag).all(axis=(1, 2)))
    free = search.of(some[:: max(1, len(some) // TRIED)]).located(None, 1.0) if len(some) else None
    if free is None or free.found.mean() < 0.1:
        return []
    size = float(np.median(np.linalg.norm(free.moment[free.found], axis=1)))
    if abs(size / moment - 1) < 0.2:
        return []
    field = float(np.median(np.linalg.norm(free.field[free.found], axis=1)))
    return [
        f"the readings contradict the moment told, {moment:g} A m^2: without it they are those of a magnet of {size:.3g} A m^2 in a field of {1e6 * field:.3g} uT. "
        "Is the moment right, is the unit that of the table, and are the magnetometers' places in m?"
    ]


def _why(searched: Searched, located: Located, guessed: float) -> str:
    """Why places are not told, of what is most often so; `guessed` T is counted for calibrations that nobody told of."""
    lost = ~located.found
    if np.isnan(located.left[lost]).mean() > 0.5:
        return "readings are missing or at their limit"
    if searched.two[lost].mean() > 0.5:
        return "the readings are those of two magnets, or of one and iron near: take the other away, and what is of steel"
    if (searched.strange | searched.two)[lost].mean() > 0.5:
        return "the readings are not those of one magnet in a homogeneous field: a second magnet, iron near, wrong places, or no calibration"
    if guessed:
        return (
            f"the magnet is too far away or too near for a sure place with the {1e6 * guessed:.2g} uT an axis that are counted because nobody says how the array is "
            "calibrated: give --turned, or tell `calibration_sd` in the array's file"
        )
    return "the magnet is too far away or too near for a sure place"
