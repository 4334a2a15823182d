"""Each magnetometer against its own gyroscope: the field carried along must stand still, as gravity does.

In      blocks with magnetometers; cells of the inertial readings, whose gyroscopes gravity found right
Out     magnetometers whose axes have a wrong sign or order, or turn otherwise than the sensor does
Source  as gyroscope_check.py, the field in gravity's place
Limits  iron and magnets that are near bend the field: only signs and orders of axes are told
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.data.samples import MAG, Block
from handscope.estimators.fault_detection.single_sensors.cells import CELL, Cells, means_of
from handscope.estimators.fault_detection.single_sensors.gyroscope_check import Judged, judge
from handscope.estimators.numerics.constants import GRAVITY


def field_cells(cells: Cells, blocks: Sequence[Block]) -> Cells:
    """Cells of the sensors that have a magnetometer, with the field in place of the specific force and of gravity's size.

    Parameters
    ----------
    cells : Cells
        Inertial readings.
    blocks : sequence of Block
        One block a stream, those with magnetometers among them.

    Returns
    -------
    Cells
        Of the sensors that have both; none where there are none.
    """
    columns, fields, valid = [], [], []
    edges = np.asarray(cells.start + CELL * np.arange(len(cells.valid) + 1), float)
    for block in (b for b in blocks if MAG in b.stream.quantities and len(b.t) > 1):
        mean, good = means_of(block, (MAG,), edges)
        for k, sensor in enumerate(block.stream.sensors):
            if sensor in cells.sensors and good[:, k].any():
                size = np.median(np.linalg.norm(mean[good[:, k], k], axis=-1))
                columns.append(cells.sensors.index(sensor))
                fields.append(mean[:, k] * (GRAVITY / max(float(size), 1e-12)))
                valid.append(good[:, k])
    both = cells.of(np.array(columns, dtype=int))
    return (
        replace(both, acc=np.stack(fields, axis=1), valid=both.valid & np.stack(valid, axis=1))
        if columns
        else both
    )


def judge_magnetometers(
    cells: Cells, blocks: Sequence[Block]
) -> tuple[tuple[str, ...], list[Judged]]:
    """What the field shows of the sensors that have a magnetometer: their names, and what is judged of each."""
    fields = field_cells(cells, blocks)
    return fields.sensors, judge(fields, free=False)
