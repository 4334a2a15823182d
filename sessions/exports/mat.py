"""Arrays by name for MATLAB, Octave and scipy: one column a variable, `units` and `about` as structures."""

import io
import json
from typing import Any

import numpy as np
from scipy.io import savemat

from handscope.sessions.exports.measured import Exported, Measured
from handscope.sessions.tables_io.trajectory_table import table_of


def write(measured: Measured) -> Exported:
    """SI values (n, 1) under the names of the derivative's columns; `figures` are those of the tasks."""
    columns, table = table_of(measured.movement)
    arrays: dict[str, Any] = {
        name: np.asarray(part, float)[:, None] for (name, *_), part in zip(columns, table.parts)
    }
    arrays["units"] = {name: unit for name, _, _, _, unit in columns}
    about = measured.origin.table()
    plain = {key: value for key, value in about.items() if isinstance(value, (str, bool))}
    arrays["about"] = plain | {
        "hand": measured.recording.hand,
        "options": json.dumps(about["options"], default=str),
        "warnings": "\n".join(about["warnings"]),
    }
    figures = [(t, f) for t in measured.tasks for f in t.figures]
    arrays["figures"] = {
        "task": np.array([t.task for t, _ in figures], object),
        "name": np.array([f.name for _, f in figures], object),
        "value": np.array([f.value for _, f in figures], float),
        "sd": np.array([np.nan if f.sd is None else f.sd for _, f in figures], float),
        "unit": np.array([f.unit for _, f in figures], object),
        "grade": np.array([f.grade for _, f in figures], object),
    }
    buffer = io.BytesIO()
    savemat(buffer, arrays, do_compression=True, long_field_names=True, oned_as="column")  # type: ignore[arg-type]  # takes open files, too
    return Exported({"": buffer.getvalue()})
