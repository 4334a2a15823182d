"""Faults of sensors and of files that are injected into faultless recordings, each with its sizes and the code of the finding expected."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from handscope.estimators.data.samples import ACC, GYR, Block
from handscope.estimators.fault_detection.single_sensors.cells import CELL, Cells
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array


def _gyroscope(
    M: Callable[[float, int], Array], start: float = 0.0
) -> Callable[[Cells, float, int], Cells]:
    """A fault: angular rates multiplied by the matrix M(size, axis), from `start` (fraction of the recording) on."""

    def inject(cells: Cells, size: float, axis: int) -> Cells:
        gyr, first = cells.gyr.copy(), int(start * len(cells.gyr))
        gyr[first:] = gyr[first:] @ M(size, axis).T
        return replace(cells, gyr=gyr)

    return inject


def negated_axis(axis: int) -> Array:
    """The matrix (3, 3) that changes the sign of one axis."""
    return np.asarray(np.eye(3) - 2 * np.diag(np.eye(3)[axis]))


def exchanged_axes(axis: int) -> Array:
    """The matrix (3, 3) that swaps two axes: 0 x and y, 1 x and z, 2 y and z."""
    return np.asarray(np.eye(3)[list(((1, 0, 2), (2, 1, 0), (0, 2, 1))[axis])])


def _scale_axis(size: float, axis: int) -> Array:
    """The matrix (3, 3) that scales one axis."""
    return np.asarray(np.eye(3) + (size - 1) * np.diag(np.eye(3)[axis]))


def _rotate_about(size: float, axis: int) -> Array:
    """The rotation (3, 3) by `size` deg about one axis."""
    return np.asarray(Rotation.from_rotvec(np.radians(size) * np.eye(3)[axis]).as_matrix())


def _delay_gyroscope(cells: Cells, size: float, axis: int) -> Cells:
    """Angular rates delayed by `size` s; the first is repeated."""
    n = round(size / CELL)
    return replace(
        cells,
        gyr=np.concatenate([np.repeat(cells.gyr[:1], n, axis=0), cells.gyr[: len(cells.gyr) - n]]),
    )


OF_SENSOR: Mapping[str, tuple[Callable[[Cells, float, int], Cells], tuple[float, ...], str]] = {
    "sign of one gyroscope axis": (
        _gyroscope(lambda _, axis: negated_axis(axis)),
        (1.0,),
        "gyroscope_sign",
    ),
    "sign of one axis, second half": (
        _gyroscope(lambda _, axis: negated_axis(axis), 0.5),
        (1.0,),
        "gyroscope_sign",
    ),
    "gyroscope negated": (_gyroscope(lambda size, axis: -np.eye(3)), (1.0,), "gyroscope_negated"),
    "two gyroscope axes exchanged": (
        _gyroscope(lambda _, axis: exchanged_axes(axis)),
        (1.0,),
        "gyroscope_exchange",
    ),
    "gyroscope in deg/s": (
        _gyroscope(lambda size, axis: np.degrees(np.eye(3))),
        (1.0,),
        "gyroscope_unit",
    ),
    "gyroscope's gain": (
        _gyroscope(lambda size, axis: size * np.eye(3)),
        (1.05, 1.1, 1.15, 1.2, 1.3, 1.5, 2.0),
        "gyroscope_gain",
    ),
    "gain of one axis": (
        _gyroscope(_scale_axis),
        (1.1, 1.2, 1.3, 1.5, 2.0, 3.0),
        "gyroscope_axis_gain",
    ),
    "gyroscope turned in its sensor, deg": (
        _gyroscope(_rotate_about),
        (5.0, 10.0, 20.0, 30.0, 45.0, 60.0),
        "gyroscope_matrix",
    ),
    "gyroscope late, s": (_delay_gyroscope, (0.06, 0.1, 0.2, 0.3, 0.5), "gyroscope_delay"),
}


def change_clock_rate(blocks: list[Block], percent: float) -> list[Block]:
    """Blocks of a file without timestamps that tells a rate too low by so many percent, or too high."""
    longer = 1 + percent / 100
    return [
        replace(b, t=b.t * longer, stream=replace(b.stream, rate=b.stream.rate / longer))
        for b in blocks
    ]


def drop_rows(blocks: list[Block], seconds: float) -> list[Block]:
    """Rows dropped in the middle of the recording; timestamps are shifted to close the gap."""
    out, at = [], 0.55 * max(b.t[-1] for b in blocks)
    for b in blocks:
        rows = (b.t < at) | (b.t >= at + seconds)
        out.append(replace(b, t=b.t[: rows.sum()], values=b.values[rows]))
    return out


def freeze_samples(
    blocks: list[Block], seconds: float, sensors: Sequence[str] | None = None
) -> list[Block]:
    """Blocks in which these sensors, None: all, repeat one sample for so many seconds."""
    out, at = [], 0.55 * max(b.t[-1] for b in blocks)
    for b in blocks:
        rows, values = np.flatnonzero((b.t >= at) & (b.t < at + seconds)), b.values.copy()
        still = [k for k, name in enumerate(b.stream.sensors) if sensors is None or name in sensors]
        values[np.ix_(rows, np.array(still, int))] = values[rows[0], still]
        out.append(replace(b, values=values))
    return out


def _transform_all(quantity: str, M: Array, blocks: list[Block], size: float) -> list[Block]:
    """The quantity of all sensors multiplied by M (3, 3)."""
    out = []
    for b in (b for b in blocks if quantity in b.stream.quantities):
        values = b.values.copy()
        values[..., b.stream.axes(quantity)] = values[..., b.stream.axes(quantity)] @ M.T
        out.append(replace(b, values=values))
    return out


OF_FILE: Mapping[
    str, tuple[Callable[[list[Block], float], list[Block]], tuple[float, ...], str]
] = {
    "rate told too low, %": (change_clock_rate, (3.0, 6.0, 11.0, 25.0, 100.0), "rate"),
    "rows dropped, s": (drop_rows, (0.05, 0.1, 0.3, 1.5), "lost_rows"),
    "all sensors frozen, s": (freeze_samples, (0.1, 0.15, 1.5), "frozen"),
    "one axis of all gyroscopes": (
        partial(_transform_all, GYR, negated_axis(1)),
        (1.0,),
        "gyroscope_sign",
    ),
    "all gyroscopes negated": (
        partial(_transform_all, GYR, -np.eye(3)),
        (1.0,),
        "gyroscope_negated",
    ),
    "all gyroscopes in deg/s": (
        partial(_transform_all, GYR, np.degrees(np.eye(3))),
        (1.0,),
        "gyroscope_unit",
    ),
    "all accelerometers in g": (
        partial(_transform_all, ACC, np.eye(3) / GRAVITY),
        (1.0,),
        "accelerometer_unit",
    ),
}
