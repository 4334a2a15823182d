"""MATLAB 5: a struct of columns, one of their units, one of where they are from."""

import io
from typing import Any, cast

from scipy.io import savemat

from handscope.app.exports.columns import columns_of
from handscope.app.results.export_content import Content

LONGEST = 63  # letters of a field's name


def write(content: Content) -> bytes:
    """The file: data.<column> (n, 1), units.<column>, about.<name>."""
    columns = columns_of(content)
    file = io.BytesIO()
    tree = {
        "data": {name[:LONGEST]: values[:, None] for name, _, values in columns},
        "units": {name[:LONGEST]: unit for name, unit, _ in columns},
        "about": dict(content.provenance),
    }
    savemat(cast("Any", file), tree, long_field_names=True, do_compression=True)
    return file.getvalue()
