"""Tables of a magnetometer array, as a bench writes them: CSV or TSV, one header, one row an instant.

In      columns t (s) and <name>_x, <name>_y, <name>_z of every magnetometer, any names; <name>_t where one has a time of its own; empty, n/a or nan is missing
Out     Table: times and readings by name; docs/magnet-array.md
"""

import csv
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from estimators.errors import InputError
from estimators.quaternions import Array

SUFFIXES = (".csv", ".tsv", ".txt")
MISSING = {"", "n/a", "na", "nan", "null"}
LARGEST = 2**30  # bytes of a table
PLACE_SD = 5e-4  # m of a magnetometer's place, where nobody tells: between a board's drawing and a ruler


@dataclass(frozen=True)
class Table:
    t: Array  # (n,) s
    readings: Mapping[str, Array]  # (n, 3) each, NaN where missing
    times: Mapping[str, Array]  # (n,) s, of those with a time of their own


@dataclass(frozen=True)
class Described:
    """What a person tells of an array."""

    unit: str
    names: tuple[str, ...]
    places: Array  # (magnetometers, 3) m
    q_bl: Array | None  # (magnetometers, 4)
    earth: float | None  # T
    limit: float | None  # in `unit`
    moment: float | None  # A m^2
    place_sd: float  # m


def table(path: Path) -> Table:
    """Read a table; InputError names the file, the line and what to do."""
    if not path.is_file():
        raise InputError(f"{path} is not a file")
    if path.stat().st_size > LARGEST:
        raise InputError(f"{path.name} is larger than 1 GB: cut it into pieces")
    header, rows = _rows(path)
    column = {name: k for k, name in enumerate(header)}
    names = [h[:-2] for h in header if h.endswith("_x") and {f"{h[:-2]}_y", f"{h[:-2]}_z"} <= set(column)]
    if "t" not in column or not names:
        raise InputError(
            f"{path.name}: the first line must name the columns t (s) and <name>_x, <name>_y, <name>_z of every magnetometer; it has {', '.join(header[:6])}"
        )
    values = np.array(rows, float).reshape(len(rows), len(header))
    t = values[:, column["t"]]
    if len(t) < 2 or not np.isfinite(t).all() or not (np.diff(t) > 0).all():
        raise InputError(f"{path.name}: the times t must all be there and increase, in seconds")
    readings = {name: values[:, [column[f"{name}_{axis}"] for axis in "xyz"]] for name in names}
    return Table(t - t[0], readings, {name: values[:, column[f"{name}_t"]] - t[0] for name in names if f"{name}_t" in column})


def described(path: Path) -> Described:
    """Read what a JSON file tells of the array."""
    try:
        told = json.loads(path.read_text("utf-8"))
        each = told["magnetometers"]
        names, unit = tuple(each), str(told["unit"])
        places = np.array([each[name]["place"] for name in names], float)
        turns = [each[name].get("q_bl") for name in names]
        earth, limit, moment, place_sd = (_number(told, key) for key in ("earth", "limit", "moment", "place_sd"))
    except OSError as problem:
        raise InputError(f"{path} cannot be read: {problem.strerror}") from problem
    except (ValueError, KeyError, TypeError, AttributeError) as problem:
        raise InputError(
            f'{path.name} does not describe an array: give {{"unit": "uT", "magnetometers": {{"m1": {{"place": [x, y, z] in metres}}, ...}}}} ({problem})'
        ) from problem
    if any(turn is None for turn in turns) and any(turn is not None for turn in turns):
        raise InputError(f"{path.name}: tell q_bl of every magnetometer or of none")
    q_bl = None if not turns or turns[0] is None else np.array(turns, float)
    return Described(unit, names, places, q_bl, earth, limit, moment, PLACE_SD if place_sd is None else place_sd)


def _number(told: Mapping[str, Any], key: str) -> float | None:
    return None if told.get(key) is None else float(told[key])


def _rows(path: Path) -> tuple[list[str], list[list[float]]]:
    """Names and numbers; tab, semicolon or comma between them."""
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        first = file.readline()
        mark = max("\t;,", key=first.count)
        header = [name.strip() for name in first.strip().split(mark)]
        if len(set(header)) < len(header):
            raise InputError(f"{path.name}: two columns have the same name")
        rows: list[list[float]] = []
        for number, row in enumerate(csv.reader(file, delimiter=mark), 2):
            if not row:
                continue
            try:
                rows.append([float("nan") if word.strip().lower() in MISSING else float(word) for word in row])
            except ValueError as problem:
                raise InputError(f"{path.name}, line {number}: {problem}") from problem
            if len(row) != len(header):
                raise InputError(f"{path.name}, line {number}: {len(row)} columns where the first line names {len(header)}")
    if not rows:
        raise InputError(f"{path.name} holds no readings")
    return header, rows
