"""Segments that a sensor's fault reaches through the filter, where a method estimates the sensors of a finger together.

In      sensors at fault, from when to when, and when the filter starts anew
Out     flags (in place): the angles of all segments of the finger are doubtful, those of hand and all fingers where the hand's sensor is at fault
Source  ours: the distal gyroscope with one axis of the wrong sign costs the whole finger its angles in `ekf` and `map`, none but its own joint in `m2`
Limits  thumb and wrist hear from the fingers how the hand's sensor errs (finger_ekf/between_chains), which leaves out a finger that disagrees and is not counted
"""

from collections.abc import Sequence

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.hand.anatomy import CHAINS, SEGMENT, SEGMENTS
from handscope.estimators.pipeline.method import Capabilities

Span = tuple[float, float]  # s


def restarts_of(
    capabilities: Capabilities, calibrations: Sequence[Calibration]
) -> tuple[float, ...] | None:
    """When (s) the method's filter starts anew; none where it solves the whole recording at once, None where it couples no sensors."""
    if not capabilities.couples_chains:
        return None
    return () if capabilities.batch_only else tuple(c.t for c in calibrations)


def coupled_segments(sensors: Sequence[str]) -> list[str]:
    """Those of the fingers of sensors of which one, or all, are at fault; of all fingers where the hand's sensor alone is named, but not where it is one of a joint's two."""
    if set(sensors) == {"hand"}:
        return [s for s in SEGMENTS if s != "forearm"]
    fingers = [s for chain in CHAINS.values() if {*chain} & {*sensors} for s in chain]
    return [*fingers, *(s for s in sensors if s == "forearm")]


def remembered(span: Span, restarts: Sequence[float]) -> Span:
    """How long a fault is in the filter's state: until it starts anew; what lies before the first pose is gone through backwards."""
    if not restarts:
        return -np.inf, np.inf
    (start, stop), first = span, restarts[0]
    until = stop if stop < first else min((t for t in restarts if t > stop), default=np.inf)
    return (-np.inf if start < first else start), until


def flag_coupled(movement: Trajectory, sensors: Sequence[str], spans: Sequence[Span]) -> None:
    """Mark what is coupled with sensors at fault as doubtful (in place), in each of the spans."""
    columns = [SEGMENT[s] for s in coupled_segments(sensors)]
    for span in spans:
        first, last = np.searchsorted(movement.t, span)
        movement.flags[first:last, columns] |= np.uint8(Flag.DOUBTFUL)
