"""What a method noticed of sensors that turned on their segments, as suspicions beside those of the checks."""

import numpy as np

from handscope.estimators.data.mounting_change import MountingChange
from handscope.estimators.fault_detection.finding import Message, Suspicion


def of_change(change: MountingChange) -> Suspicion:
    """Which sensor, by how much, since when: doubtful until the method noticed it, and counts on it from then on."""
    values: dict[str, float | str] = {
        "sensors": ", ".join(change.segments),
        "angle_deg": float(np.degrees(change.turn)),
        "start": change.start,
        "noticed": change.noticed,
    }
    message = (
        Message("sensor.turned", values, "warning")
        if len(change.segments) == 1
        else Message("sensors.one_turned", values, "warning")
    )
    spans = ((change.start, change.noticed),)
    return Suspicion(message, change.segments, spans, change.p_value)
