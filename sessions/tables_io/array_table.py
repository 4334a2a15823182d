"""Tables of a magnetometer array, as a bench writes them, with columns by name or by number.

In      text, with or without a header; comma, semicolon, tab or spaces between columns, decimal
        comma where it separates none. Lines that begin with # or % are skipped, and so are columns
        that are not asked for. Empty, n/a or nan is missing. A cell may hold x, y and z: "(1.5, 2,
        3)". One row an instant, or one row a magnetometer and instant with a column that names it
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
    drop_empty_end,
    expand_triples,
    is_number,
    parse_number,
    read_lines,
    split_triple,
)
from handscope.sessions.tables_io.array_description import (
    IN_TURN,
    ISO,
    ArrayDescription,
    Column,
    Timing,
)

SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".log")
AXES = ("_x", "_y", "_z")
MAX_BYTES = 2**30  # bytes of a table


@dataclass(frozen=True)
class Table:
    """Readings (n, L, 3) in T at times (n,), s."""

    t: Array  # (n,) s
    readings: Mapping[str, Array]  # (n, 3) each, NaN where missing
    times: Mapping[str, Array]  # (n,) s, of those with times of their own


@dataclass(frozen=True)
class Columns:
    """Columns to read, counted from 0."""

    t: int | None
    axes: Mapping[str, tuple[int, int, int]]
    own: Mapping[str, int]  # times of those that have their own
    sensor: int | None = None  # the name, where every row is one magnetometer's
    is_long: bool = False  # every row is one magnetometer's; all have the same axes

    @property
    def all(self) -> list[int]:
        leading = [k for k in (self.t, self.sensor) if k is not None]
        each = list(self.axes.values())[:1] if self.is_long else list(self.axes.values())
        return [*leading, *self.own.values(), *(k for three in each for k in three)]


def read_table(path: Path, array: ArrayDescription) -> Table:
    """Read the columns of the array's magnetometers; InputError names file, line and remedy."""
    with read_lines(path, MAX_BYTES, "1 GB: cut it into pieces") as lines:
        first = next(lines, None)
        if first is None:
            raise InputError("array.empty", file=path.name)
        header = drop_empty_end(first[1])
        bare = all(is_number(cell) or split_triple(cell) for cell in header)
        second = first if bare else next(lines, None)
        if second is None:
            raise InputError("array.empty", file=path.name)
        wide = [bool(split_triple(cell)) for cell in second[1]][: len(header)] + [False] * (
            len(header) - len(second[1])
        )
        names = [
            name + axis for name, three in zip(header, wide) for axis in (AXES if three else ("",))
        ]
        columns = _find_columns(path.name, [] if bare else names, len(names), array)
        rows = _read_rows(
            path.name,
            _prepend(second, lines),
            wide if any(wide) else [],
            len(header),
            columns,
            array,
        )
    if columns.is_long:
        return _split_by_magnetometer(path.name, rows, columns, array)
    t, times = _read_times(path.name, rows, columns, array.time)
    where = {k: i for i, k in enumerate(columns.all)}
    return Table(
        t, {name: rows[:, [where[k] for k in axes]] for name, axes in columns.axes.items()}, times
    )


def _prepend(first: Line, rest: Iterator[Line]) -> Iterator[Line]:
    yield first
    yield from rest


def _find_columns(file: str, header: Sequence[str], many: int, array: ArrayDescription) -> Columns:
    if len(set(header)) < len(header):
        raise InputError("loads.column_twice", file=file)
    place: dict[Column, int] = {name: k for k, name in enumerate(header)} | {
        k + 1: k for k in range(many)
    }
    small = {name.lower(): k for k, name in reversed(list(enumerate(header)))}
    time: int | None = None
    if array.time.rate is None:
        if array.time.column not in place:
            raise InputError(
                "array.header_form",
                file=file,
                column=array.time.column,
                header=_describe_header(header, many),
            )
        time = place[array.time.column]
    if array.sensor is not None:
        return _find_long_columns(file, header, many, array, place, time)
    axes, own = {}, {}
    for name in array.names:
        asked = array.columns.get(name)
        found = (
            [small.get(f"{name}_{axis}".lower()) for axis in "xyz"]
            if asked is None
            else [place.get(column) for column in asked]
        )
        x, y, z = found
        if x is None or y is None or z is None:
            raise InputError(
                "array.magnetometer_columns_missing",
                file=file,
                name=name,
                header=_describe_header(header, many),
            )
        axes[name] = (x, y, z)
        if f"{name}_t" in place:
            own[name] = place[f"{name}_t"]
    return Columns(time, axes, own)


def _find_long_columns(
    file: str,
    header: Sequence[str],
    many: int,
    array: ArrayDescription,
    place: Mapping[Column, int],
    time: int | None,
) -> Columns:
    """Columns of rows that are one magnetometer's each."""
    asked = array.columns[array.names[0]]
    x, y, z = (place.get(column) for column in asked)
    sensor = None if array.sensor in (None, IN_TURN) else place.get(array.sensor)
    if x is None or y is None or z is None or (sensor is None and array.sensor != IN_TURN):
        raise InputError(
            "array.declared_columns_missing",
            file=file,
            columns=", ".join(map(str, asked)),
            sensor=str(array.sensor),
            header=_describe_header(header, many),
        )
    return Columns(time, dict.fromkeys(array.names, (x, y, z)), {}, sensor, True)


def _describe_header(header: Sequence[str], many: int) -> str:
    return (
        ", ".join(header[:6]) + (", ..." if len(header) > 6 else "")
        if header
        else f"{many} columns without names, counted from 1"
    )


def _read_rows(
    file: str,
    lines: Iterator[Line],
    wide: Sequence[bool],
    many: int,
    columns: Columns,
    array: ArrayDescription,
) -> Array:
    """The columns asked for (n, k), 8 bytes a number. `wide`: which cells hold three, empty where
    none does."""
    wanted, values = columns.all, numbers("d")
    reading: list[Callable[[str], float]] = [
        _parse_instant if k == columns.t and array.time.unit == ISO else parse_number
        for k in wanted
    ]
    if columns.sensor is not None:
        reading[wanted.index(columns.sensor)] = _magnetometer_reader(array.names)
    for number, line in lines:
        cells = drop_empty_end(line, many)
        if len(cells) != many:
            raise InputError(
                "array.row_length",
                file=file,
                number=number,
                cells=len(cells),
                many=many,
            )
        try:
            cells = expand_triples(cells, wide) if wide else cells
            values.extend(read(cells[k]) for k, read in zip(wanted, reading))
        except ValueError as problem:
            raise InputError(
                "array.line_damaged", file=file, number=number, problem=str(problem)
            ) from problem
    if not values:
        raise InputError("array.empty", file=file)
    return np.frombuffer(values).reshape(-1, len(wanted))


def _magnetometer_reader(names: Sequence[str]) -> Callable[[str], float]:
    """The number of a magnetometer by its name, also where a table writes 1 as 1.0; NaN of others,
    whose rows are skipped."""
    known = {name: float(k) for k, name in enumerate(names)}

    def number(cell: str) -> float:
        if cell not in known and is_number(cell) and cell.lower() not in MISSING:
            cell = f"{float(cell):g}"
        return known.get(cell, float("nan"))

    return number


def _parse_instant(cell: str) -> float:
    return datetime.fromisoformat(cell).timestamp()


def _read_times(
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


def _split_by_magnetometer(
    file: str, rows: Array, columns: Columns, array: ArrayDescription
) -> Table:
    """Rows (n, k) of one magnetometer each; its times are the table's where all have the same, else
    each has its own."""
    if len(rows) % len(array.names) and columns.sensor is None:
        raise InputError(
            "array.rows_not_in_turn", file=file, rows=len(rows), names=len(array.names)
        )
    sensor = (
        np.arange(len(rows)) % len(array.names)
        if columns.sensor is None
        else rows[:, columns.all.index(columns.sensor)]
    )
    parts = {name: rows[sensor == k] for k, name in enumerate(array.names)}
    if missing := [name for name, part in parts.items() if not len(part)]:
        raise InputError(
            "array.magnetometer_never_named",
            file=file,
            missing=missing[0],
            sensor=str(array.sensor),
        )
    readings = {name: part[:, -3:] for name, part in parts.items()}
    if columns.t is None:
        most = max(len(part) for part in parts.values())
        if fewer := [name for name, part in parts.items() if len(part) < most]:
            raise InputError(
                "array.row_counts_differ",
                file=file,
                fewer=fewer[0],
                parts=len(parts[fewer[0]]),
                most=most,
            )
        assert array.time.rate is not None
        return Table(np.arange(most) / array.time.rate, readings, {})
    for name, part in parts.items():
        _require_increasing(f"{file}, {name}", part[:, 0])
    times = {name: (part[:, 0] - rows[0, 0]) * array.time.seconds for name, part in parts.items()}
    first = times[array.names[0]]
    if all(len(t) == len(first) and (t == first).all() for t in times.values()):
        times = {}
    return Table(first, readings, times)


def _require_increasing(file: str, t: Array) -> None:
    behind = np.flatnonzero(~(np.diff(t) > 0))
    if len(t) < 2 or not np.isfinite(t).all() or len(behind):
        at = f"; {t[behind[0] + 1]:.10g} comes after {t[behind[0]]:.10g}" if len(behind) else ""
        raise InputError("array.time_not_increasing", file=file, at=at)
