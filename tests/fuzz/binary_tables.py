"""Tables of other loggers in binary formats: what a good one is, and reading one that may be anything."""

import io
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np

from handscope.sessions.table_import.column_map import TableLayout
from handscope.sessions.table_import.tables import read_table

ROWS = 20
NAMES = ("time", "gyr x", "gyr y", "gyr z")


def reader(suffix: str) -> Callable[[bytes, Path], None]:
    """A target's function for files that end so."""

    def read(data: bytes, folder: Path) -> None:
        path = folder / f"t{suffix}"
        path.write_bytes(data)
        found = read_table(path, TableLayout())
        assert found.values.ndim == 2 and found.values.dtype == float
        assert len(found.names) in (0, found.values.shape[1])

    return read


def spreadsheets() -> list[bytes]:
    """Written by pandas."""
    made = io.BytesIO()
    _frame().to_excel(made, index=False)  # type: ignore[attr-defined]
    return [made.getvalue()]


def parquets() -> list[bytes]:
    """Plain columns, and one of lists as others write them."""
    import pandas as pd

    lists = pd.DataFrame({"time": [0.0, 0.1], "acc": [[1.0, 2.0], [3.0]]})
    return [_frame().to_parquet(index=False), lists.to_parquet(index=False)]  # type: ignore[attr-defined]


def matlabs() -> list[bytes]:
    """A structure of columns."""
    from scipy.io import savemat

    made = io.BytesIO()
    savemat(
        made, {"glove": {name.replace(" ", "_"): _values()[:, k] for k, name in enumerate(NAMES)}}
    )
    return [made.getvalue()]


def xdfs() -> list[bytes]:
    """A stream of three channels as LabRecorder writes it."""
    labels = "".join(f"<channel><label>{name}</label></channel>" for name in NAMES[1:])
    about = (
        "<info><name>glove</name><type>IMU</type><channel_count>3</channel_count>"
        "<nominal_srate>100</nominal_srate><channel_format>double64</channel_format>"
        f"<desc><channels>{labels}</channels></desc></info>"
    )
    rows = b"".join(struct.pack("<Bd3d", 8, *row) for row in _values())
    stream = struct.pack("<I", 1)
    footer = "<info><first_timestamp>0</first_timestamp><last_timestamp>1</last_timestamp></info>"
    chunks = [
        _chunk(1, b"<info><version>1.0</version></info>"),
        _chunk(2, stream + about.encode()),
        _chunk(3, stream + struct.pack("<BI", 4, ROWS) + rows),
        _chunk(6, stream + footer.encode()),
    ]
    return [b"XDF:" + b"".join(chunks)]


def _chunk(tag: int, content: bytes) -> bytes:
    return struct.pack("<BIH", 4, 2 + len(content), tag) + content


def _values() -> np.ndarray:
    t = 0.01 * np.arange(ROWS)
    return np.column_stack([t, np.sin(t), np.cos(t), 0 * t])


def _frame() -> object:
    import pandas as pd

    return pd.DataFrame(dict(zip(NAMES, _values().T)))
