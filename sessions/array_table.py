"""Tables of a magnetometer array, as a bench writes them: one row an instant, columns by name or by number.

In      text, with a header or without; comma, semicolon, tab or spaces between columns, decimal comma where it separates none; lines that begin with # or %
        are passed over, and so are columns that nobody asks for, text in them too. Empty, n/a or nan is missing
Out     Table: times and readings by name; docs/magnet-array.md
"""

from array import array as numbers
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TextIO

import numpy as np

from estimators.errors import InputError
from estimators.quaternions import Array
from sessions.array_description import ISO, Column, Described, Timing

SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".log")
MISSING = {"", "n/a", "na", "nan", "null", "none"}
COMMENT = ("#", "%")
LARGEST = 2**30  # bytes of a table
Line = tuple[int, list[str]]  # its number and its cells


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

    @property
    def all(self) -> list[int]:
        return [*([] if self.t is None else [self.t]), *self.own.values(), *(k for three in self.axes.values() for k in three)]


def table(path: Path, told: Described) -> Table:
    """Read the columns of the array's magnetometers; InputError names the file, the line and what to do."""
    if not path.is_file():
        raise InputError(f"{path} is not a file")
    if path.stat().st_size > LARGEST:
        raise InputError(f"{path.name} is larger than 1 GB: cut it into pieces")
    with path.open(encoding="utf-8-sig", errors="replace", newline=None) as file:
        lines = _lines(file)
        first = next(lines, None)
        if first is None:
            raise InputError(f"{path.name} holds no readings")
        header = _without_end(first[1])
        bare = all(_is_number(cell) for cell in header)
        columns = _columns(path.name, [] if bare else header, len(header), told)
        rows = _rows(path.name, _again(first, lines) if bare else lines, len(header), columns, told.time)
    t, times = _times(path.name, rows, columns, told.time)
    where = {k: i for i, k in enumerate(columns.all)}
    return Table(t, {name: rows[:, [where[k] for k in axes]] for name, axes in columns.axes.items()}, times)


def _again(first: Line, rest: Iterator[Line]) -> Iterator[Line]:
    yield first
    yield from rest


def _lines(file: TextIO) -> Iterator[Line]:
    """Cells of every line that is neither empty nor a comment."""
    mark: str | None = None
    for number, line in enumerate(file, 1):
        text = line.rstrip("\r\n")
        if not text.strip() or text.lstrip().startswith(COMMENT):
            continue
        if mark is None:
            mark = next((m for m in "\t;," if m in text), " ")
        cells = [cell.strip().strip('"') for cell in (text.split() if mark == " " else text.split(mark))]
        yield number, cells if mark == "," else [cell.replace(",", ".") for cell in cells]


def _without_end(cells: list[str], many: int = 1) -> list[str]:
    """Without empty cells behind the separator with which a line ends."""
    while len(cells) > many and not cells[-1]:
        cells = cells[:-1]
    return cells


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return cell.lower() in MISSING
    return True


def _columns(file: str, header: Sequence[str], many: int, told: Described) -> Columns:
    if len(set(header)) < len(header):
        raise InputError(f"{file}: two columns have the same name")
    place: dict[Column, int] = {name: k for k, name in enumerate(header)} | {k + 1: k for k in range(many)}
    small = {name.lower(): k for k, name in reversed(list(enumerate(header)))}
    time: int | None = None
    if told.time.rate is None:
        if told.time.column not in place:
            raise InputError(
                f"{file}: the first line must name the columns t (s) and <name>_x, <name>_y, <name>_z of every magnetometer, or the array's file tell `time` and "
                f"`columns`; there is no column {told.time.column!r} but {_some(header, many)}"
            )
        time = place[told.time.column]
    axes, own = {}, {}
    for name in told.names:
        asked = told.columns.get(name)
        found = [small.get(f"{name}_{axis}".lower()) for axis in "xyz"] if asked is None else [place.get(column) for column in asked]
        x, y, z = found
        if x is None or y is None or z is None:
            raise InputError(
                f"{file} has no magnetometer {name!r}: columns {name}_x, {name}_y, {name}_z are looked for, or those that the array's file tells as its `columns`; it has {_some(header, many)}"
            )
        axes[name] = (x, y, z)
        if f"{name}_t" in place:
            own[name] = place[f"{name}_t"]
    return Columns(time, axes, own)


def _some(header: Sequence[str], many: int) -> str:
    return ", ".join(header[:6]) + (", ..." if len(header) > 6 else "") if header else f"{many} columns without names, counted from 1"


def _rows(file: str, lines: Iterator[Line], many: int, columns: Columns, time: Timing) -> Array:
    """The columns asked for (n, k); one number takes 8 bytes, not a Python object."""
    wanted, values = columns.all, numbers("d")
    stamp = columns.t if time.unit == ISO else None
    for number, line in lines:
        cells = _without_end(line, many)
        if len(cells) != many:
            raise InputError(f"{file}, line {number}: {len(cells)} columns where the first line has {many}")
        try:
            values.extend(_instant(cells[k]) if k == stamp else _number(cells[k]) for k in wanted)
        except ValueError as problem:
            raise InputError(f"{file}, line {number}: {problem}") from problem
    if not values:
        raise InputError(f"{file} holds no readings")
    return np.frombuffer(values).reshape(-1, len(wanted))


def _number(cell: str) -> float:
    return float("nan") if cell.lower() in MISSING else float(cell)


def _instant(cell: str) -> float:
    return datetime.fromisoformat(cell).timestamp()


def _times(file: str, rows: Array, columns: Columns, time: Timing) -> tuple[Array, Mapping[str, Array]]:
    """Seconds from the first row, and of the magnetometers that have times of their own."""
    if columns.t is None:
        assert time.rate is not None
        return np.arange(len(rows)) / time.rate, {}
    t = rows[:, 0]
    behind = np.flatnonzero(~(np.diff(t) > 0))
    if len(t) < 2 or not np.isfinite(t).all() or len(behind):
        at = f"; {t[behind[0] + 1]:.10g} comes after {t[behind[0]]:.10g}" if len(behind) else ""
        raise InputError(
            f"{file}: the times must all be there and increase{at}. Where they cannot be mended, tell `rate` in the array's file instead"
        )
    return (t - t[0]) * time.seconds, {name: (rows[:, 1 + k] - t[0]) * time.seconds for k, name in enumerate(columns.own)}
