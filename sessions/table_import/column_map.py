"""Which columns of a table are what: MAP.json, read and checked.

In      the contract's object: hand, table, time or rate, sensors, geometry
Out     a ColumnMap; InputError names the key that is wrong
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from handscope.estimators.data.samples import ACC, COMPONENTS, GYR, MAG, ORIENTATION, TRACKED_POINTS
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import HANDS, Hand
from handscope.estimators.hand.geometry import measures_from
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.messages.system import describe
from handscope.estimators.numerics.constants import GRAVITY

Column = str | int
FACTORS: Mapping[str, Mapping[str, float]] = {  # to SI, by quantity and unit
    GYR: {"rad/s": 1.0, "deg/s": np.pi / 180},
    ACC: {"m/s^2": 1.0, "g": GRAVITY, "mg": 1e-3 * GRAVITY},
    MAG: {"T": 1.0, "uT": 1e-6, "mG": 1e-7},
    ORIENTATION: {"1": 1.0},
}
SHOWN = 5  # names of a wrong one's like
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


@dataclass(frozen=True)
class TableLayout:
    """How the text is laid out."""

    delimiter: str = ","
    decimal: str = "."
    header: bool = True
    skip: int = 0  # lines before the header, or before the first row


@dataclass(frozen=True)
class Channels:
    """The columns of a quantity, x y z or w x y z, and their unit."""

    columns: tuple[Column, ...]
    unit: str


@dataclass(frozen=True)
class MappedSensor:
    """What one sensor gives, and how it is said to sit."""

    channels: Mapping[str, Channels]  # by quantity
    mounting: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)  # q_BS


@dataclass(frozen=True)
class ColumnMap:
    """The map; columns by name, or by number from 0 where there is no header."""

    hand: Hand
    sensors: Mapping[str, MappedSensor]  # by tracked point
    time: tuple[Column, str] | None = None  # column and unit
    rate: float | None = None  # Hz, where there is no column of times
    table: TableLayout = field(default_factory=TableLayout)
    geometry: Mapping[str, Any] = field(default_factory=dict)


def read_map(path: Path, of_stream: bool = False) -> ColumnMap:
    """The map in a file; InputError where it is none. A live stream has times of its own."""
    try:
        value = json.loads(path.read_text("utf-8"))
    except OSError as problem:
        raise InputError("file.cannot_read", name=str(path), problem=describe(problem)) from None
    except ValueError as problem:
        raise InputError("import.not_json", name=path.name, problem=str(problem)) from None
    return parse_map(value, path.name, of_stream)


def parse_map(value: Any, name: str, of_stream: bool = False) -> ColumnMap:
    """The map as plain data; InputError names file and key."""
    _only(value, {"hand", "table", "time", "rate", "sensors", "geometry"}, name)
    hand = value.get("hand")
    if hand not in HANDS:
        raise InputError("import.unknown_hand", name=name, hand=hand)
    timed = not of_stream or {"time", "rate"} & set(value)
    time, rate = _time(value, name) if timed else (None, None)
    sensors = value.get("sensors")
    if not isinstance(sensors, dict) or not sensors:
        raise InputError("import.no_sensors", name=name)
    geometry = dict(value.get("geometry") or {})
    measures_from(geometry)
    return ColumnMap(
        hand,
        {point: _sensor(point, sensor, name) for point, sensor in sensors.items()},
        time,
        rate,
        parse_layout(value.get("table") or {}, name),
        geometry,
    )


def as_json(columns: ColumnMap) -> str:
    """The map as the contract writes it."""
    value: dict[str, Any] = {"hand": columns.hand, "table": asdict(columns.table)}
    if columns.time:
        value["time"] = {"column": columns.time[0], "unit": columns.time[1]}
    else:
        value["rate"] = columns.rate
    value["sensors"] = {
        point: {q: {"columns": list(t.columns), "unit": t.unit} for q, t in s.channels.items()}
        | {"mounting": list(s.mounting)}
        for point, s in columns.sensors.items()
    }
    value["geometry"] = dict(columns.geometry)
    return json.dumps(value, indent=2, ensure_ascii=False) + "\n"


def _only(value: Any, known: set[str], where: str) -> None:
    if not isinstance(value, dict):
        raise InputError("import.not_an_object", where=where, known=", ".join(sorted(known)))
    if unknown := sorted(set(value) - known):
        raise InputError(
            "import.unknown_keys",
            where=where,
            unknown=", ".join(unknown),
            known=", ".join(sorted(known)),
        )


def parse_layout(value: Any, name: str) -> TableLayout:
    """How the text is laid out, as plain data; InputError names what is wrong."""
    where = f"{name}: table"
    _only(value, {"delimiter", "decimal", "header", "skip"}, where)
    layout = TableLayout(**value)
    if len(str(layout.delimiter)) != 1 or layout.decimal not in (".", ","):
        raise InputError("import.delimiter_form", where=where)
    if layout.delimiter == layout.decimal:
        raise InputError("import.delimiter_is_decimal_mark", where=where, decimal=layout.decimal)
    if not isinstance(layout.skip, int) or layout.skip < 0 or not isinstance(layout.header, bool):
        raise InputError("import.header_form", where=where)
    return layout


def _time(value: Mapping[str, Any], name: str) -> tuple[tuple[Column, str] | None, float | None]:
    time, rate = value.get("time"), value.get("rate")
    if (time is None) == (rate is None):
        raise InputError("import.time_or_rate", name=name)
    if time is None:
        if not isinstance(rate, int | float) or not 1 <= rate <= 10000:
            raise InputError("import.rate_form", name=name, rate=repr(rate))
        return None, float(rate)
    _only(time, {"column", "unit"}, f"{name}: time")
    if time.get("unit") not in SECONDS:
        raise InputError(
            "import.time_unit", name=name, value=time.get("unit"), seconds=", ".join(SECONDS)
        )
    return (_column(time.get("column"), f"{name}: time"), str(time["unit"])), None


def nearest(wanted: str, names: Sequence[str]) -> str:
    """The names that are most like a wrong one, and of how many; all where they are few."""
    if len(names) <= SHOWN:
        return ", ".join(names)
    like = ", ".join(get_close_matches(wanted, names, SHOWN, 0.0))
    return phrase("import.nearest_names", names=like, count=len(names))


def _column(value: Any, where: str) -> Column:
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise InputError("import.column_form", where=where, value=value)
    return value


def _sensor(point: str, value: Any, name: str) -> MappedSensor:
    where = f"{name}: {point}"
    if point not in TRACKED_POINTS:
        raise InputError(
            "import.unknown_point", where=where, tracked_points=nearest(point, TRACKED_POINTS)
        )
    _only(value, {*FACTORS, "mounting"}, where)
    channels = {
        q: _channels(value[q], q, f"{where}, {q}") for q in FACTORS if value.get(q) is not None
    }
    if not channels:
        raise InputError("import.nothing_mapped", where=where)
    mounting = value.get("mounting") or [1, 0, 0, 0]
    try:
        q = np.asarray(mounting, dtype=float)
    except (TypeError, ValueError):
        q = np.zeros(0)
    if q.shape != (4,) or not 0.9 < np.linalg.norm(q) < 1.1:
        raise InputError("import.mounting_not_unit", where=where, mounting=repr(mounting))
    return MappedSensor(channels, (float(q[0]), float(q[1]), float(q[2]), float(q[3])))


def _channels(value: Any, quantity: str, where: str) -> Channels:
    _only(value, {"columns", "unit"}, where)
    columns = value.get("columns")
    names = COMPONENTS[quantity]
    if not isinstance(columns, list) or len(columns) != len(names):
        raise InputError(
            "import.columns_form",
            where=where,
            names=len(names),
            names2=", ".join(names),
            columns=columns,
        )
    if value.get("unit") not in FACTORS[quantity]:
        raise InputError(
            "import.unknown_unit",
            where=where,
            value=value.get("unit"),
            factors=", ".join(FACTORS[quantity]),
        )
    return Channels(tuple(_column(c, where) for c in columns), value["unit"])
