"""APDM's HDF5 (Opal sensors, version 5 and later): raw samples and orientations by the sensors' labels.

In      Sensors/ID/Accelerometer, Gyroscope, Magnetometer (n, 3) in m/s^2, rad/s, uT, Time (n,) in us; Processed/ID/Orientation (n, 4); the label
        is Sensors/ID/Configuration's attribute `Label 0`
Out     columns `LABEL acc x [m/s^2]` and so on
Source  APDM, Motion Studio help, HDF5 file format; package h5py
"""

from pathlib import Path
from typing import Any

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.numerics.typing import Array
from handscope.sessions.table_import.number_columns import NumberColumns

RAW = (
    ("Accelerometer", "acc", "m/s^2"),
    ("Gyroscope", "gyr", "rad/s"),
    ("Magnetometer", "mag", "uT"),
)


def read_apdm(path: Path) -> NumberColumns:
    """All sensors of the file, which are sampled together; InputError where it is none of APDM's."""
    try:
        import h5py
    except ImportError:
        raise InputError("import.needs_h5py") from None
    try:
        with h5py.File(path, "r") as file:
            return _columns(file, path.name)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as problem:
        raise InputError("import.apdm_unreadable", name=path.name, problem=str(problem)) from None


def _columns(file: Any, name: str) -> NumberColumns:
    names: list[str] = []
    columns: list[Array] = []
    for key in sorted(file["Sensors"]):
        sensor = file["Sensors"][key]
        label = sensor["Configuration"].attrs["Label 0"]
        text = label.decode() if isinstance(label, bytes) else str(label)
        text = text.replace("\0", "").strip()
        if not columns:
            names, columns = ["time [us]"], [np.asarray(sensor["Time"], float).reshape(-1, 1)]
            columns[0] -= columns[0][:1]
        for group, quantity, unit in RAW:
            if group in sensor:
                names += [f"{text} {quantity} {c} [{unit}]" for c in "xyz"]
                columns.append(np.asarray(sensor[group], float))
        processed = file.get(f"Processed/{key}/Orientation")
        if processed is not None:
            names += [f"{text} quat {c}" for c in "wxyz"]
            columns.append(np.asarray(processed, float))
    lengths = sorted({str(len(c)) for c in columns})
    if len(lengths) != 1:
        raise InputError("import.apdm_lengths", name=name, lengths=", ".join(lengths))
    return NumberColumns(name, tuple(names), np.concatenate(columns, axis=1))
