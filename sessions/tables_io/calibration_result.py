"""The calibration beside a derivative (`..._calibration.json`) read again: what self-calibration found serves later recordings of the same wearing."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from handscope.estimators.data.calibration import PriorCalibration
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import HANDS, SEGMENTS
from handscope.estimators.messages.system import describe
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

# largest standard deviation of an alignment that counts as estimated; the others are nominal
OBSERVED_SD = np.radians(3.0)


def read(path: Path) -> PriorCalibration:
    """InputError where the file is no calibration that a method found."""
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
    except OSError as problem:
        raise InputError("file.cannot_read", name=str(path), problem=describe(problem)) from None
    except ValueError:
        raise InputError("calibration_file.not_json", path=str(path)) from None
    try:
        return parse(table)
    except (KeyError, TypeError, ValueError, AttributeError):
        raise InputError("calibration_file.not_a_calibration", path=str(path)) from None


def parse(table: dict[str, Any]) -> PriorCalibration:
    """The estimated part of the table that `derivative.calibration_table` makes; KeyError, TypeError or ValueError where it is none."""
    if table["MeasuredHand"] not in HANDS:
        raise ValueError(table["MeasuredHand"])
    lengths = {s: entry for s, entry in table["segment_lengths"].items() if "sd" in entry}
    mountings = {s: m for s, m in table["sensor_to_segment"].items() if _is_observed(m)}
    biases = {s: _numbers(b, 3) for s, b in table["gyr_bias"].items()}
    of_accelerometers = {s: _numbers(b, 3) for s, b in table.get("acc_bias", {}).items()}
    known = {*lengths, *mountings, *biases, *of_accelerometers}
    if unknown := known - set(SEGMENTS):
        raise ValueError(unknown)
    return PriorCalibration(
        table["MeasuredHand"],
        {s: quat.normalize(_numbers(m["q_BS"], 4)) for s, m in mountings.items()},
        biases,
        {s: float(entry["value"]) for s, entry in lengths.items()},
        q_BS_sd={s: _numbers(m["sd"], 3) for s, m in mountings.items()},
        lengths_sd={s: float(entry["sd"]) for s, entry in lengths.items()},
        acc_bias=of_accelerometers,
    )


def _is_observed(mounting: dict[str, Any]) -> bool:
    return "sd" in mounting and bool(_numbers(mounting["sd"], 3).max() < OBSERVED_SD)


def _numbers(values: Any, count: int) -> Array:
    found = np.array(values, dtype=float)
    if found.shape != (count,) or not np.isfinite(found).all():
        raise ValueError(values)
    return found
