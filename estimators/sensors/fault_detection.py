"""Faults of single sensors, from their readings: axes that stand still (stuck_axes.py), clipping,
gravity, bias, magnetometers.

In      samples of all streams, one block each; a stretch at rest
Out     Findings; nothing for a healthy sensor
Source  limits from data sheets (MPU-9250 specification rev. 1.0, tables 1-3; LSM330DLC), the
        Earth's field from the IGRF; rules ours
Limits  those of stuck_axes.py and saturation.py
"""

from collections.abc import Sequence

import numpy as np

from handscope.estimators.data.findings import Finding
from handscope.estimators.data.samples import ACC, GYR, MAG, SATURATION, Block, exceeds
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.intervals import find_runs
from handscope.estimators.numerics.typing import Array
from handscope.estimators.sensors import saturation, stuck_axes
from handscope.estimators.sensors.stuck_axes import WORDS

# m/s^2 that |a| at rest may be off: 0.5 is 5 sd of the errors of a calibrated MPU-9250
GRAVITY_DOUBT, GRAVITY_FAULT = (
    0.5,
    1.0,
)
# deg/s: zero-rate level at most 5 (MPU-9250), 20 (LSM330DLC at 2000 deg/s)
BIAS_DOUBT, BIAS_FAULT = (
    10.0,
    20.0,
)
FIELD = (15e-6, 100e-6)  # T, the Earth's is 22 to 67 uT (IGRF), half as much again for a building


def check(blocks: Sequence[Block], rest: tuple[float, float]) -> list[Finding]:
    """All faults of single sensors; `rest` (s) is a stretch in which the hand is still."""
    found = stuck_axes.check(blocks)
    frozen = {f.sensor for f in found if f.kind == "stuck"}
    found += [
        f
        for b in blocks
        for q in (GYR, ACC)
        if q in b.stream.quantities
        for f in _find_saturation(b, q)
    ]
    return found + [
        f for b in blocks for f in _check_at_rest(b.between(*rest)) if f.sensor not in frozen
    ]


def _find_saturation(block: Block, quantity: str) -> list[Finding]:
    """Sensors at their limit, by the known full scale or, without one, by largest readings that
    repeat."""
    limit = saturation.find_limits(block, quantity)
    hit, found = exceeds(block.of(quantity), SATURATION * limit), []
    for k, sensor in enumerate(block.stream.sensors):
        if hit[:, k].any():
            spans = tuple(
                (float(block.t[a]), float(block.t[b - 1])) for a, b in find_runs(hit[:, k])
            )
            sentence = phrase(
                "fault.at_limit", what=WORDS[quantity], count=len(spans), time=spans[0][0]
            )
            found.append(
                Finding(
                    sensor,
                    "saturated",
                    sentence,
                    phrase("fault.larger_range"),
                    "warning",
                    spans,
                )
            )
    return found


def _check_at_rest(block: Block) -> list[Finding]:
    found = []
    for k, sensor in enumerate(block.stream.sensors):
        for quantity in (q for q in block.stream.quantities if q in WORDS):
            samples = block.of(quantity)[:, k]
            samples = samples[np.isfinite(samples).all(axis=1) & (samples != 0).any(axis=1)]
            if len(samples) >= 0.5 * max(len(block.t), 1):
                found += [
                    f for f in [_RESTING[quantity](sensor, samples.mean(axis=0))] if f is not None
                ]
    return found


def _check_gravity(sensor: str, mean: Array) -> Finding | None:
    g = float(np.linalg.norm(mean))
    if abs(g - GRAVITY) <= GRAVITY_DOUBT:
        return None
    sentence = phrase("fault.gravity", g=g, expected=GRAVITY)
    return Finding(
        sensor,
        "gravity",
        sentence,
        phrase("fault.check_calibration"),
        "fault" if abs(g - GRAVITY) > GRAVITY_FAULT else "warning",
    )


def _check_bias(sensor: str, mean: Array) -> Finding | None:
    rate = float(np.degrees(np.linalg.norm(mean)))
    if rate <= BIAS_DOUBT:
        return None
    sentence = phrase("fault.bias", rate=rate)
    return Finding(
        sensor,
        "bias",
        sentence,
        phrase("fault.warm_up"),
        "fault" if rate > BIAS_FAULT else "warning",
    )


def _check_field(sensor: str, mean: Array) -> Finding | None:
    size = float(np.linalg.norm(mean))
    if FIELD[0] <= size <= FIELD[1]:
        return None
    sentence = phrase("fault.field", size=size * 1e6)
    return Finding(
        sensor,
        "magnetometer",
        sentence,
        phrase("fault.leave_iron"),
        "warning",
    )


_RESTING = {GYR: _check_bias, ACC: _check_gravity, MAG: _check_field}
