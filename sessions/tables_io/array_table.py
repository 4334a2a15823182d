"""Tables of a magnetometer array, as a bench writes them: one row an instant, columns by name or by number.

In      text, with a header or without; comma, semicolon, tab or spaces between columns, decimal comma where it separates none; lines that begin with # or %
        are passed over, and so are columns that nobody asks for, text in them too. Empty, n/a or nan is missing. A cell may hold x, y and z: "(1.5, 2, 3)".
        One row an instant, or one row a magnetometer and instant, of which a column says whose it is
Out     Table: times and readings by name; docs/magnet-array.md
"""

from array import array as numbers
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.numerics.typing import Array
from handscope.sessions.tables_io.array_cells import (
    MISSING,
    Line,
    is_number,
    lines_in,
    number_in,
    opened,
    spread,
    without_end,
)
from handscope.sessions.tables_io.array_description import IN_TURN, ISO, Column, Described, Timing

SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".log")
AXES = ("_x", "_y", "_z")
LARGEST = 2**30  # bytes of a table


@dataclass(frozen=True)
class Table:
    t: Array  # (n,) s
    readings: Mapping[str, Array]  # (n, 3) each, NaN where missing
    times: Mapping[str, Array]  # (n,) s, of those with a time of their own


@dataclass(frozen=True)
class Columns:
    """Where what is asked for stands in a row, counted from 0."""

    t: int | None
    axes: Mapping[str, tuple[int, int, int]]
    own: Mapping[str, int]  # times of those that have their own
    whose: int | None = None  # the name, where every row is one magnetometer's
    single: bool = False  # every row is one magnetometer's; all have the same axes

    @property
    def all(self) -> list[int]:
        leading = [k for k in (self.t, self.whose) if k is not None]
        each = list(self.axes.values())[:1] if self.single else list(self.axes.values())
        return [*leading, *self.own.values(), *(k for three in each for k in three)]


def table(path: Path, told: Described) -> Table:
    """Read the columns of the array's magnetometers; InputError names the file, the line and what to do."""
    with lines_in(path, LARGEST, "1 GB: cut it into pieces") as lines:
        first = next(lines, None)
        if first is None:
            raise InputError(f"{path.name} holds no readings")
        header = without_end(first[1])
        bare = all(is_number(cell) or opened(cell) for cell in header)
        second = first if bare else next(lines, None)
        if second is None:
            raise InputError(f"{path.name} holds no readings")
        wide = [bool(opened(cell)) for cell in second[1]][: len(header)] + [False] * (
            len(header) - len(second[1])
        )
        names = [
            name + axis for name, three in zip(header, wide) for axis in (AXES if three else ("",))
        ]
        columns = _columns(path.name, [] if bare else names, len(names), told)
        rows = _rows(
            path.name, _again(second, lines), wide if any(wide) else [], len(header), columns, told
        )
    if columns.single:
        return _by_magnetometer(path.name, rows, columns, told)
    t, times = _times(path.name, rows, columns, told.time)
    where = {k: i for i, k in enumerate(columns.all)}
    return Table(
        t, {name: rows[:, [where[k] for k in axes]] for name, axes in columns.axes.items()}, times
    )


def _again(first: Line, rest: Iterator[Line]) -> Iterator[Line]:
    yield first
    yield from rest


def _columns(file: str, header: Sequence[str], many: int, told: Described) -> Columns:
    if len(set(header)) < len(header):
        raise InputError(f"{file}: two columns have the same name")
    place: dict[Column, int] = {name: k for k, name in enumerate(header)} | {
        k + 1: k for k in range(many)
    }
    small = {name.lower(): k for k, name in reversed(list(enumerate(header)))}
    time: int | None = None
    if told.time.rate is None:
        if told.time.column not in place:
            raise InputError(
                f"{file}: the first line must name the columns t (s) and <name>_x, <name>_y, <name>_z of every magnetometer, or the array's file tell `time` and "
                f"`columns`; there is no column {told.time.column!r} but {_some(header, many)}"
            )
        time = place[told.time.column]
    if told.sensor is not None:
        return _of_long(file, header, many, told, place, time)
    axes, own = {}, {}
    for name in told.names:
        asked = told.columns.get(name)
        found = (
            [small.get(f"{name}_{axis}".lower()) for axis in "xyz"]
            if asked is None
            else [place.get(column) for column in asked]
        )
        x, y, z = found
        if x is None or y is None or z is None:
            raise InputError(
                f"{file} has no magnetometer {name!r}: columns {name}_x, {name}_y, {name}_z are looked for, or those that the array's file tells as its `columns`; it has {_some(header, many)}"
            )
        axes[name] = (x, y, z)
        if f"{name}_t" in place:
            own[name] = place[f"{name}_t"]
    return Columns(time, axes, own)


def _of_long(
    file: str,
    header: Sequence[str],
    many: int,
    told: Described,
    place: Mapping[Column, int],
    time: int | None,
) -> Columns:
    """Where every row is one magnetometer's: whose stands in a column of its own."""
    asked = told.columns[told.names[0]]
    x, y, z = (place.get(column) for column in asked)
    whose = None if told.sensor in (None, IN_TURN) else place.get(told.sensor)
    if x is None or y is None or z is None or (whose is None and told.sensor != IN_TURN):
        raise InputError(
            f"{file} lacks one of the columns {', '.join(map(str, asked))} and {told.sensor}, told as `columns` and `sensor`; it has {_some(header, many)}"
        )
    return Columns(time, dict.fromkeys(told.names, (x, y, z)), {}, whose, True)


def _some(header: Sequence[str], many: int) -> str:
    return (
        ", ".join(header[:6]) + (", ..." if len(header) > 6 else "")
        if header
        else f"{many} columns without names, counted from 1"
    )


def _rows(
    file: str,
    lines: Iterator[Line],
    wide: Sequence[bool],
    many: int,
    columns: Columns,
    told: Described,
) -> Array:
    """The columns asked for (n, k); one number takes 8 bytes, not a Python object. `wide`: which cells hold three, empty where none does."""
    wanted, values = columns.all, numbers("d")
    reading: list[Callable[[str], float]] = [
        _instant if k == columns.t and told.time.unit == ISO else number_in for k in wanted
    ]
    if columns.whose is not None:
        reading[wanted.index(columns.whose)] = _whose(told.names)
    for number, line in lines:
        cells = without_end(line, many)
        if len(cells) != many:
            raise InputError(
                f"{file}, line {number}: {len(cells)} columns where the first line has {many}"
            )
        try:
            cells = spread(cells, wide) if wide else cells
            values.extend(read(cells[k]) for k, read in zip(wanted, reading))
        except ValueError as problem:
            raise InputError(f"{file}, line {number}: {problem}") from problem
    if not values:
        raise InputError(f"{file} holds no readings")
    return np.frombuffer(values).reshape(-1, len(wanted))


def _whose(names: Sequence[str]) -> Callable[[str], float]:
    """The number of a magnetometer by its name, also where a table writes 1 as 1.0; NaN of others, whose rows are passed over."""
    known = {name: float(k) for k, name in enumerate(names)}

    def number(cell: str) -> float:
        if cell not in known and is_number(cell) and cell.lower() not in MISSING:
            cell = f"{float(cell):g}"
        return known.get(cell, float("nan"))

    return number


def _instant(cell: str) -> float:
    return datetime.fromisoformat(cell).timestamp()


def _times(
    file: str, rows: Array, columns: Columns, time: Timing
) -> tuple[Array, Mapping[str, Array]]:
    """Seconds from the first row, and of the magnetometers that have times of their own."""
    if columns.t is None:
        assert time.rate is not None
        return np.arange(len(rows)) / time.rate, {}
    t = rows[:, 0]
    _require_increasing(file, t)
    return (t - t[0]) * time.seconds, {
        name: (rows[:, 1 + k] - t[0]) * time.seconds for k, name in enumerate(columns.own)
    }


def _by_magnetometer(file: str, rows: Array, columns: Columns, told: Described) -> Table:
    """Rows (n, k) that are each one magnetometer's; its times are the table's where all have the same, else each has its own."""
    if len(rows) % len(told.names) and columns.whose is None:
        raise InputError(
            f"{file} has {len(rows)} rows, no multiple of the array's {len(told.names)} magnetometers: one is missing, or they do not come in turn"
        )
    whose = (
        np.arange(len(rows)) % len(told.names)
        if columns.whose is None
        else rows[:, columns.all.index(columns.whose)]
    )
    parts = {name: rows[whose == k] for k, name in enumerate(told.names)}
    if missing := [name for name, part in parts.items() if not len(part)]:
        raise InputError(f"{file} has no magnetometer {missing[0]!r} in its column {told.sensor!r}")
    readings = {name: part[:, -3:] for name, part in parts.items()}
    if columns.t is None:
        most = max(len(part) for part in parts.values())
        if fewer := [name for name, part in parts.items() if len(part) < most]:
            raise InputError(
                f"{file}: {fewer[0]} has {len(parts[fewer[0]])} rows, others {most}: without times it cannot be told which belong together"
            )
        assert told.time.rate is not None
        return Table(np.arange(most) / told.time.rate, readings, {})
    for name, part in parts.items():
        _require_increasing(f"{file}, {name}", part[:, 0])
    times = {name: (part[:, 0] - rows[0, 0]) * told.time.seconds for name, part in parts.items()}
    first = times[told.names[0]]
    if all(len(t) == len(first) and (t == first).all() for t in times.values()):
        times = {}
    return Table(first, readings, times)


def _require_increasing(file: str, t: Array) -> None:
    behind = np.flatnonzero(~(np.diff(t) > 0))
    if len(t) < 2 or not np.isfinite(t).all() or len(behind):
        at = f"; {t[behind[0] + 1]:.10g} comes after {t[behind[0]]:.10g}" if len(behind) else ""
        raise InputError(
            f"{file}: the times must all be there and increase{at}. Where they cannot be mended, tell `rate` in the array's file instead"
        )
