"""What a table's columns probably are: a first MAP.json for somebody to correct.

In      a file
Out     a ColumnMap of what could be guessed, and sentences about what could not
"""

import re
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path

import numpy as np

from handscope.estimators.data.samples import ACC, COMPONENTS, GYR, MAG, ORIENTATION
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import HANDS, SEGMENTS
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.sessions.table_import.column_map import (
    FACTORS,
    Channels,
    ColumnMap,
    MappedSensor,
    TableLayout,
)
from handscope.sessions.table_import.makers import Maker, maker_of
from handscope.sessions.table_import.number_columns import NumberColumns, text_lines
from handscope.sessions.table_import.tables import (
    READERS,
    read_table,
)

DELIMITERS = (";", "\t", ",", "|", " ")
LOOKED_AT = 50  # lines
TIME = re.compile(r"^(t|time|timestamp|zeit|sampletime\w*)([_ \[(]|$)", re.IGNORECASE)
KINDS = {
    ORIENTATION: re.compile(r"quat|orient|(?:^|[^a-z])q[_.]?[wxyz0-3](?:[^a-z]|$)", re.IGNORECASE),
    GYR: re.compile(r"gyr|angvel|omega|rate|gyro|w_?[xyz]\b", re.IGNORECASE),
    ACC: re.compile(r"(?<!free)(?<!lin)(?<!linear)(?<!free_)acc|beschl", re.IGNORECASE),
    MAG: re.compile(r"mag", re.IGNORECASE),
}
AXIS = re.compile(r"(?:^|[^a-z])([xyz])(?:[^a-z]|$)|([XYZ])(?:[^a-zA-Z]|$)")
QUATERNION = re.compile(r"(?:^|[^a-z]|q)([wxyz])(?:[^a-z]|$)|([WXYZ])(?:[^a-zA-Z]|$)")
UNITS = (  # words in a header, most telling first
    ("deg/s", GYR),
    ("dps", GYR),
    ("rad/s", GYR),
    ("mg", ACC),
    ("m/s^2", ACC),
    ("m/s2", ACC),
    ("[g]", ACC),
    ("(g)", ACC),
    ("ut", MAG),
)
SPELT = {"dps": "deg/s", "m/s2": "m/s^2", "[g]": "g", "(g)": "g", "ut": "uT"}


def guess_map(path: Path) -> tuple[ColumnMap, list[str]]:
    """The map, and a sentence for everything that has to be filled in by hand."""
    layout = TableLayout() if path.suffix.lower() in READERS else _guess_layout(path)
    table = read_table(path, layout)
    open_questions: list[str] = []
    maker = maker_of(table.names)
    time, rate = _guess_time(table, maker)
    if time is None:
        open_questions.append("no column of times was found: rate is a guess of 100 Hz")
    sensors: dict[str, MappedSensor] = {}
    words = " ".join(table.names).lower() + " " + path.stem.lower()
    sides = [h for h in HANDS if h in words]
    for point, kind, columns in _named_channels(table, path.stem, sides[1:]):
        unit = (maker and maker.units.get(kind)) or _guess_unit(table, kind, columns)
        known = sensors.get(point, MappedSensor({}))
        sensors[point] = MappedSensor({**known.channels, kind: Channels(columns, unit)})
    if not sensors:
        open_questions.append(
            f"no column names a segment ({', '.join(SEGMENTS[:3])}, ...) and a quantity: fill in sensors; columns are {', '.join(table.names[:20]) or f'0 to {table.values.shape[1] - 1}'}"
        )
    if len(sides) != 1:
        what = "both hands are named" if sides else "the hand is not said"
        open_questions.append(f"{what}: left is a guess")
    return ColumnMap(sides[0] if sides else "left", sensors, time, rate, layout), open_questions


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
            first = next((k for k, row in enumerate(numeric) if row and all(row[:2])), 0)
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


def _named_channels(
    table: NumberColumns, stem: str, other_sides: Sequence[str]
) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Segment, quantity and the columns of its components that their names tell; the file's name tells the segment where
    columns do not. Columns that name another side are left out."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    of_file = _segment_in(stem)
    for name in table.names:
        if any(side in name.lower() for side in other_sides):
            continue
        point = _segment_in(name) or of_file
        kind = next((k for k, words in KINDS.items() if words.search(name)), None)
        axis = (QUATERNION if kind == ORIENTATION else AXIS).search(name)
        if point and kind and axis:
            found.setdefault((point, kind), {})[(axis[1] or axis[2]).lower()] = name
    for (point, kind), axes in found.items():
        if set(axes) == set(COMPONENTS[kind]):
            yield point, kind, tuple(axes[c] for c in COMPONENTS[kind])


def _segment_in(text: str) -> str | None:
    plain = re.sub(r"[^a-z0-9]+", "_", text.lower())
    return next((s for s in sorted(SEGMENTS, key=len, reverse=True) if s in plain), None)


def _guess_unit(table: NumberColumns, kind: str, columns: tuple[str, ...]) -> str:
    """As the header says, else by size."""
    if kind == ORIENTATION:
        return "1"
    for words, of in UNITS:
        if of == kind and words in columns[0].lower():
            return SPELT.get(words, words)
    values = np.column_stack([table.column(c) for c in columns])
    values = values[np.isfinite(values).all(axis=1)]
    if not len(values):
        return next(iter(FACTORS[kind]))
    size = float(np.median(np.linalg.norm(values, axis=1)))
    if kind == ACC:
        return _nearest({"m/s^2": GRAVITY, "g": 1.0, "mg": 1000.0}, size)
    if kind == MAG:
        return _nearest({"uT": 45.0, "T": 45e-6, "mG": 450.0}, size)
    return "deg/s" if _largest(values) > np.radians(3000) else "rad/s"


def _largest(values: Array) -> float:
    return float(np.abs(values).max())


def _nearest(sizes: dict[str, float], size: float) -> str:
    assert set(sizes) <= set(FACTORS[ACC]) | set(FACTORS[MAG])
    return min(sizes, key=lambda unit: abs(np.log(max(size, 1e-12) / sizes[unit])))
