"""The order of a finger's sensors by how it bends: named where the hand rests, too."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import CHAINS, SEGMENT
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import m2
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.pipeline.recording_calibration import calibrate
from handscope.estimators.recording_checks.finger_order import check_order
from handscope.estimators.recording_checks.free_joints import (
    Exchanged,
    check_joints,
    move_freely,
)
from handscope.estimators.simulation.movements import task_performance as tasks
from handscope.estimators.simulation.scenario import Simulated, simulate_performances
from handscope.estimators.simulation.sensors import SensorErrors

GEOMETRY = sized("left")
CHAIN = CHAINS["ring"]


@cache
def done(task: str) -> Simulated:
    performed = [tasks.TASKS[name](GEOMETRY) for name in ("initial_pose", task)]
    rng = np.random.default_rng(6)
    return simulate_performances(performed, "left", GEOMETRY, rng, SensorErrors())


@pytest.mark.parametrize("task", ["rest", "reach"])
@pytest.mark.parametrize("pair", [CHAIN[:2], CHAIN[::2]])
def test_sensors_of_a_finger_that_only_hangs_bent_are_named(
    task: str, pair: tuple[str, str]
) -> None:
    wrong = Exchanged(done(task), dict((pair, pair[::-1])))
    (found,) = check_joints(wrong, calibrate(m2.Params(), wrong)[0])
    assert set(found.sensors) == set(pair)
    assert found.correction is not None
    assert set(found.correction["exchange"]) == set(pair)  # type: ignore[call-overload]


def test_three_sensors_in_another_order_are_named_together() -> None:
    wrong = Exchanged(done("rest"), dict(zip(CHAIN, (CHAIN[2], CHAIN[0], CHAIN[1]))))
    free = move_freely(wrong, calibrate(m2.Params(), wrong)[0])
    (found,) = check_order(free, joint_angles.of_segments(free.q_GS))
    assert found.message.code == "sensors.exchanged_bending"
    assert set(found.sensors) == set(CHAIN)


@pytest.mark.parametrize("task", ["rest", "reach", "rom_mcp", "rom_wrist"])
def test_the_declared_order_is_not_suspected_where_it_is_right(task: str) -> None:
    recording = done(task)
    assert check_joints(recording, calibrate(m2.Params(), recording)[0]) == []


def test_a_straight_finger_whose_distal_sensor_drifts_is_in_its_order() -> None:
    recording = done("rom_wrist")
    free = move_freely(recording, calibrate(m2.Params(), recording)[0])
    q_GS, k = free.q_GS.copy(), SEGMENT[CHAIN[2]]
    q_GS[:, k] = quat.multiply(q_GS[:, k], quat.about(2, np.radians(-15.0)))
    assert check_order(replace(free, q_GS=q_GS), joint_angles.of_segments(q_GS)) == []
