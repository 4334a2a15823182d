"""JSON lines: a line that says what follows, then a line a sample."""

import numpy as np
import orjson

from handscope.app.exports.columns import columns_of
from handscope.app.results.export_content import Content


def write(content: Content) -> bytes:
    """The file; what is not known is null."""
    columns = columns_of(content)
    head = {
        "about": dict(content.provenance),
        "units": {name: unit for name, unit, _ in columns},
    }
    names = [name for name, _, _ in columns]
    rows = np.column_stack([values for _, _, values in columns]).tolist()
    return b"".join(
        orjson.dumps(line) + b"\n" for line in (head, *(dict(zip(names, r)) for r in rows))
    )
