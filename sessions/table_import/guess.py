"""What a table's columns probably are: a first MAP.json for somebody to correct.

In      a file, or the columns of its table
Out     a ColumnMap of what could be guessed, and messages about what could not
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import HANDS, SEGMENTS, Hand
from handscope.estimators.messages import Message, render_english
from handscope.sessions.table_import.column_map import (
    Channels,
    ColumnMap,
    MappedSensor,
    TableLayout,
)
from handscope.sessions.table_import.makers import Maker, maker_of
from handscope.sessions.table_import.number_columns import NumberColumns, text_lines
from handscope.sessions.table_import.tables import READERS, read_table
from handscope.sessions.table_import.triads import Triad, find_triads

DELIMITERS = (";", "\t", ",", "|", " ")
LOOKED_AT = 50  # lines
TIME = re.compile(r"^(t|time|timestamp|zeit|sampletime\w*)([_ \[(]|$)", re.IGNORECASE)
MOST_NAMED = 20  # columns in a sentence


@dataclass(frozen=True)
class Guess:
    """A first map of a table, and what it leaves open."""

    columns: ColumnMap
    triads: tuple[Triad, ...]  # of the map, and those whose segment nothing says
    questions: tuple[Message, ...]


def guess_map(path: Path) -> tuple[ColumnMap, list[str]]:
    """The map, and a sentence for everything that has to be filled in by hand."""
    found = guess(path)
    return found.columns, [render_english(q) for q in found.questions]


def guess(path: Path, layout: TableLayout | None = None) -> Guess:
    """What the columns of a file probably are; its text as `layout` says, or as it probably is."""
    layout = layout or guess_layout(path)
    return guess_columns(read_table(path, layout), path.stem, layout)


def guess_layout(path: Path) -> TableLayout:
    """How the text of a file is laid out; the default where it is no text."""
    return TableLayout() if path.suffix.lower() in READERS else _guess_layout(path)


def guess_columns(table: NumberColumns, stem: str, layout: TableLayout) -> Guess:
    """What the columns of a table probably are; `stem` is the file's name without its ending."""
    maker = maker_of(table.names)
    time, rate = _guess_time(table, maker)
    named = {h: re.compile(maker.sides.get(h, h) if maker else h, re.IGNORECASE) for h in HANDS}
    sides = [h for h in HANDS if any(named[h].search(n) for n in (*table.names, stem))]
    triads = tuple(
        replace(t, unit=maker.units.get(t.quantity, t.unit)) if maker else t
        for t in find_triads(table, stem, [named[h] for h in sides[1:]], time[0] if time else None)
    )
    sensors: dict[str, MappedSensor] = {}
    for triad in triads:
        if triad.point:
            known = sensors.get(triad.point, MappedSensor({}))
            channels = {**known.channels, triad.quantity: Channels(triad.columns, triad.unit)}
            sensors[triad.point] = MappedSensor(channels)
    columns = ColumnMap(sides[0] if sides else "left", sensors, time, rate, layout)
    return Guess(columns, triads, tuple(_questions(table, columns, triads, sides)))


def _questions(
    table: NumberColumns, columns: ColumnMap, triads: Sequence[Triad], sides: Sequence[Hand]
) -> Iterator[Message]:
    if columns.time is None:
        yield Message("import.guess_no_time", {}, "warning")
    if not columns.sensors:
        names = ", ".join(table.names[:MOST_NAMED]) or f"0 to {table.values.shape[1] - 1}"
        known = ", ".join(SEGMENTS[:3])
        yield Message("import.guess_no_sensors", {"segments": known, "columns": names}, "warning")
    for triad in (t for t in triads if t.point is None):
        values = {
            "columns": ", ".join(map(str, triad.columns)),
            "quantity": triad.quantity,
            "unit": triad.unit,
        }
        yield Message("import.guess_which_segment", values, "warning")
    if len(sides) != 1:
        if sides:
            yield Message("import.guess_both_hands", {}, "warning")
        else:
            yield Message("import.guess_no_hand", {}, "warning")


def _guess_layout(path: Path) -> TableLayout:
    """The delimiter and decimal mark by which most cells of the same number a line are numbers."""
    lines = text_lines(path)
    if not any(line.strip() for line in lines[: 2 * LOOKED_AT]):
        raise InputError("import.empty", name=path.name)
    best, best_score = TableLayout(), -1.0
    for delimiter, decimal in product(DELIMITERS, (".", ",")):
        if delimiter == decimal:
            continue
        rows = [line.split(delimiter) for line in lines[: LOOKED_AT * 2] if line.strip()]
        widths = [len(row) for row in rows]
        width = max(set(widths), key=widths.count, default=0)
        numeric = [
            [_is_number(cell, decimal) for cell in row] if len(row) == width else [] for row in rows
        ]
        score = float(width > 1) * sum(map(sum, numeric))
        if score > best_score:
            most = max(map(sum, numeric))
            first = next((k for k, row in enumerate(numeric) if 2 * sum(row) > most), 0)
            header = first > 0 and len(rows[first - 1]) == width
            if header and first > 1 and len(rows[first - 2]) == width:
                first -= 1  # names, then units
            skip = lines.index(delimiter.join(rows[first - header]))
            best, best_score = TableLayout(delimiter, decimal, header, skip), score
    return best


def _is_number(cell: str, decimal: str) -> bool:
    text = cell.strip().strip('"')
    if decimal == "," and "." in text:
        return False
    try:
        float(text.replace(",", ".") if decimal == "," else text)
    except ValueError:
        return False
    return True


def _guess_time(
    table: NumberColumns, maker: Maker | None
) -> tuple[tuple[str | int, str] | None, float | None]:
    """The column that is named so, else the first that increases evenly; its unit by how many rows a second are usual."""
    if maker is not None:
        column = next((n for n in table.names if maker.is_time(n)), None)
        if column is not None:
            return (column, maker.time_unit), None
    named = [k for k, name in enumerate(table.names) if TIME.match(name)]
    for k in [*named, *range(table.values.shape[1])]:
        steps = np.diff(table.values[:, k])
        if len(steps) < 2 or not np.isfinite(steps).all() or (steps <= 0).any():
            continue
        step = float(np.median(steps))
        if k not in named and np.ptp(steps) > 2 * step:
            continue
        for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
            if 20 <= 1 / (step * size) <= 2500 and not (unit == "s" and step == 1):
                return (table.names[k] if table.names else k, unit), None
    return None, 100.0
