"""All checks of a recording together: what is wrong with one sensor hides nothing of the others."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.data.samples import GYR, Block
from handscope.estimators.fault_detection.check import check_recording
from handscope.estimators.simulation.scenario import Simulated
from tests.estimators.fault_detection.joint_recordings import (
    amplified,
    delayed,
    exchanged,
    freely_moved,
    slipped,
)
from tests.estimators.fault_detection.recordings import by_matrix, with_readings

NEGATED = by_matrix(np.diag([1.0, -1.0, -1.0]))


def codes(blocks: list[Block]) -> dict[str, set[str]]:
    """Sensors of what is found, by code, but questions."""
    found = check_recording(blocks, freely_moved())
    return {s.message.code: {*s.sensors} for s in found if s.message.severity != "info"}


def late(recording: Simulated) -> list[Block]:
    """From 0.5 s on: the readings before the first are not known."""
    return [b.between(0.5, np.inf) for b in delayed(recording, ["middle_middle"], 0.2)]


@pytest.mark.parametrize(
    ("spoil", "code"),
    [
        (late, "sensors.late"),
        (lambda r: exchanged(r, "index_middle", "index_distal"), "sensors.exchanged"),
        (lambda r: amplified(r, "index_proximal", 1.3), "sensor.gain_at_joints"),
        (lambda r: slipped(r, "middle_middle", 17.0, 12.3), "sensor.slipped"),
    ],
)
def test_a_second_fault_is_found_beside_that_of_a_single_sensor(
    spoil: Callable[[Simulated], list[Block]], code: str
) -> None:
    alone = codes(spoil(freely_moved()))
    both = codes(with_readings(spoil(freely_moved()), GYR, NEGATED, "ring_distal"))
    assert set(alone) == {code}
    own = [c for c, sensors in both.items() if sensors == {"ring_distal"}]
    assert len(own) == 1 and own[0].startswith("sensor.")
    assert {c: sensors for c, sensors in both.items() if c not in own} == alone


def held(blocks: list[Block], sensor: str) -> list[Block]:
    """A sensor repeats a reading for 0.2 s."""
    out = []
    for block in blocks:
        values = block.values.copy()
        if sensor in block.stream.sensors:
            k = block.stream.sensors.index(sensor)
            first = int(np.searchsorted(block.t, 12.0))
            values[(block.t >= 12.0) & (block.t < 12.2), k] = values[first, k]
        out.append(replace(block, values=values))
    return out


def test_a_late_sensor_is_named_though_it_stands_still_for_a_moment() -> None:
    both = codes(held(late(freely_moved()), "middle_middle"))
    assert both == {"sensor.frozen": {"middle_middle"}, "sensors.late": {"middle_middle"}}
