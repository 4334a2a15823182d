"""ORNT channels of a tracking system: orientations that a device's own fusion gives.

In      channels with type ORNT, component quat_w, quat_x, quat_y, quat_z, units n/a
Out     a block of orientations; beside other quantities it is a stream of its own
"""

from collections.abc import Mapping, Sequence

import numpy as np

from handscope.estimators.data.samples import ORIENTATION, TRACKED_POINTS, Block, Stream
from handscope.estimators.errors import InputError
from handscope.estimators.numerics.typing import Array

ORNT = "ORNT"
COMPONENTS = ("quat_w", "quat_x", "quat_y", "quat_z")
UNITS = ("n/a", "1", "")


def orientation_columns(
    system: str, channels: Sequence[Mapping[str, str]]
) -> dict[str, tuple[int, ...]]:
    """Columns of w, x, y, z by tracked point; InputError where a channel is not as it must be."""
    found: dict[str, dict[str, int]] = {}
    for column, channel in enumerate(channels):
        point = channel["tracked_point"]
        if channel["type"].upper() != ORNT or point not in TRACKED_POINTS:
            continue
        component, units = channel["component"].lower(), channel["units"]
        if component not in COMPONENTS or units not in UNITS:
            raise InputError(
                "motion_bids.orientation_channel",
                system=system,
                channel=channel["name"],
                component=channel["component"],
                unit=units,
            )
        if component in found.setdefault(point, {}):
            raise InputError(
                "motion_bids.channel_twice",
                system=system,
                point=point,
                kind=ORNT,
                component=component,
            )
        found[point][component] = column
    for point, components in found.items():
        if len(components) < len(COMPONENTS):
            raise InputError(
                "motion_bids.orientation_components_missing", system=system, point=point
            )
    return {p: tuple(found[p][c] for c in COMPONENTS) for p in TRACKED_POINTS if p in found}


def orientation_block(
    name: str, columns: Mapping[str, Sequence[int]], t: Array, table: Array, rate: float
) -> Block:
    """The orientations of a system as a stream of its own."""
    values = np.stack([table[:, list(k)] for k in columns.values()], axis=1)
    return Block(Stream(name, tuple(columns), (ORIENTATION,), rate, name), t, values)
