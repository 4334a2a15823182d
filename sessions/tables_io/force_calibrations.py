"""Calibrations of force sensors whose glove keeps none, kept by strip in the data folder and written into every recording that begins.

A file a strip, `force_calibrations/STRIP_ID.json`, with the `ForceSetup` of `handscope calibrate-force`. A recording holds what was kept when it began
(`force_setups` of its metadata), so that it opens with the forces that were shown live.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from handscope.estimators.errors import InputError
from handscope.estimators.force.setup import ForceSetup, parse_setups, setup_to_table
from handscope.estimators.messages.sentence import phrase

FOLDER = "force_calibrations"  # in the data folder
# in a file, by point; in a recording, by strip and point
SETUP, SETUPS = "ForceSetup", "force_setups"
# by strip_id in hexadecimal, then by tracked point
StoredSetups = Mapping[str, Mapping[str, ForceSetup]]


def path_of(data: Path, strip_id: int) -> Path:
    """Where the calibrations of a strip are kept."""
    return data / FOLDER / f"{strip_id:x}.json"


def read_stored(data: Path) -> dict[str, Any]:
    """The metadata with which a recording begins, empty where nothing is kept; InputError names a file that cannot be read."""
    found = {path.stem: _read(path) for path in sorted((data / FOLDER).glob("[!.]*.json"))}
    return {SETUPS: found} if found else {}


def of_recording(metadata: Mapping[str, Any]) -> StoredSetups:
    """What a recording's metadata holds; InputError where that cannot be read."""
    tables = metadata.get(SETUPS) or {}
    if not isinstance(tables, Mapping) or not all(
        isinstance(table, Mapping) for table in tables.values()
    ):
        raise InputError("table.force_calibrations_not_tables")
    return {strip: parse_setups(table) for strip, table in tables.items()}


def _read(path: Path) -> dict[str, Any]:
    """By point, what turns readings to forces; how sure each number is stays in the file."""
    try:
        return {
            point: setup_to_table(setup)
            for point, setup in parse_setups(json.loads(path.read_text("utf-8"))[SETUP]).items()
        }
    except (InputError, OSError, ValueError, KeyError, TypeError, AttributeError) as problem:
        reason = problem if isinstance(problem, InputError) else phrase("force.no_force_setup")
        raise InputError(
            "table.force_calibration_unreadable", file=path.name, reason=str(reason)
        ) from None
