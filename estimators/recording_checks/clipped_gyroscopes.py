"""Gyroscopes that clip: a reading that an axis repeats and never exceeds.

In      a recording, whose full scales are declared or found from its readings (sensors/saturation.py)
Out     a suspicion for all sensors that clip, and from when to when
Limits  those of sensors/saturation.py; an accelerometer that clips in a knock is bridged, and told by processing alone
"""

from collections.abc import Sequence
from itertools import chain

import numpy as np

from handscope.estimators.data.samples import GYR, SATURATION, Block, exceeds
from handscope.estimators.fault_detection.finding import Message, Suspicion
from handscope.estimators.sensors.saturation import find_limits

CLIPPED = "sensors.gyroscope_clipped"


def clipped_gyroscopes(blocks: Sequence[Block]) -> list[Suspicion]:
    """Gyroscopes that reach the limit of their readings.

    Parameters
    ----------
    blocks : sequence of Block
        One block a stream, SI units.

    Returns
    -------
    list of Suspicion
        One for all sensors, `sensors.gyroscope_clipped`; certain.
    """
    spans: dict[str, tuple[float, float]] = {}
    limits: dict[str, float] = {}
    for block in (b for b in blocks if b.stream.inertial):
        limit = find_limits(block, GYR)
        hit = exceeds(block.of(GYR), SATURATION * limit)
        for k in np.flatnonzero(hit.any(axis=0)).tolist():
            t, sensor = block.t[hit[:, k]], block.stream.sensors[k]
            spans[sensor], limits[sensor] = (float(t[0]), float(t[-1])), float(limit[k])
    if not spans:
        return []
    values: dict[str, float | str] = {
        "sensors": ", ".join(spans),
        "limit_deg": float(np.degrees(min(limits.values()))),
        "start": min(start for start, _ in spans.values()),
    }
    times = list(chain(*spans.values()))
    message = Message(CLIPPED, values, "warning")
    return [Suspicion(message, tuple(spans), ((min(times), max(times)),), 0.0)]
