"""A movement and its figures as tables for a notebook: columns by name, and data frames where pandas is installed.

In      a trajectory, task results
Out     columns (n,) by name: what a person reads (deg, mm), as the derivative names them; `frame` makes a data frame of them
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.measures.assessment import TaskResult
from handscope.sessions.tables_io.trajectory_table import table_of

# unit that a person reads, and how many of it
READ = {"rad": ("deg", 180 / np.pi), "m": ("mm", 1e3)}


def movement(moved: Trajectory) -> dict[str, Any]:
    """Columns of a trajectory: time in s, angles (index_pip_flexion_deg), tips in the wrist's frame (index_tip_x_mm), orientations, flags.

    Angles of which no sample is known are left out.
    """
    columns, table = table_of(moved)
    found: dict[str, Any] = {}
    for (name, _, _, _, unit), values in zip(columns, table.parts):
        if len(values) and not np.isfinite(values).any():
            continue
        read, factor = READ.get(unit, ("", 1.0))
        found[f"{name}_{read}" if read else name] = (
            factor * np.asarray(values) if read else np.asarray(values)
        )
    return found


def figures(results: Sequence[TaskResult]) -> dict[str, list[Any]]:
    """Columns of all figures of all tasks, a row a figure: SI values, NaN where not measured."""
    rows = [(r, f) for r in results for f in r.figures]
    fields = (
        "name",
        "part",
        "what",
        "value",
        "sd",
        "unit",
        "grade",
        "reason",
        "category",
        "meaning",
        "source",
    )
    table: dict[str, list[Any]] = {
        name: [getattr(r, name) for r, _ in rows] for name in ("task", "measure", "onset", "end")
    }
    table |= {name: [getattr(f, name) for _, f in rows] for name in fields}
    table["sd"] = [np.nan if sd is None else sd for sd in table["sd"]]
    return table


def frame(columns: Mapping[str, Any]) -> Any:
    """A pandas.DataFrame of columns."""
    try:
        import pandas
    except ImportError:
        raise InputError("recording.pandas_missing") from None
    return pandas.DataFrame(dict(columns))
