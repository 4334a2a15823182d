"""Tables of what a force sensor read under known loads, as somebody writes them down: one row a load, columns by name with their unit in brackets.

In      text with a header; comma, semicolon or tab between columns; lines that begin with # or % are passed over, and so are columns without a unit (notes).
        Loads are given as weights: `mass [g]` with the direction of gravity in the sensor's frame, `down` (+x, -x, +y, ... or none) or `down_x`, `down_y`, `down_z`,
        or `acc_x [m/s^2]`, `acc_y`, `acc_z`, what the accelerometer on the same cuff reads meanwhile: then the loads are in that sensor's frame;
        and where they hang, `at_x [mm]`, `at_y`, `at_z`; or as what a fingertip would exert, `force_x [N]`, `force_y`, `force_z`, and `torque_x [N*mm]`, ...
        Every other column with a unit is a channel of the sensor
Out     LoadTable in SI; docs/calibration.md. A weight pulls the sensor down: a fingertip that does what the sensor then feels exerts the opposite
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.force.setup import Channel
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.sessions.motion_bids.reader import TORQUES
from handscope.sessions.tables_io.array_cells import MISSING, is_number, read_lines

HEADER = re.compile(r"(?P<name>[^\[\]]*?)\s*\[(?P<unit>[^\[\]]+)\]$")
UNITS = {
    "mass": {"kg": 1.0, "g": 1e-3},
    "acc": {"m/s^2": 1.0, "m/s²": 1.0, "g": GRAVITY},
    "at": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "force": {"N": 1.0, "mN": 1e-3},
    "torque": TORQUES,
}
DIRECTIONS: dict[str, Array] = {
    f"{sign}{axis}": float(f"{sign}1") * np.eye(3)[k]
    for k, axis in enumerate("xyz")
    for sign in "+-"
}
MINUS = "\N{MINUS SIGN}"  # as word processors write it
LARGEST = 2**24  # bytes of a table
SEPARATED = "leave a cell empty where nothing is told, and separate columns by semicolons where numbers have decimal commas"
HOW = "tell loads as mass [g] with down, or as force_x [N], force_y [N], force_z [N]"


@dataclass(frozen=True)
class LoadTable:
    """Raw channels of a force sensor (n, c) under known loads (n, 3), N."""

    channels: tuple[Channel, ...]
    raw: Array  # (n, channels) in the channels' units
    loads: Array  # (n, 3) N, or (n, 6) N and Nm, as a fingertip would exert them
    lines: tuple[int, ...]  # of the file, where each load stands
    by_accelerometer: bool  # the loads are in the frame of the inertial sensor on the same cuff, whose accelerometer gave their directions


def load_table(path: Path, gravity: float) -> LoadTable:
    """Read a table; InputError names the file, the line and what to do."""
    with read_lines(path, LARGEST, "16 MB: give one row a load") as lines:
        found = list(lines)
    if len(found) < 2:
        raise InputError("loads.empty", name=path.name)
    columns = _Columns(path.name, found[0][1], found[1:])
    loads = (
        _of_weights(columns, gravity)
        if "mass" in columns.names or "down" in columns.names
        else _of_forces(columns)
    )
    channels = columns.channels()
    columns.require_enough(channels, loads.shape[1])
    raw = np.stack([columns.numbers(c.name) for c in channels], axis=1)
    return LoadTable(
        channels, raw, loads, tuple(number for number, _ in found[1:]), "acc_x" in columns.names
    )


class _Columns:
    """The columns of one file by their names."""

    def __init__(
        self, file: str, header: Sequence[str], rows: Sequence[tuple[int, list[str]]]
    ) -> None:
        self.file, self.rows = file, rows
        parsed = [
            (m["name"], m["unit"]) if (m := HEADER.match(cell)) else (cell, "") for cell in header
        ]
        self.names = [name for name, _ in parsed]
        self.units = {name: unit.strip() for name, unit in parsed if unit}
        if len(set(self.names)) < len(self.names):
            raise InputError("loads.column_twice", file=file)
        for number, cells in rows:
            if len(cells) != len(header):
                raise InputError(
                    "loads.row_length",
                    file=file,
                    number=number,
                    cells=len(cells),
                    header=len(header),
                    separated=SEPARATED,
                )

    def channels(self) -> tuple[Channel, ...]:
        """Columns with a unit that tell no load."""
        own = [name for name in self.units if name not in _LOADS]
        if not own:
            raise InputError("loads.no_channels", file=self.file)
        return tuple(Channel(name, self.units[name]) for name in own)

    def require_enough(self, channels: Sequence[Channel], axes: int) -> None:
        """InputError where a column that lacks its unit may be the channel that is missing."""
        nameless = [name for name in self.names if name not in self.units and name not in _LOADS]
        readings = [
            name
            for name in nameless
            if name and all(is_number(cell) for _, cell in self.words(name))
        ]
        readings = [name for name in readings if np.isfinite(self.numbers(name)).any()]
        if len(channels) < axes and readings:
            raise InputError(
                "loads.too_few_channels",
                file=self.file,
                channels=len(channels),
                axes=axes,
                readings=readings[0],
                units=channels[0].units,
            )

    def numbers(self, name: str, factor: float = 1.0) -> Array:
        """Numbers (n,) of a column; NaN where a cell is empty."""
        k = self.names.index(name)
        return factor * np.array(
            [_number(f"{self.file}, line {number}", name, cells[k]) for number, cells in self.rows]
        )

    def words(self, name: str) -> list[tuple[int, str]]:
        """Line and cell."""
        k = self.names.index(name)
        return [(number, cells[k]) for number, cells in self.rows]

    def three(self, kind: str) -> Array | None:
        """(n, 3) SI of the columns kind_x, kind_y, kind_z; None where there is none of them."""
        names = [f"{kind}_{axis}" for axis in "xyz"]
        present = [name for name in names if name in self.names]
        if not present:
            return None
        if len(present) < 3:
            raise InputError(
                "loads.axes_incomplete",
                file=self.file,
                present=", ".join(present),
                names=", ".join(names),
            )
        return np.stack([self.numbers(name, self.factor(name, kind)) for name in names], axis=1)

    def factor(self, name: str, kind: str) -> float:
        known = UNITS[kind]
        if self.units.get(name) not in known:
            unit_words = (
                f"the unknown unit {self.units[name]!r}" if name in self.units else "no unit"
            )
            raise InputError(
                "loads.unknown_unit",
                file=self.file,
                name=name,
                unit_words=unit_words,
                known=next(iter(known)),
                known2=list(known)[-1],
            )
        return known[self.units[name]]


_LOADS = {
    "mass",
    "down",
    *(f"{kind}_{axis}" for kind in ("down", "acc", "at", "force", "torque") for axis in "xyz"),
}


def _of_weights(columns: _Columns, gravity: float) -> Array:
    """Weights that hang on the sensor: F = -m g d, and M = r x F where the point r is given."""
    if "mass" not in columns.names:
        raise InputError("loads.mass_missing", file=columns.file)
    mass = columns.numbers("mass", columns.factor("mass", "mass"))
    down = _down(columns)
    down[mass == 0] = 0.0  # nothing hung: it does not matter where down was
    force = -gravity * mass[:, None] * down
    at = columns.three("at")
    if at is None:
        return force + 0.0  # no -0
    at[mass == 0] = 0.0
    return np.concatenate([force, np.cross(at, force)], axis=1) + 0.0


def _down(columns: _Columns) -> Array:
    """Direction of gravity in the sensor's frame (n, 3), unit; NaN where none is given."""
    acc = columns.three("acc")
    if acc is not None:
        if {"down", "down_x", "down_y", "down_z"} & set(columns.names):
            raise InputError("loads.down_twice", file=columns.file)
        return np.asarray(-acc / np.linalg.norm(acc, axis=1, keepdims=True))
    if "down" in columns.names:
        return np.array(
            [
                _direction(f"{columns.file}, line {number}", word)
                for number, word in columns.words("down")
            ]
        )
    if "down_x" not in columns.names:
        raise InputError("loads.down_missing", file=columns.file)
    down = np.stack(
        [
            columns.numbers(f"down_{axis}")
            if f"down_{axis}" in columns.names
            else np.zeros(len(columns.rows))
            for axis in "xyz"
        ],
        1,
    )
    size = np.linalg.norm(down, axis=1, keepdims=True)
    return np.asarray(down / np.where(size > 0, size, np.nan))


def _direction(where: str, word: str) -> Array:
    word = word.lower().replace(MINUS, "-")
    if word in MISSING or word == "-":
        return np.full(3, np.nan)
    found: Array | None = DIRECTIONS.get(word if word[0] in "+-" else f"+{word}")
    if found is None:
        raise InputError("loads.down_unknown", where=where, word=word)
    return found


def _of_forces(columns: _Columns) -> Array:
    force, torque = columns.three("force"), columns.three("torque")
    if force is None:
        raise InputError("loads.no_loads", file=columns.file, how=HOW)
    return force if torque is None else np.concatenate([force, torque], axis=1)


def _number(where: str, name: str, cell: str) -> float:
    if cell.lower() in MISSING:
        return float("nan")
    try:
        value = float(cell.replace(MINUS, "-"))
    except ValueError:
        raise InputError("loads.not_a_number", where=where, name=name, cell=cell) from None
    if not np.isfinite(value):
        raise InputError("loads.not_finite", where=where, name=name, cell=cell)
    return value
