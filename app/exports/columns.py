"""All samples as named columns with units, for formats of arrays: the columns of the derivative."""

import numpy as np

from handscope.app.results.export_content import Content
from handscope.estimators.numerics.typing import Array
from handscope.sessions.tables_io.trajectory_table import table_of


def columns_of(content: Content) -> list[tuple[str, str, Array]]:
    """Name, unit ("" where there is none) and values (n,) of every column, the time first."""
    described, table = table_of(content.moved)
    values = np.column_stack(table.parts).T
    return [
        (name, "" if unit == "n/a" else unit, column)
        for (name, _, _, _, unit), column in zip(described, values)
    ]
