"""Joints that nothing keeps within their limits: exchanged sensors show where joints would bend too far, intact ones nowhere."""

import numpy as np
import pytest

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import SEGMENT
from handscope.estimators.methods import m2
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.pipeline.recording_calibration import calibrate
from handscope.estimators.recording_checks import free_joints
from handscope.estimators.recording_checks.free_joints import Exchanged, check_joints
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors
from tests.simulated import pose_and_wiggle


@pytest.fixture(scope="module")
def intact() -> Simulated:
    return pose_and_wiggle("left", SensorErrors())


@pytest.fixture(scope="module")
def calibrations(intact: Simulated) -> list[Calibration]:
    return calibrate(m2.Params(), intact)[0]


def test_joints_of_intact_sensors_stay_where_joints_go(
    intact: Simulated, calibrations: list[Calibration]
) -> None:
    assert check_joints(intact, calibrations) == []


def test_two_exchanged_sensors_of_a_finger_are_named_by_what_its_joints_would_do(
    intact: Simulated,
) -> None:
    pair = ("ring_middle", "ring_distal")
    wrong = Exchanged(intact, dict((pair, pair[::-1])))
    (found,) = check_joints(wrong, calibrate(m2.Params(), wrong)[0])
    assert (found.message.code, found.sensors) == ("sensors.exchanged_angles", pair)
    assert found.correction == {"exchange": pair}


def test_a_joint_that_would_turn_sideways_is_suspected_with_both_sensors(
    intact: Simulated, calibrations: list[Calibration]
) -> None:
    free = free_joints.move_freely(intact, calibrations)
    k, turned = SEGMENT["index_distal"], free.q_GS.copy()
    turned[-300:, k] = quat.multiply(turned[-300:, k], quat.about(0, np.array(np.radians(60.0))))
    found = list(free_joints.excesses(free, joint_angles.of_segments(turned)))
    assert {free_joints.JOINTS[e.joint].name for e in found} == {"index_dip"}
    assert all(e.span[0] >= free.t[-300] for e in found)


def test_without_a_pose_nothing_is_suspected(intact: Simulated) -> None:
    assert check_joints(intact, []) == []
