"""A table for R, Python and databases: Apache Parquet, units beside every column, what it rests on in the file's metadata."""

import io
import json

import numpy as np

from handscope.estimators.errors import InputError
from handscope.sessions.exports.measured import Exported, Measured
from handscope.sessions.tables_io.trajectory_table import table_of


def write(measured: Measured) -> Exported:
    """SI values under the names of the derivative's columns; null where not known."""
    try:
        import pyarrow as pa
        from pyarrow import parquet as pq
    except ImportError:
        raise InputError("export.package_missing") from None
    columns, table = table_of(measured.movement)
    fields = [pa.field(name, pa.float64(), metadata={"unit": unit}) for name, *_, unit in columns]
    about = measured.origin.table() | {"hand": measured.recording.hand}
    schema = pa.schema(fields, metadata={"handscope": json.dumps(about, default=str)})
    arrays = [pa.array(np.asarray(part, float), from_pandas=True) for part in table.parts]
    buffer = io.BytesIO()
    pq.write_table(pa.Table.from_arrays(arrays, schema=schema), buffer, compression="zstd")
    return Exported({"": buffer.getvalue()})
