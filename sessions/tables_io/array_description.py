"""Description of a magnetometer array in a JSON file: positions, unit, columns;
docs/magnet-array.md."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.messages.system import describe
from handscope.estimators.numerics.typing import Array

PLACE_SD = 5e-4  # m, error of a position, if not declared: between a board's drawing and a ruler
ISO = "iso"
IN_TURN = "in turn"  # value of `sensor`: one row a magnetometer, in the order of the array's file
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, ISO: 1.0}
ENTRIES = (
    "unit",
    "earth",
    "limit",
    "moment",
    "place_sd",
    "calibration_sd",
    "gradient",
    "time",
    "rate",
    "sensor",
    "columns",
    "magnetometers",
)
MAGNETOMETER_ENTRIES = ("place", "q_bl", "columns")
Column = str | int  # name, or number counted from 1

EXAMPLE = '{"unit": "uT", "magnetometers": {"m1": {"place": [x, y, z] in metres}, ...}}'


@dataclass(frozen=True)
class Timing:
    """How the rows of a table follow each other."""

    column: Column = "t"
    unit: str = "s"
    rate: float | None = None  # Hz, of evenly spaced rows: no column is read

    @property
    def seconds(self) -> float:
        return SECONDS[self.unit]


@dataclass(frozen=True)
class ArrayDescription:
    """Positions (m), axes and columns of an array's magnetometers."""

    unit: str | float  # a unit's name, or T of one count
    names: tuple[str, ...]
    places: Array  # (magnetometers, 3) m
    q_bl: Array | None  # (magnetometers, 4)
    earth: float | None  # T
    limit: float | None  # in `unit`
    moment: float | None  # A m^2
    place_sd: float  # m
    calibration_sd: float | None  # T, of readings that are calibrated already
    gradient: float  # T/m by which the field may change across the array
    time: Timing
    columns: Mapping[str, tuple[Column, ...]]  # x, y, z, where declared
    sensor: Column | None = None  # whose a row is, where every row is one magnetometer's


def read_description(path: Path) -> ArrayDescription:
    """Read it; InputError says what is wrong."""
    try:
        parsed = json.loads(path.read_text("utf-8"))
        return _parse(parsed)
    except OSError as problem:
        raise InputError("file.cannot_read", name=str(path), problem=describe(problem)) from problem
    except (ValueError, KeyError, TypeError, AttributeError) as problem:
        raise InputError(
            "array.not_a_description", name=path.name, example=EXAMPLE, problem=str(problem)
        ) from problem


def _parse(parsed: Mapping[str, Any]) -> ArrayDescription:
    magnetometers = parsed["magnetometers"]
    if not magnetometers:
        raise InputError("array.no_magnetometers")
    _refuse_others(parsed, ENTRIES, "the array's file")
    for name, one in magnetometers.items():
        _refuse_others(one, MAGNETOMETER_ENTRIES, f"magnetometer {name!r}")
    places = np.array(
        [
            [_parse_finite(v, f"place of {name}") for v in one["place"]]
            for name, one in magnetometers.items()
        ]
    )
    turns = [one.get("q_bl") for one in magnetometers.values()]
    if any(turn is None for turn in turns) and any(turn is not None for turn in turns):
        raise InputError("array.orientations_incomplete")
    numbers = ("earth", "limit", "moment", "place_sd", "calibration_sd", "gradient", "rate")
    earth, limit, moment, place_sd, calibration_sd, gradient, rate = (
        None if parsed.get(key) is None else _parse_finite(parsed[key], key) for key in numbers
    )
    unit, sensor = parsed["unit"], parsed.get("sensor")
    if "columns" in parsed and sensor is None:
        raise InputError("array.sensor_column_missing")
    if sensor is not None and (
        separate := [name for name, one in magnetometers.items() if "columns" in one]
    ):
        raise InputError("array.columns_twice", separate=separate[0])
    shared = (
        {}
        if sensor is None
        else dict.fromkeys(
            magnetometers, _parse_columns("the array", parsed.get("columns", ["x", "y", "z"]))
        )
    )
    return ArrayDescription(
        unit if isinstance(unit, str) else _parse_finite(unit, "unit"),
        tuple(magnetometers),
        places,
        None if not turns or turns[0] is None else np.array(turns, float),
        earth,
        limit,
        moment,
        PLACE_SD if place_sd is None else place_sd,
        calibration_sd,
        gradient or 0.0,
        _parse_timing(parsed.get("time"), rate),
        shared
        or {
            name: _parse_columns(name, one["columns"])
            for name, one in magnetometers.items()
            if "columns" in one
        },
        sensor,
    )


def _refuse_others(parsed: Mapping[str, Any], known: Sequence[str], what: str) -> None:
    strange = [key for key in parsed if key not in known]
    if strange:
        raise InputError(
            "array.unknown_entry", strange=strange[0], what=what, known=", ".join(known)
        )


def _parse_timing(parsed: Any, rate: float | None) -> Timing:
    if rate is not None and not rate > 0:
        raise InputError("array.rate_form", rate=rate)
    if parsed is None:
        return Timing(rate=rate)
    _refuse_others(parsed, ("column", "unit"), "the array's `time`")
    unit = parsed.get("unit", "s")
    if unit not in SECONDS:
        raise InputError("array.unknown_time_unit", unit=unit, seconds=", ".join(SECONDS))
    return Timing(parsed.get("column", "t"), unit, rate)


def _parse_columns(name: str, columns: Any) -> tuple[Column, ...]:
    if not isinstance(columns, list) or len(columns) != 3:
        raise InputError("array.columns_form", name=name, columns=columns)
    return tuple(columns)


def _parse_finite(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
        raise InputError("array.not_finite", what=what, value=value)
    return float(value)
