"""Parquet: one column a quantity, units and provenance in the metadata."""

import io

from handscope.app.exports.columns import columns_of
from handscope.app.exports.extras import require
from handscope.app.results.export_content import Content


def write(content: Content) -> bytes:
    """The file; a field's metadata has its `unit`, the schema's where it is from."""
    pa = require("pyarrow", "exports")
    columns = columns_of(content)
    schema = pa.schema(
        [pa.field(name, pa.float64(), metadata={"unit": unit}) for name, unit, _ in columns],
        metadata={k: str(v) for k, v in content.provenance.items()},
    )
    table = pa.table([pa.array(values) for _, _, values in columns], schema=schema)
    file = io.BytesIO()
    require("pyarrow.parquet", "exports").write_table(table, file, compression="zstd")
    return file.getvalue()
