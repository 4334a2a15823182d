"""`handscope locate`: where a magnet is, reading by reading, from the recording of any magnetometer array; docs/magnet-array.md."""

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.commands.words import say
from estimators import magnet_array, magnet_localisation, magnet_setup
from estimators.errors import InputError
from estimators.magnet_array import Looked, Turned
from estimators.magnet_localisation import Located
from estimators.quaternions import Array
from estimators.samples import MAG
from sessions import array_table, formats
from sessions.array_table import Described
from sessions.number_table import NumberTable
from sessions.writing import save_file

COLUMNS = (
    *("t", "x", "y", "z", "x_sd", "y_sd", "z_sd", "moment_x", "moment_y", "moment_z", "moment_x_sd", "moment_y_sd", "moment_z_sd"),
    *("field_x", "field_y", "field_z", "left", "found"),
)
MOMENT = 0.015  # of the moment: how well it is known, and the dipole as a model; as magnet_options.py has it
GAIN = 0.03  # of a magnetometer's readings: data sheets say up to 5 % either way (AK8975, HMC5883L)
FEW, MANY_REGIONS = 9, 3  # so few magnetometers are explained by several places; with more the octants' best ones lead to the same


@dataclass(frozen=True)
class Read:
    t: Array  # (n,) s
    mag: Array  # (n, magnetometers, 3) T


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "recording", type=Path, help="a table (.csv, .tsv), or a recording whose magnetometers are named as in the array's file"
    )
    parser.add_argument(
        "--array",
        type=Path,
        required=True,
        metavar="ARRAY.json",
        help="unit of the table, places of the magnetometers in m, what is known of field and magnet",
    )
    parser.add_argument(
        "--turned", type=Path, metavar="RECORDING", help="the same array turned by hand in all directions far from magnets: calibrates it"
    )
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FILE.tsv", help="write place, moment and field with standard deviations there"
    )
    parser.epilog = "docs/magnet-array.md has the formats"


def run(arguments: argparse.Namespace) -> int:
    array = array_table.described(arguments.array)
    read = _read(arguments.recording, array)
    limit = None if array.limit is None else float(magnet_array.in_tesla(np.array(array.limit), array.unit, array.earth))
    looked = magnet_array.looked(read.t, read.mag, limit)
    mag = np.where(looked.limited[..., None], np.nan, read.mag)
    q_bl, left, told = array.q_bl, 0.0, magnet_array.sentences(array.names, looked)
    if arguments.turned:
        found = magnet_array.turned(_read(arguments.turned, array).mag, array.names, array.earth)
        mag, q_bl, left = found.corrected(mag), found.q_bl, float(np.sqrt((found.left**2).mean()))
        told += _calibrated(array, found)
    else:
        told.append("not calibrated: iron on the board and turned chips are not seen; record the array turned by hand and give --turned")
    noise = float(np.hypot(np.median(looked.noise), left))
    constellation = magnet_setup.constellation(array.places, q_bl)
    size_sd = MOMENT if array.earth is not None and arguments.turned else float(np.hypot(MOMENT, GAIN))
    regions = MANY_REGIONS if len(constellation) <= FEW else magnet_localisation.REGIONS
    located = magnet_localisation.located(
        mag, constellation, None, array.moment, max(noise, 1e-8), size_sd=size_sd, regions=regions, place_sd=array.place_sd
    )
    table = np.column_stack(
        [read.t, located.place, located.place_sd, located.moment, located.moment_sd, located.field, located.left, located.found]
    )
    save_file(("\t".join(COLUMNS) + "\n").encode() + bytes(NumberTable((table,))), arguments.out)
    for sentence in told:
        say(f"warning: {sentence}")
    for sentence in _answer(read, looked, located, noise):
        say(sentence)
    return 0


def _read(path: Path, array: Described) -> Read:
    """The readings of the array's magnetometers on one time base, T."""
    if path.suffix in array_table.SUFFIXES:
        table = array_table.table(path)
        known, t, times = table.readings, table.t, table.times
        values = {name: magnet_array.in_tesla(v, array.unit, array.earth) for name, v in known.items()}
    else:
        blocks = [b for b in formats.load(path).samples.values() if MAG in b.stream.quantities]
        values = {s: b.of(MAG)[:, k] for b in blocks for k, s in enumerate(b.stream.sensors)}
        times = {s: b.t for b in blocks for s in b.stream.sensors}
        t = times[array.names[0]] if array.names[0] in times else np.empty(0)
    missing = [name for name in array.names if name not in values]
    if missing:
        raise InputError(f"{path.name} has no magnetometer {missing[0]!r}; it has {', '.join(values) or 'none'}")
    each = [magnet_array.together(t, times[name], values[name]) if name in times else values[name] for name in array.names]
    return Read(t, np.stack(each, axis=1))


def _calibrated(array: Described, found: Turned) -> list[str]:
    """What the calibration found that somebody has to know."""
    said = [
        f"{name}: an axis points the other way than on {array.names[0]}; turned round"
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


def _answer(read: Read, looked: Looked, located: Located, noise: float) -> list[str]:
    """In words: how often a place was found and how well."""
    found = located.found
    said = [
        f"{len(read.t)} readings of {read.mag.shape[1]} magnetometers in {read.t[-1]:.1f} s; noise and calibration {1e6 * noise:.2g} uT an axis",
        *_strange(located),
    ]
    if not found.any():
        return [*said, f"no magnet is found: {_why(located, noise)}"]
    sd, size = np.linalg.norm(located.place_sd[found], axis=1), np.linalg.norm(located.moment[found], axis=1)
    return [
        *said,
        f"magnet found in {100 * found.mean():.0f} % of them, place to {1e3 * np.median(sd):.2g} mm (median), moment {np.median(size):.3g} A m^2",
        *([f"not found in the others: {_why(located, noise)}"] if not found.all() else []),
    ]


def _strange(located: Located) -> list[str]:
    """A sentence where what is left without the magnet is no earth's field: places do not tell a wrong unit, moments are as wrong."""
    strength = np.linalg.norm(located.field, axis=1)
    strength = strength[np.isfinite(strength)]
    if not len(strength) or magnet_setup.EARTH_WEAKEST <= np.median(strength) <= magnet_setup.EARTH_STRONGEST:
        return []
    return [
        f"warning: without the magnet {1e6 * np.median(strength):.3g} uT are left (median), the earth's field is 22 to 67 uT: "
        "is the unit that of the table? moments are as wrong as it is; or iron is on the board or near"
    ]


def _why(located: Located, noise: float) -> str:
    """Why places are not told, of what is most often so."""
    lost = ~located.found
    strange = np.nan_to_num(located.misfit[lost]) > 3
    if np.isnan(located.left[lost]).mean() > 0.5:
        return "readings are missing or at their limit"
    if strange.mean() > 0.5:
        return (
            "the readings are not those of one magnet in a homogeneous field: a second magnet, iron near, wrong places, or no calibration"
        )
    return "the magnet is too far away or too near for a sure place"
