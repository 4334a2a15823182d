"""One line of JSON a sample, for anybody; the first line describes the recording and the columns."""

import numpy as np
import orjson

from handscope.sessions.exports.measured import Exported, Measured
from handscope.sessions.tables_io.trajectory_table import table_of


def write(measured: Measured) -> Exported:
    """SI values under the names of the derivative's columns; null where not known."""
    columns, table = table_of(measured.movement)
    names = [name for name, *_ in columns]
    about = measured.origin.table() | {
        "hand": measured.recording.hand,
        "units": {name: unit for name, _, _, _, unit in columns},
    }
    rows = np.column_stack([np.asarray(part) for part in table.parts]).tolist()
    lines = [orjson.dumps({"handscope": about}, option=orjson.OPT_SERIALIZE_NUMPY)]
    lines += [orjson.dumps(dict(zip(names, row))) for row in rows]
    return Exported({"": b"\n".join([*lines, b""])})
