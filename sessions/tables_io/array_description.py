"""What a person tells of a magnetometer array in a JSON file: places, unit, where its columns stand; docs/magnet-array.md."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.numerics.typing import Array

PLACE_SD = (
    5e-4  # m of a magnetometer's place, where nobody tells: between a board's drawing and a ruler
)
ISO = "iso"
IN_TURN = "in turn"  # told as `sensor`: rows are those of one magnetometer after the other, in the order of the array's file
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
OF_EACH = ("place", "q_bl", "columns")
Column = str | int  # its name, or its number counted from 1


@dataclass(frozen=True)
class Timing:
    """How the rows of a table follow each other."""

    column: Column = "t"
    unit: str = "s"
    rate: float | None = None  # Hz, of rows that are evenly spaced: no column is read

    @property
    def seconds(self) -> float:
        return SECONDS[self.unit]


@dataclass(frozen=True)
class Described:
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
    columns: Mapping[str, tuple[Column, ...]]  # x, y, z of those that tell them
    sensor: Column | None = None  # says whose a row is, where every row is one magnetometer's


def described(path: Path) -> Described:
    """Read it; InputError says what is wrong in it."""
    try:
        told = json.loads(path.read_text("utf-8"))
        return _described(told)
    except OSError as problem:
        raise InputError(f"{path} cannot be read: {problem.strerror}") from problem
    except (ValueError, KeyError, TypeError, AttributeError) as problem:
        raise InputError(
            f'{path.name} does not describe an array: give {{"unit": "uT", "magnetometers": {{"m1": {{"place": [x, y, z] in metres}}, ...}}}} ({problem})'
        ) from problem


def _described(told: Mapping[str, Any]) -> Described:
    each = told["magnetometers"]
    if not each:
        raise InputError("The array's file names no magnetometer.")
    _refuse_others(told, ENTRIES, "the array's file")
    for name, one in each.items():
        _refuse_others(one, OF_EACH, f"magnetometer {name!r}")
    places = np.array(
        [[_finite(v, f"place of {name}") for v in one["place"]] for name, one in each.items()]
    )
    turns = [one.get("q_bl") for one in each.values()]
    if any(turn is None for turn in turns) and any(turn is not None for turn in turns):
        raise InputError("Tell q_bl of every magnetometer of the array or of none.")
    numbers = ("earth", "limit", "moment", "place_sd", "calibration_sd", "gradient", "rate")
    earth, limit, moment, place_sd, calibration_sd, gradient, rate = (
        None if told.get(key) is None else _finite(told[key], key) for key in numbers
    )
    unit, sensor = told["unit"], told.get("sensor")
    if "columns" in told and sensor is None:
        raise InputError(
            "`columns` of the whole array are those of rows of one magnetometer each: tell `sensor`, the column that says whose, too."
        )
    if sensor is not None and (own := [name for name, one in each.items() if "columns" in one]):
        raise InputError(
            f"Magnetometer {own[0]!r} has `columns` of its own, and every row is one magnetometer's, as `sensor` says: tell `columns` once, beside `sensor`."
        )
    alike = (
        {}
        if sensor is None
        else dict.fromkeys(each, _columns("the array", told.get("columns", ["x", "y", "z"])))
    )
    return Described(
        unit if isinstance(unit, str) else _finite(unit, "unit"),
        tuple(each),
        places,
        None if not turns or turns[0] is None else np.array(turns, float),
        earth,
        limit,
        moment,
        PLACE_SD if place_sd is None else place_sd,
        calibration_sd,
        gradient or 0.0,
        _timing(told.get("time"), rate),
        alike
        or {name: _columns(name, one["columns"]) for name, one in each.items() if "columns" in one},
        sensor,
    )


def _refuse_others(told: Mapping[str, Any], known: Sequence[str], what: str) -> None:
    strange = [key for key in told if key not in known]
    if strange:
        raise InputError(
            f"There is no entry {strange[0]!r} in {what}; there are {', '.join(known)}."
        )


def _timing(told: Any, rate: float | None) -> Timing:
    if rate is not None and not rate > 0:
        raise InputError(f"The array's rate is {rate:g} Hz; tell how many rows a second there are.")
    if told is None:
        return Timing(rate=rate)
    _refuse_others(told, ("column", "unit"), "the array's `time`")
    unit = told.get("unit", "s")
    if unit not in SECONDS:
        raise InputError(
            f"There is no unit {unit!r} of time; units are {', '.join(SECONDS)} (date and time of day)."
        )
    return Timing(told.get("column", "t"), unit, rate)


def _columns(name: str, told: Any) -> tuple[Column, ...]:
    if not isinstance(told, list) or len(told) != 3:
        raise InputError(
            f"The columns of {name} are {told!r}; they are three, of x, y and z, by name or counted from 1."
        )
    return tuple(told)


def _finite(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
        raise InputError(f"The array's {what} has {value!r}, which is no finite number.")
    return float(value)
