"""The channels of a live stream by their labels, as MAP.json maps them: which belong to which sensor and quantity.

In      a ColumnMap (sessions/table_import/column_map.py)
Out     for each set of quantities of one sensor, the labels of its components and the factors to SI
"""

from dataclasses import dataclass

from handscope.estimators.data.samples import ORIENTATION
from handscope.sessions.table_import.column_map import FACTORS, Column, ColumnMap


@dataclass(frozen=True)
class ChannelSet:
    """Channels of one sensor that become one stream."""

    point: str
    quantities: tuple[str, ...]
    labels: tuple[Column, ...]  # of all components in order
    factors: tuple[float, ...]  # to SI, of each


def channel_sets(columns: ColumnMap) -> list[ChannelSet]:
    """Of each sensor the raw quantities together, the orientation by itself."""
    found = []
    for point, sensor in columns.sensors.items():
        raw = tuple(q for q in sensor.channels if q != ORIENTATION)
        given = tuple(q for q in sensor.channels if q == ORIENTATION)
        for quantities in (q for q in (raw, given) if q):
            channels = [sensor.channels[q] for q in quantities]
            factors = [FACTORS[q][c.unit] for q, c in zip(quantities, channels) for _ in c.columns]
            labels = tuple(label for c in channels for label in c.columns)
            found.append(ChannelSet(point, quantities, labels, tuple(factors)))
    return found
